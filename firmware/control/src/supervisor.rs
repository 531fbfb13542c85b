//! Supervision.

/// Which loops are closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Inner loops only: roll, pitch, yaw and altitude are commanded.
    #[default]
    Attitude,
    /// Outer loop too: position, yaw and altitude are commanded.
    Position,
}

/// What the pilot or the ground station asks for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Which loops are closed.
    pub mode: Mode,
    /// Roll and pitch in rad; used in [`Mode::Attitude`].
    pub attitude_rad: [f32; 2],
    /// Yaw in rad; any branch, the short way round is flown.
    pub yaw_rad: f32,
    /// Inertial z in m, down positive: height is `-z_m`.
    pub z_m: f32,
    /// Inertial x and y in m; used in [`Mode::Position`].
    pub position_m: [f32; 2],
    /// Motors to idle, integrators to zero.
    pub cut_off: bool,
    /// Added to each motor command for system identification, in command units.
    pub injection: [f32; 4],
}

/// How often something was wrong, by kind, since the controller was made or reset; and whether it was in this tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// Position, attitude or gyro not finite or beyond reason: the last good value was used.
    pub measurement: Fault,
    /// A command not finite or beyond reason: the last good value was used.
    pub command: Fault,
    /// Voltage not finite or beyond reason: the last good value was used.
    pub battery: Fault,
    /// A result was not finite: memory was reset and the last motor commands repeated.
    pub internal: Fault,
}

/// One kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Fault {
    /// Raised in this tick.
    pub now: bool,
    /// Ticks in which it was raised; stays at the greatest number once reached.
    pub count: u32,
}
