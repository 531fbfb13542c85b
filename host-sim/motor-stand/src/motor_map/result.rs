//! What a run on the stand says: clocks, map, lag, and the maps that were compared.

use schemars::JsonSchema;
use serde::Serialize;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Estimated {
    /// Value.
    pub value: f64,
    /// Standard error.
    pub std_error: f64,
}

/// The tachometer's clock against the craft's: craft = tachometer + offset + skew (tachometer -
/// middle).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct StandClock {
    /// At the middle, s.
    pub offset_s: Estimated,
    /// By which part the craft's clock runs faster.
    pub skew: Estimated,
    /// Middle of the run on the tachometer's clock, s.
    pub middle_s: f64,
}

/// Map (4.10) and lag.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Map {
    /// rad/s per command unit.
    pub command: Estimated,
    /// rad/s per volt; absent where it was left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voltage: Option<Estimated>,
    /// rad/s.
    pub offset: Estimated,
    /// First-order lag, rad/s.
    pub lag: Estimated,
    /// Whether the run determines the lag.
    pub lag_is_known: bool,
    /// Root mean square of what is left, rad/s.
    pub rms_rad_s: f64,
}

/// One of the maps that were compared.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Judged {
    /// Its terms besides the constant.
    pub terms: &'static str,
    /// Coefficients, the constant last.
    pub coefficients: Vec<f64>,
    /// Root mean square error where it was fitted, rad/s.
    pub fitted_rad_s: f64,
    /// Where it was not, rad/s.
    pub held_out_rad_s: f64,
    /// The map it is held against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<&'static str>,
    /// By how much the held-out squared error is below that one's, percent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop_percent: Option<f64>,
    /// Standard deviations by which that fall stands out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviations: Option<f64>,
    /// Whether it is better by more than chance and enough to matter.
    pub supported: bool,
}

/// A motor by itself.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MotorMap {
    /// 1 to 4; 0 where the logs do not say.
    pub motor: usize,
    /// Its own map and lag.
    pub map: Map,
    /// How much faster it turns than the common map says on average, rad/s.
    pub faster_rad_s: Estimated,
}

/// Samples behind the fit, for figures.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Motor of each.
    pub motor: Vec<usize>,
    /// On the tachometer's clock, s.
    pub time_s: Vec<f64>,
    /// Command that held, command units.
    pub command: Vec<f64>,
    /// V.
    pub battery_v: Vec<f64>,
    /// rad/s.
    pub measured_rad_s: Vec<f64>,
    /// rad/s.
    pub predicted_rad_s: Vec<f64>,
}

/// What a run says.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct StandResult {
    /// Clocks.
    pub clock: StandClock,
    /// Of all motors together.
    pub map: Map,
    /// Each motor, where there are several.
    pub motors: Vec<MotorMap>,
    /// Maps from the simplest to the longest.
    pub maps: Vec<Judged>,
    /// The terms that the data support.
    pub supported: &'static str,
    /// Samples fitted.
    pub samples: usize,
    /// Samples left out as missed pulses.
    pub missed_pulses: usize,
    /// Samples left out because a log has a gap, a rotor stood, or began.
    pub left_out: usize,
    /// Smallest and largest voltage, V.
    pub battery_v: [f64; 2],
    /// For figures.
    #[serde(skip)]
    pub figures: Samples,
}
