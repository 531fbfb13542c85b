//! What comes in with a tick: [`Readings`] from the program, with poses, gyro samples, commands and
//! requests in them, and the [`Measurement`] that the autopilot makes of the first two for the law.
//!
//! Plain values: what is bad in them is found by the detectors and by
//! [`input_checks`](crate::inputs::input_checks).

/// Where motion capture sees the craft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position of the tracked point, inertial NED, in m.
    pub position_m: [f32; 3],
    /// Roll phi, pitch theta, yaw psi (Z-Y-X) in rad; yaw on any branch.
    pub attitude_rad: [f32; 3],
}

/// What the ground asks for, beside the command. Each request counts in the tick in which it comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Arm, if every preflight check is good.
    Arm,
    /// Motors to idle, from any state; the only way out of cut.
    Disarm,
    /// Land here.
    Land,
    /// Motors to idle until disarmed.
    Cut,
}

/// Whatever has come since the tick before. What did not come is `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// The craft's monotonic clock in us, modulo 2^32.
    pub time_us: u32,
    /// The newest pose.
    pub pose: Option<Pose>,
    /// How long ago it was taken at least, us; 0 where nobody knows.
    pub pose_age_us: u32,
    /// The newest gyro sample p, q, r, body FRD, in rad/s.
    pub gyro_rad_s: Option<[f32; 3]>,
    /// Battery voltage in V; NaN if it could not be measured.
    pub battery_v: f32,
    /// The newest command. One with a value that is not finite counts as none.
    pub command: Option<Command>,
    /// The newest request.
    pub request: Option<Request>,
    /// Whether the program's outputs work and its own checks passed.
    pub outputs_ready: bool,
}

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

/// What the sensors say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Position of the tracked point, inertial NED, in m.
    pub position_m: [f32; 3],
    /// Roll phi, pitch theta, yaw psi (Z-Y-X) in rad; yaw on any branch.
    pub attitude_rad: [f32; 3],
    /// Gyro p, q, r, body FRD, in rad/s; used when the configuration has gyro fusion.
    pub gyro_rad_s: Option<[f32; 3]>,
    /// Battery voltage in V.
    pub battery_v: f32,
}
