//! Everything that a tick of the law computes, for logs, telemetry and tests.

use crate::allocation::mixer::Refused;
use crate::inputs::input_checks::Faults;
use crate::law::pid::PidTerms;

/// Terms of the outer loop.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OuterTerms {
    /// Rate-limited reference x, y in m.
    pub reference_m: [f32; 2],
    /// Reference minus measurement, x and y in m.
    pub error_m: [f32; 2],
    /// Estimated velocity along x and y in m/s.
    pub velocity_m_s: [f32; 2],
    /// Loop along x, in rad.
    pub x: PidTerms,
    /// Loop along y, in rad.
    pub y: PidTerms,
}

/// Everything a tick computed on the way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Terms {
    /// Measured position as used (held if the measurement was bad), m.
    pub position_m: [f32; 3],
    /// Measured attitude as used, yaw in (-pi, pi], rad.
    pub attitude_rad: [f32; 3],
    /// Voltage as used, V.
    pub battery_v: f32,
    /// Estimated Euler rates, rad/s.
    pub euler_rates_rad_s: [f32; 3],
    /// Body rates p, q, r as used by the loops, rad/s.
    pub body_rates_rad_s: [f32; 3],
    /// Estimated rate of inertial z (down positive), m/s.
    pub z_rate_m_s: f32,
    /// The outer loop; `None` in attitude mode.
    pub outer: Option<OuterTerms>,
    /// Commands before the prefilters and before any tilt reduction: roll, pitch, yaw in rad (from
    /// the outer loop in position mode).
    pub attitude_command_rad: [f32; 3],
    /// Altitude command before the prefilter, inside the position limits: inertial z in m.
    pub z_command_m: f32,
    /// Commands after the prefilters: roll, pitch, yaw in rad.
    pub attitude_reference_rad: [f32; 3],
    /// Altitude command after the prefilter: inertial z in m.
    pub z_reference_m: f32,
    /// Roll, pitch, yaw errors in rad, yaw the short way round.
    pub attitude_error_rad: [f32; 3],
    /// Altitude error in m of inertial z.
    pub z_error_m: f32,
    /// Roll loop.
    pub roll: PidTerms,
    /// Pitch loop.
    pub pitch: PidTerms,
    /// Yaw loop.
    pub yaw: PidTerms,
    /// Altitude loop; its output is taken off the hover thrust.
    pub altitude: PidTerms,
    /// Commanded thrust, N (command units in the hand-tuned law).
    pub thrust: f32,
    /// Commanded roll, pitch, yaw acceleration, rad/s^2 (command units in the hand-tuned law).
    pub torque: [f32; 3],
    /// Commanded rotor speeds in rad/s; `None` in the hand-tuned law, which knows no rotor speeds.
    pub rotor_speed_rad_s: Option<[f32; 4]>,
}

/// The outcome of one tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tick {
    /// Motor commands in command units (us for the thesis' craft): always finite, always inside the
    /// command range.
    pub pwm: [f32; 4],
    /// The terms that led to them.
    pub terms: Terms,
    /// What the motors could not follow.
    pub refused: Refused,
    /// What was wrong with the inputs.
    pub faults: Faults,
}
