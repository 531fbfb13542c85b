//! What a check says: numbers for text, JSON and pages.

use schemars::JsonSchema;
use serde::Serialize;

use crate::analysis::{Mode, SteadyTilt, StepMetrics, Together};
use crate::loops::View;

/// What is checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckOptions {
    /// Continuous as the thesis designs, or sampled as the law flies.
    pub view: View,
    /// Draws of the model's coefficients.
    pub samples: usize,
    /// Seed of the draws.
    pub seed: u64,
}

/// A complex number as `[re, im]`.
pub type Pair = [f64; 2];

/// One loop.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LoopReport {
    /// `roll`, `pitch`, `yaw`, `z`, `x` or `y`.
    pub name: &'static str,
    /// Whether the closed loop is stable.
    pub stable: bool,
    /// At the error, velocity feedback closed (the thesis' margins), degrees.
    pub phase_margin_deg: Option<f64>,
    /// Factor by which the gain at the error may grow.
    pub gain_margin: Option<f64>,
    /// Factor to which it may fall.
    pub gain_reduction_margin: Option<f64>,
    /// Gain crossover frequency, rad/s.
    pub crossover_rad_s: Option<f64>,
    /// Phase crossover frequency, rad/s.
    pub phase_crossover_rad_s: Option<f64>,
    /// Age that the pose may gain before the loop is unstable, s.
    pub delay_margin_s: Option<f64>,
    /// Greatest sensitivity 1/|1+L|, at the error.
    pub sensitivity_peak: f64,
    /// Where, rad/s.
    pub sensitivity_peak_rad_s: f64,
    /// Margins with the loop cut at the actuator, where an error of thrust or moments enters.
    pub at_actuator: ActuatorMargins,
    /// Oscillating mode with the least damping.
    pub least_damped: Option<Mode>,
    /// Closed-loop poles: in s (rad/s) for the continuous view, in z for the sampled one.
    pub poles: Vec<Pair>,
}

/// Margins with the loop cut at the actuator, where everything that the law feeds back goes
/// through.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct ActuatorMargins {
    /// Least phase margin, degrees.
    pub phase_margin_deg: Option<f64>,
    /// Factor by which the gain may grow.
    pub gain_margin: Option<f64>,
    /// Factor to which it may fall.
    pub gain_reduction_margin: Option<f64>,
    /// Gain crossover frequency of the phase margin, rad/s.
    pub crossover_rad_s: Option<f64>,
    /// Phase crossover frequency of the gain margin, rad/s.
    pub phase_crossover_rad_s: Option<f64>,
    /// Greatest sensitivity 1/|1+L|.
    pub sensitivity_peak: f64,
    /// Frequency of that peak, rad/s.
    pub sensitivity_peak_rad_s: f64,
}

/// A step response: through prefilter or rate limit (1 m), and of the bare loop.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct StepReport {
    /// The loop.
    pub name: &'static str,
    /// Through the prefilter; for x and y 1 m through the rate limit.
    #[serde(flatten)]
    pub commanded: StepMetrics,
    /// `[seconds, response over step]`.
    pub samples: Vec<Pair>,
    /// Without prefilter or rate limit.
    pub without_prefilter: StepMetrics,
}

/// A step disturbance at the actuator (appendix B).
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DisturbanceReport {
    /// The loop.
    pub name: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// Value of greatest magnitude.
    pub peak: f64,
    /// When, s.
    pub peak_s: f64,
    /// Value after [`crate::analysis::LONG_S`].
    pub last: f64,
    /// Value after that time without the integral part.
    pub last_without_integral: f64,
}

/// Margins with a zero of the plant moved under an unchanged canceller (appendix A).
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MovedZero {
    /// The loop.
    pub name: &'static str,
    /// The plant's zero is at minus this, rad/s.
    pub zero_rad_s: f64,
    /// At the error, degrees.
    pub phase_margin_deg: Option<f64>,
    /// rad/s.
    pub crossover_rad_s: Option<f64>,
}

/// Spread of a number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Spread {
    /// Worst.
    pub min: f64,
    /// One in twenty is below.
    pub p05: f64,
    /// Middle.
    pub median: f64,
    /// One in twenty is above.
    pub p95: f64,
}

/// Margins of a loop over draws of the model.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LoopSpread {
    /// The loop.
    pub name: &'static str,
    /// Draws for which it is unstable.
    pub unstable: usize,
    /// Degrees.
    pub phase_margin_deg: Option<Spread>,
    /// Factor.
    pub gain_margin: Option<Spread>,
    /// s.
    pub delay_margin_s: Option<Spread>,
}

/// Margins over draws of the model's coefficients.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Uncertainty {
    /// Draws.
    pub samples: usize,
    /// Seed.
    pub seed: u64,
    /// Coefficients with a standard error.
    pub coefficients: usize,
    /// Whether the model holds the correlations of their errors; otherwise they are drawn as
    /// independent.
    pub correlated: bool,
    /// Draws with at least one unstable loop.
    pub unstable: usize,
    /// Draws that cannot hover or whose loops cannot be built.
    pub failed: usize,
    /// Loops.
    pub loops: Vec<LoopSpread>,
}

/// Margins at one battery voltage.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BatteryReport {
    /// V.
    pub battery_v: f64,
    /// Greatest thrust over weight.
    pub thrust_to_weight: f64,
    /// Loops.
    pub loops: Vec<BatteryLoop>,
}

/// A loop at one battery voltage.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BatteryLoop {
    /// The loop.
    pub name: &'static str,
    /// Whether it is stable.
    pub stable: bool,
    /// Degrees.
    pub phase_margin_deg: Option<f64>,
    /// Factor.
    pub gain_margin: Option<f64>,
    /// s.
    pub delay_margin_s: Option<f64>,
}

/// The whole report.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CheckReport {
    /// The vehicle's name.
    pub vehicle: String,
    /// `continuous` or `sampled`.
    pub view: &'static str,
    /// Age of the pose, samples; absent in the continuous view.
    pub delay_samples: Option<usize>,
    /// Whether every loop is stable, also at every voltage and in every draw of the model, and all
    /// of them together.
    pub holds: bool,
    /// All loops closed at once.
    pub together: Together,
    /// Loops.
    pub loops: Vec<LoopReport>,
    /// Step responses of the stable loops.
    pub steps: Vec<StepReport>,
    /// Disturbance responses of the stable loops.
    pub disturbances: Vec<DisturbanceReport>,
    /// Appendix A, for loops with a canceller.
    pub moved_zero: Vec<MovedZero>,
    /// Over the identification's uncertainty; absent if the model has no standard errors.
    pub uncertainty: Option<Uncertainty>,
    /// Over the battery's voltage; empty if the model does not say at which voltage it was made.
    pub battery: Vec<BatteryReport>,
    /// The greatest tilts that the craft can hold.
    pub steady_tilts: Vec<SteadyTilt>,
    /// What was approximated or left out.
    pub notes: Vec<String>,
}
