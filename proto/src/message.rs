//! The messages.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Everything that goes over a link.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// To the controller: sensors and command of one tick.
    Input(Input),
    /// From the controller: the outcome of that tick.
    Output(Output),
    // Order and fields of what stands here are its bytes: append only.
    /// To the autopilot in lockstep: what has come since the tick before.
    Readings(Readings),
    /// From the autopilot in lockstep: the outcome of that tick.
    Outcome(Outcome),
    /// Ground to craft: where motion capture sees it.
    Pose(TimedPose),
    /// Ground to craft: what is asked for.
    Command(Command),
    /// Ground to craft: arm, disarm, land or cut.
    Request(Request),
    /// Ground to craft: gains of one loop. Heard while disarmed only.
    Gains(Gains),
    /// Ground to craft: the ground's clock; telemetry carries the newest back.
    Timer(Timer),
    /// Ground to craft: who are you?
    Who,
    /// Craft to ground: everything about a tick.
    Telemetry(Telemetry),
    /// Craft to ground: who it is.
    Identity(Identity),
    /// Craft to ground: what became of a request or of gains.
    Answer(Answer),
    /// Craft to ground, behind its identity: how it ended before it was started.
    LastEnd(Ending),
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

impl Command {
    /// Nothing is asked for, motors idle.
    pub const IDLE: Self = Self {
        mode: Mode::Position,
        attitude_rad: [0.0; 2],
        yaw_rad: 0.0,
        z_m: 0.0,
        position_m: [0.0; 2],
        cut_off: true,
        injection: [0.0; 4],
    };
}

/// The outcome of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Number of the tick it answers.
    pub tick: u32,
    /// Motor commands, command units.
    pub pwm: [f32; 4],
    /// Commanded roll, pitch, yaw before the prefilters (from the outer loop in position mode),
    /// rad.
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
    /// Ticks so far with a fault in measurement, command, battery voltage or in the controller
    /// itself.
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

/// Where motion capture sees the craft.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Tracked point, inertial NED, m.
    pub position_m: [f32; 3],
    /// Roll, pitch, yaw (Z-Y-X), rad.
    pub attitude_rad: [f32; 3],
}

/// A pose and when it was taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimedPose {
    /// Number of the tracker's frame.
    pub frame: u32,
    /// The ground's clock when it was taken, us modulo 2^32.
    pub ground_us: u32,
    /// The pose.
    pub pose: Pose,
}

/// What the ground asks for, beside the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Request {
    /// Arm, if every preflight check is good.
    Arm,
    /// Motors to idle; the only way out of cut.
    Disarm,
    /// Land where it is.
    Land,
    /// Motors to idle for good.
    Cut,
}

/// What has come to an autopilot since the tick before.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Readings {
    /// Number of the tick, from 0; the answer carries it back.
    pub tick: u32,
    /// The craft's clock, us modulo 2^32.
    pub time_us: u32,
    /// The newest pose.
    pub pose: Option<Pose>,
    /// Gyro p, q, r, body FRD, rad/s.
    pub gyro_rad_s: Option<[f32; 3]>,
    /// Battery voltage, V.
    pub battery_v: f32,
    /// The newest command.
    pub command: Option<Command>,
    /// The newest request.
    pub request: Option<Request>,
    /// Whether outputs and the program's own checks are good.
    pub outputs_ready: bool,
}

/// What the craft is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Motors idle.
    Disarmed,
    /// Motors idle; a command without cut-off takes off.
    Armed,
    /// The ground's command is flown.
    Flying,
    /// Staying where it is.
    Hold,
    /// Going down where it is.
    Land,
    /// Motors idle until it is disarmed.
    Cut,
}

/// What the supervisor has found and made of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Supervision {
    /// What the craft is doing.
    pub state: State,
    /// One bit a condition; the flight law's crate says which.
    pub conditions: u32,
    /// One bit a preflight check that is good; while disarmed only.
    pub preflight: u16,
}

/// The outcome of an autopilot's tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What the controller made of it.
    pub output: Output,
    /// What the supervisor made of it.
    pub supervision: Supervision,
}

/// A loop of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Loop {
    /// Roll angle.
    Roll,
    /// Pitch angle.
    Pitch,
    /// Yaw angle.
    Yaw,
    /// Height.
    Altitude,
    /// Position along x.
    X,
    /// Position along y.
    Y,
}

/// Gains of one loop, in the units of the gains file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    /// The loop.
    pub of: Loop,
    /// Proportional.
    pub kp: f32,
    /// Integral.
    pub ki: f32,
    /// Velocity feedback.
    pub kd: f32,
}

/// The ground's ramp of time (thesis 5.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timer {
    /// us modulo 2^32.
    pub ground_us: u32,
}

/// Everything about a tick (thesis chapter 3).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Telemetry {
    /// Number of the tick.
    pub tick: u32,
    /// The craft's ramp of time, us modulo 2^32.
    pub craft_us: u32,
    /// The ground's ramp of time as it came last, us modulo 2^32.
    pub ground_us: u32,
    /// What the supervisor says.
    pub supervision: Supervision,
    /// Which loops are closed.
    pub mode: Mode,
    /// Roll, pitch, yaw commands before the prefilters, rad.
    pub attitude_command_rad: [f32; 3],
    /// Commanded inertial z before the prefilter, m.
    pub z_command_m: f32,
    /// Motion capture as it was flown with.
    pub tracked: Pose,
    /// Body rates from motion capture (blended with the gyro where the law does so), rad/s.
    pub tracked_rates_rad_s: [f32; 3],
    /// The IMU, if it spoke.
    pub imu: Option<ImuSample>,
    /// Commanded thrust, N (command units in a hand-tuned law).
    pub thrust: f32,
    /// Commanded roll, pitch, yaw acceleration, rad/s^2 (command units in a hand-tuned law).
    pub torque: [f32; 3],
    /// Motor commands, command units.
    pub pwm: [f32; 4],
    /// Directions in which the motors could not follow.
    pub refused: Refusal,
    /// Battery voltage, V.
    pub battery_v: f32,
    /// Battery current, A, if it is measured.
    pub current_a: Option<f32>,
    /// What has gone wrong so far.
    pub counters: Counters,
}

/// What an IMU board says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ImuSample {
    /// Gyro p, q, r, body FRD, rad/s.
    pub gyro_rad_s: [f32; 3],
    /// Its own estimate of roll, pitch, yaw, rad, if it makes one.
    pub attitude_rad: Option<[f32; 3]>,
    /// Specific force, body FRD, m/s^2, if it measures it.
    pub acceleration_m_s2: Option<[f32; 3]>,
}

/// What has gone wrong since the start, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counters {
    /// Greatest lateness of a tick since the telemetry before, us.
    pub jitter_us: u32,
    /// Late ticks.
    pub overruns: u32,
    /// Leaps of the clock.
    pub clock_jumps: u32,
    /// Poses refused.
    pub poses_refused: u32,
    /// Ticks without a usable IMU sample.
    pub imu_refused: u32,
    /// Commands refused.
    pub commands_refused: u32,
    /// Faults of the controller's inputs and results.
    pub faults: u32,
    /// Packets that never came, by the gaps in their numbers.
    pub packets_lost: u32,
    /// Packets refused: damaged, forged, replayed or not for this craft.
    pub packets_refused: u32,
}

/// Who a craft is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Oldest and newest version of the messages that it understands.
    pub versions: [u8; 2],
    /// Version of its program: major, minor, patch.
    pub program: [u16; 3],
    /// SHA-256 of its gains and vehicle file.
    pub vehicle_sha256: [u8; 32],
    /// What the craft is doing.
    pub state: State,
}

/// What became of something that was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// Number of the packet that asked.
    pub to: u64,
    /// Whether it was done.
    pub done: bool,
    /// Preflight checks that were good at that time, one bit each.
    pub preflight: u16,
}

/// How a craft's program, or the chip that it runs on, ended before this start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Ending {
    /// Nothing says.
    Unknown,
    /// Its power was off.
    PowerOff,
    /// The chip's supply voltage fell too low.
    BrownOut,
    /// The chip's watchdog was not fed.
    Watchdog,
    /// The chip's reset pin was pulled.
    ResetPin,
    /// The chip was reset by a program.
    Software,
    /// The program was asked to stop, and did.
    Stopped,
    /// The process that flies died by itself, or hung and was killed.
    LoopDied,
    /// The process that watches the one that flies was killed.
    GuardianKilled,
    /// The computer stopped under the program.
    ComputerStopped,
}

impl Ending {
    /// Whether nobody meant it to end so.
    pub const fn is_fault(self) -> bool {
        matches!(
            self,
            Self::BrownOut | Self::Watchdog | Self::LoopDied | Self::GuardianKilled | Self::ComputerStopped
        )
    }
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unknown => "how it ended before is not known",
            Self::PowerOff => "its power was off before",
            Self::BrownOut => "it was reset because its supply voltage fell too low (brown-out)",
            Self::Watchdog => "its watchdog reset it: the program hung or panicked",
            Self::ResetPin => "it was reset by its reset pin (a button or a debugger)",
            Self::Software => "it was reset by a program",
            Self::Stopped => "its program was stopped as asked",
            Self::LoopDied => "its flight loop died or hung; the guardian idled the motors",
            Self::GuardianKilled => "its guardian was killed; the flight loop idled the motors",
            Self::ComputerStopped => "its computer stopped: power lost, or reset",
        })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;

    #[test]
    fn an_ending_that_nobody_meant_is_a_fault_and_each_has_words() {
        for (ending, is_fault, words) in [
            (Ending::Unknown, false, "not known"),
            (Ending::PowerOff, false, "power was off"),
            (Ending::BrownOut, true, "brown-out"),
            (Ending::Watchdog, true, "watchdog"),
            (Ending::ResetPin, false, "reset pin"),
            (Ending::Software, false, "by a program"),
            (Ending::Stopped, false, "as asked"),
            (Ending::LoopDied, true, "loop died"),
            (Ending::GuardianKilled, true, "guardian was killed"),
            (Ending::ComputerStopped, true, "computer stopped"),
        ] {
            assert_eq!(ending.is_fault(), is_fault, "{ending:?}");
            assert!(ending.to_string().contains(words), "{ending}");
        }
    }
}
