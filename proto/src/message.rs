//! The messages.

use serde::{Deserialize, Serialize};

/// Everything that goes over a link.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// To the controller: sensors and command of one tick.
    Input(Input),
    /// From the controller: the outcome of that tick.
    Output(Output),
}

/// What the controller needs for one tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// Number of the tick, from 0; the answer carries it back.
    pub tick: u32,
    /// What the sensors say.
    pub measurement: Measurement,
    /// What is asked for.
    pub command: Command,
}

/// What the sensors say.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Tracked point, inertial NED, m.
    pub position_m: [f32; 3],
    /// Roll, pitch, yaw, rad.
    pub attitude_rad: [f32; 3],
    /// Gyro p, q, r, body FRD, rad/s.
    pub gyro_rad_s: Option<[f32; 3]>,
    /// Battery voltage, V.
    pub battery_v: f32,
}

/// Which loops are closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// Inner loops: roll, pitch, yaw and altitude are commanded.
    Attitude,
    /// Outer loop too: position, yaw and altitude are commanded.
    Position,
}

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Which loops are closed.
    pub mode: Mode,
    /// Roll and pitch, rad.
    pub attitude_rad: [f32; 2],
    /// Yaw, rad.
    pub yaw_rad: f32,
    /// Inertial z, down positive, m.
    pub z_m: f32,
    /// Inertial x and y, m.
    pub position_m: [f32; 2],
    /// Motors to idle.
    pub cut_off: bool,
    /// Added to each motor command, command units.
    pub injection: [f32; 4],
}

/// The outcome of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Number of the tick it answers.
    pub tick: u32,
    /// Motor commands, command units.
    pub pwm: [f32; 4],
    /// Commanded roll, pitch, yaw before the prefilters (from the outer loop in position mode), rad.
    pub attitude_command_rad: [f32; 3],
    /// Commanded inertial z before the prefilter, m.
    pub z_command_m: f32,
    /// Position reference of the outer loop, inertial x and y, m; in position mode only.
    pub position_reference_m: Option<[f32; 2]>,
    /// Commanded thrust, N (command units in a hand-tuned law).
    pub thrust: f32,
    /// Commanded roll, pitch, yaw acceleration, rad/s^2 (command units in a hand-tuned law).
    pub torque: [f32; 3],
    /// Directions in which the motors could not follow.
    pub refused: Refusal,
    /// Ticks so far with a fault in measurement, command, battery voltage or in the controller itself.
    pub faults: u32,
}

/// Axes that were refused, `[more than there is, less than there is]` each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Refusal {
    /// Thrust.
    pub thrust: [bool; 2],
    /// Roll torque.
    pub roll: [bool; 2],
    /// Pitch torque.
    pub pitch: [bool; 2],
    /// Yaw torque.
    pub yaw: [bool; 2],
}

impl Refusal {
    /// Whether any axis was refused.
    #[must_use]
    pub fn any(&self) -> bool {
        [self.thrust, self.roll, self.pitch, self.yaw].as_flattened().contains(&true)
    }
}
