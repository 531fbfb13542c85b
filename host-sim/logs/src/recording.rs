//! What a log says of a craft, in quadlab's frames and units: every quantity with the times of its own sensor.
//!
//! Inertial frame north-east-down, body frame front-right-down, rotors 1 front-left, 2 front-right, 3 rear-right, 4 rear-left;
//! seconds on one clock.

/// What a log says of a craft.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// The quantities.
    pub signals: Signals,
    /// When the craft says that it flies or is armed, s; empty where the log does not say.
    pub airborne: Vec<Span>,
    /// When the log's own estimator was not sure of position or velocity, or these jumped, s. What lies within is left out.
    pub untrusted: Vec<Span>,
    /// The same of the attitude, s.
    pub untrusted_attitude: Vec<Span>,
    /// When the craft could not write, s. Rows within are left out, and nothing runs on across.
    pub dropouts: Vec<Span>,
    /// What the log says about the craft.
    pub hints: Hints,
    /// What this log cannot tell, a sentence each, with the setting of the craft that would log it.
    pub limits: Vec<String>,
    /// What was done to the log on the way, a sentence each: clocks mended, times that went back.
    pub notes: Vec<String>,
}

/// First and last time, s.
pub type Span = [f64; 2];

/// A quantity of `N` components with times of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal<const N: usize> {
    /// Name of the table it is from, as the format has it.
    pub source: String,
    /// Strictly rising, s.
    pub t: Vec<f64>,
    /// Components; NaN where a value is missing.
    pub values: [Vec<f64>; N],
}

/// The quantities of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Signals {
    /// Position, inertial, m.
    pub position: Option<Signal<3>>,
    /// Velocity, inertial, m/s.
    pub velocity: Option<Signal<3>>,
    /// Attitude: quaternion w, x, y, z that turns body into inertial vectors; unit length, signs continuous.
    pub attitude: Option<Signal<4>>,
    /// Body rates, rad/s.
    pub rates: Option<Signal<3>>,
    /// Specific force, body, m/s^2.
    pub specific_force: Option<Signal<3>>,
    /// Motor commands in the log's unit.
    pub commands: Option<Signal<4>>,
    /// Rotor speeds, rad/s.
    pub rotor_speed: Option<Signal<4>>,
    /// Battery voltage, V.
    pub voltage: Option<Signal<1>>,
    /// Further quantities by the name that formulas know them by: `load_north`.
    pub extra: Vec<(String, Signal<1>)>,
}

/// What a log says about the craft, for its vehicle file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hints {
    /// The craft's name.
    pub name: Option<String>,
    /// Each motor's sense of turning seen from above, as the vehicle file has it: "cw" or "ccw".
    pub spin: Option<[&'static str; 4]>,
    /// Lowest and highest command.
    pub command_range: Option<[f64; 2]>,
    /// Unit of the commands: "us", "1" ...
    pub command_unit: Option<String>,
    /// Positions of the rotors from the centre of mass, body front and right, m.
    pub rotor_positions_m: Option<[[f64; 2]; 4]>,
    /// Cells of the battery.
    pub cells: Option<u32>,
    /// Air density, kg/m^3, from the log's pressure and temperature.
    pub air_density: Option<f64>,
    /// Gravity, m/s^2, from the log's latitude.
    pub gravity: Option<f64>,
}
