//! Everything about a model and its gains in one report: `quadlab design check`.
//!
//! Margins also over what is not known for sure: the coefficients of the model (drawn as normal variables with the covariance
//! in the model file, or with their standard errors alone where it holds no correlations) and the battery voltage (the law's
//! motor map against the model's).

use control::Config;
use control::gains::Law;
use model::{Model, Plant};
use nalgebra::{Complex, DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde::Serialize;

use crate::envelope::{SteadyTilt, steady_tilts};
use crate::error::Result;
use crate::linear::{CANCEL_TOLERANCE, Linear};
use crate::loops::{
    ClosedLoop, LOOPS, LoopName, LoopPlant, View, axis_channel, inner_gains, law_effect, loops_of,
    outer_gains, together, with_moved_zero,
};
use crate::margins::{Band, LoopMargins, Margins};
use crate::response::{self, Mode, Response, StepMetrics, least_damped, step_metrics, value_at};
use crate::trim::TrimTarget;

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
type Pair = [f64; 2];

/// One loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
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

/// Margins at the actuator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ActuatorMargins {
    /// Degrees.
    pub phase_margin_deg: Option<f64>,
    /// Factor upwards.
    pub gain_margin: Option<f64>,
    /// Factor downwards.
    pub gain_reduction_margin: Option<f64>,
    /// rad/s.
    pub crossover_rad_s: Option<f64>,
    /// Greatest sensitivity.
    pub sensitivity_peak: f64,
}

/// All loops closed at once, with what one axis does to another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Together {
    /// Whether they are stable.
    pub stable: bool,
    /// How fast the slowest mode decays, 1/s; below 0: it grows.
    pub slowest_1_s: f64,
    /// Oscillating mode with the least damping.
    pub least_damped: Option<Mode>,
}

/// A step response: through prefilter or rate limit (1 m), and of the bare loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DisturbanceReport {
    /// The loop.
    pub name: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// Value of greatest magnitude.
    pub peak: f64,
    /// When, s.
    pub peak_s: f64,
    /// After [`LONG_S`].
    pub last: f64,
    /// After the same time without integral part.
    pub last_without_integral: f64,
}

/// Margins with a zero of the plant moved under an unchanged canceller (appendix A).
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Uncertainty {
    /// Draws.
    pub samples: usize,
    /// Seed.
    pub seed: u64,
    /// Coefficients with a standard error.
    pub coefficients: usize,
    /// Whether the model says how their errors hang together; otherwise they are drawn as independent.
    pub correlated: bool,
    /// Draws that could not hover or whose loops could not be built.
    pub failed: usize,
    /// Loops.
    pub loops: Vec<LoopSpread>,
}

/// Margins at one battery voltage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BatteryReport {
    /// V.
    pub battery_v: f64,
    /// Greatest thrust over weight.
    pub thrust_to_weight: f64,
    /// Loops.
    pub loops: Vec<BatteryLoop>,
}

/// A loop at one battery voltage.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckReport {
    /// The vehicle's name.
    pub vehicle: String,
    /// `continuous` or `sampled`.
    pub view: &'static str,
    /// Age of the pose, samples; absent in the continuous view.
    pub delay_samples: Option<usize>,
    /// Whether every loop is stable, at every voltage too, and all of them together.
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
    /// How far the craft can lean for ever.
    pub steady_tilts: Vec<SteadyTilt>,
    /// What was approximated or left out.
    pub notes: Vec<String>,
}

/// Loops of a configuration around a model, built once.
#[derive(Debug, Clone)]
pub struct Study {
    /// The linear model.
    pub linear: Linear,
    /// Plant and loop of each of [`LOOPS`].
    pub loops: Vec<(LoopPlant, ClosedLoop)>,
}

impl Study {
    /// Linearises `model` at hover and closes the loops of `config`.
    pub fn new(model: &Model, config: &Config, view: View) -> Result<Self> {
        let linear = Linear::new(model, &TrimTarget::default())?;
        Self::around(model, linear, config, view)
    }

    fn around(model: &Model, linear: Linear, config: &Config, view: View) -> Result<Self> {
        let effect = law_effect(model, &linear, config, linear.equilibrium.battery_v)?;
        let close = |name: &LoopName| {
            let plant = LoopPlant::new(&linear, &effect, *name, CANCEL_TOLERANCE)?;
            let closed = ClosedLoop::new(config, &plant, *name, view)?;
            Ok((plant, closed))
        };
        let loops = LOOPS.iter().map(close).collect::<Result<_>>()?;
        Ok(Self { linear, loops })
    }

    /// All loops of `config` closed at once.
    pub fn together(&self, model: &Model, config: &Config, view: View) -> Result<Together> {
        let effect = law_effect(model, &self.linear, config, self.linear.equilibrium.battery_v)?;
        let closed = together(config, &self.linear, &effect, view)?;
        let poles = closed.poles()?;
        let worst = poles.first().copied().unwrap_or_default();
        let slowest_1_s = match closed.period_s {
            Some(period_s) => -worst.norm().ln() / period_s,
            None => -worst.re,
        };
        Ok(Together {
            stable: closed.is_stable()?,
            slowest_1_s,
            least_damped: least_damped(&poles, closed.period_s.unwrap_or(0.0)),
        })
    }

    /// Margins of each loop.
    pub fn margins(&self) -> Result<Vec<(LoopName, LoopMargins)>> {
        self.loops.iter().map(|(_, closed)| Ok((closed.name, LoopMargins::of(closed)?))).collect()
    }
}

/// How long responses are followed, s: three time constants of the thesis' slowest closed-loop pole (0.057 rad/s).
pub const LONG_S: f64 = 60.0;
/// Times of the samples in the report, s.
const TIMES_S: [f64; 10] = [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0];
/// Zeros of Table A.1, rad/s; the canceller's own comes first.
const MOVED_ZEROS: [f64; 15] =
    [0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
/// Voltages of a lithium-polymer cell over its nominal 3.7 V: empty to full.
const VOLTAGES: [f64; 5] = [0.89, 0.95, 1.0, 1.07, 1.135];

/// Checks gains on a model.
pub fn check(model: &Model, config: &Config, options: &CheckOptions) -> Result<CheckReport> {
    let study = Study::new(model, config, options.view)?;
    let margins = study.margins()?;
    let mut notes = notes(model, config, &study, options.view);
    let (mut steps, mut disturbances) = (Vec::new(), Vec::new());
    for ((plant, closed), (name, margins)) in study.loops.iter().zip(&margins) {
        if !margins.stable {
            notes.push(format!("{name}: the closed loop is unstable, so it has no step response"));
            continue;
        }
        steps.push(step_report(config, closed)?);
        disturbances.push(disturbance_report(config, plant, closed, options.view)?);
    }
    let battery = battery_reports(model, config, options.view)?;
    let loops = study
        .loops
        .iter()
        .zip(&margins)
        .map(|((_, closed), (_, margins))| loop_report(closed, margins))
        .collect::<Result<Vec<_>>>()?;
    let together = study.together(model, config, options.view)?;
    let holds = together.stable
        && loops.iter().all(|l| l.stable)
        && battery.iter().all(|b| b.loops.iter().all(|l| l.stable));
    Ok(CheckReport {
        vehicle: model.vehicle.name.clone(),
        view: match options.view {
            View::Continuous => "continuous",
            View::Sampled { .. } => "sampled",
        },
        delay_samples: match options.view {
            View::Continuous => None,
            View::Sampled { delay_samples } => Some(delay_samples),
        },
        holds,
        together,
        loops,
        steps,
        disturbances,
        moved_zero: moved_zeros(config, &study, options.view)?,
        uncertainty: uncertainty(model, config, options)?,
        battery,
        steady_tilts: steady_tilts(model)?,
        notes,
    })
}

fn notes(model: &Model, config: &Config, study: &Study, view: View) -> Vec<String> {
    let mut notes = Vec::new();
    if study.linear.motor_lag_rad_s.is_none() {
        notes.push(
            "the model has no motor lag: loops are computed without one, so margins come out too large"
                .into(),
        );
    }
    if study.linear.input_delay_s > 0.0 && view == View::Continuous {
        notes.push(format!(
            "the model's dead time of {:.4} s is left out of the continuous view",
            study.linear.input_delay_s
        ));
    }
    if view == View::Continuous {
        notes.push(
            "continuous as in the thesis: roll and pitch with the velocity estimator, a pure derivative in its place in the yaw and altitude loops and around the position loops"
                .into(),
        );
    }
    for (plant, _) in &study.loops {
        for note in &plant.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
    }
    if !has_errors(model) {
        notes.push(
            "the model has no standard errors, so there is no spread of margins over its uncertainty".into(),
        );
    }
    if let Law::HandTuned(_) = config.law {
        notes.push("hand-tuned law: the loops' outputs are motor commands, (4.5)".into());
    }
    notes
}

fn pairs(values: &[Complex<f64>]) -> Vec<Pair> {
    values.iter().map(|z| [z.re, z.im]).collect()
}

fn loop_report(closed: &ClosedLoop, margins: &LoopMargins) -> Result<LoopReport> {
    let poles = closed.closed.poles()?;
    let (error, actuator) = (&margins.at_error, &margins.at_actuator);
    Ok(LoopReport {
        name: closed.name.name(),
        stable: margins.stable,
        phase_margin_deg: error.phase_margin_deg,
        gain_margin: error.gain_margin,
        gain_reduction_margin: error.gain_reduction_margin,
        crossover_rad_s: error.crossover_rad_s,
        phase_crossover_rad_s: error.phase_crossover_rad_s,
        delay_margin_s: margins.delay_margin_s,
        sensitivity_peak: error.sensitivity_peak,
        sensitivity_peak_rad_s: error.sensitivity_peak_rad_s,
        at_actuator: ActuatorMargins {
            phase_margin_deg: actuator.phase_margin_deg,
            gain_margin: actuator.gain_margin,
            gain_reduction_margin: actuator.gain_reduction_margin,
            crossover_rad_s: actuator.crossover_rad_s,
            sensitivity_peak: actuator.sensitivity_peak,
        },
        least_damped: least_damped(&poles, closed.closed.period_s.unwrap_or(0.0)),
        poles: pairs(&poles),
    })
}

/// The response to a commanded step as the law takes it: prefilter, or rate limit and 1 m.
pub fn commanded(config: &Config, closed: &ClosedLoop) -> Result<Response> {
    let limit = outer_gains(loops_of(config), closed.name).map(|outer| outer.rate_limit_m_s);
    response::commanded_step(closed, limit, LONG_S)
}

fn step_report(config: &Config, closed: &ClosedLoop) -> Result<StepReport> {
    let step = commanded(config, closed)?;
    let bare = response::bare_step(closed, LONG_S)?;
    let sample = |at: &f64| value_at(&step.values, step.period_s, *at).map(|y| [*at, y]);
    Ok(StepReport {
        name: closed.name.name(),
        commanded: step_metrics(&step.values, step.period_s),
        samples: TIMES_S.iter().filter_map(sample).collect(),
        without_prefilter: step_metrics(&bare.values, bare.period_s),
    })
}

fn disturbance_report(
    config: &Config,
    plant: &LoopPlant,
    closed: &ClosedLoop,
    view: View,
) -> Result<DisturbanceReport> {
    let name = closed.name;
    let response = response::disturbance_step(closed, LONG_S)?;
    let mut without = *config;
    *crate::curves::gain_mut(&mut without, name, crate::curves::Gain::Integral) = 0.0;
    let without = ClosedLoop::new(&without, plant, name, view)?;
    let without = response::disturbance_step(&without, LONG_S)?;
    let last = |response: &Response| response.values.last().copied().unwrap_or(0.0);
    let (at, peak) = response
        .values
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .map_or((0, 0.0), |(k, y)| (k, *y));
    Ok(DisturbanceReport {
        name: name.name(),
        unit: match name {
            LoopName::Z => "m/N",
            LoopName::X | LoopName::Y => "m/(rad/s^2)",
            _ => "rad/(rad/s^2)",
        },
        peak,
        peak_s: at as f64 * response.period_s,
        last: last(&response),
        last_without_integral: last(&without),
    })
}

fn moved_zeros(config: &Config, study: &Study, view: View) -> Result<Vec<MovedZero>> {
    let mut rows = Vec::new();
    for name in [LoopName::Roll, LoopName::Pitch] {
        let Some(canceller) = inner_gains(loops_of(config), name).canceller else { continue };
        let channel = axis_channel(&study.linear, name)?;
        if channel.zeros.len() != 1 {
            continue;
        }
        for zero_rad_s in std::iter::once(canceller.pole_rad_s).chain(MOVED_ZEROS) {
            let mut plant = with_moved_zero(&channel, zero_rad_s, study.linear.motor_lag_rad_s)?;
            plant.input_delay_s = study.linear.input_delay_s;
            let closed = ClosedLoop::new(config, &plant, name, view)?;
            let stable = closed.closed.is_stable()?;
            let margins = Margins::of(|w| closed.gain_at_error(w), Band::of(closed.closed.period_s), stable);
            rows.push(MovedZero {
                name: name.name(),
                zero_rad_s,
                phase_margin_deg: margins.phase_margin_deg,
                crossover_rad_s: margins.crossover_rad_s,
            });
        }
    }
    Ok(rows)
}

fn battery_reports(model: &Model, config: &Config, view: View) -> Result<Vec<BatteryReport>> {
    let nominal_v = model.reference.battery_v;
    if !(nominal_v > 0.0) {
        return Ok(Vec::new());
    }
    let at = |share: &f64| {
        let battery_v = share * nominal_v;
        let target = TrimTarget { battery_v: Some(battery_v), ..TrimTarget::default() };
        let linear = Linear::new(model, &target)?;
        let greatest = model.vehicle.motors.command_range[1];
        let speed = Plant::new(model).commanded_rad_s(&[greatest; 4], battery_v);
        let thrust: f64 = (0..4).map(|j| linear.effectiveness[(0, j)] * speed[j] * speed[j]).sum();
        let thrust_to_weight = thrust / linear.equilibrium.inputs[0];
        let study = Study::around(model, linear, config, view)?;
        let row = |(name, margins): (LoopName, LoopMargins)| BatteryLoop {
            name: name.name(),
            stable: margins.stable,
            phase_margin_deg: margins.at_error.phase_margin_deg,
            gain_margin: margins.at_error.gain_margin,
            delay_margin_s: margins.delay_margin_s,
        };
        Ok(BatteryReport {
            battery_v,
            thrust_to_weight,
            loops: study.margins()?.into_iter().map(row).collect(),
        })
    };
    VOLTAGES.iter().map(at).collect()
}

fn has_errors(model: &Model) -> bool {
    model.terms.iter().flat_map(|t| &t.coefficients).any(|c| c.std_error.is_some_and(|e| e > 0.0))
}

/// A matrix that makes errors of all coefficients of independent normal variables of deviation 1.
fn error_factor(model: &Model) -> DMatrix<f64> {
    let covariance = model.covariance();
    let errors = covariance.diagonal().map(f64::sqrt);
    // Coefficients differ by many powers of ten: correlations are what can be taken apart.
    let correlation = DMatrix::from_fn(covariance.nrows(), covariance.nrows(), |i, j| {
        let scale = errors[i] * errors[j];
        if i == j {
            1.0
        } else if scale > 0.0 {
            covariance[(i, j)] / scale
        } else {
            0.0
        }
    });
    if model.correlation.is_none() {
        return DMatrix::from_diagonal(&errors);
    }
    // A root of the matrix by its eigenvectors: it is there even where two coefficients are known only together.
    let parts = correlation.symmetric_eigen();
    let roots = DMatrix::from_diagonal(&parts.eigenvalues.map(|value| value.max(0.0).sqrt()));
    DMatrix::from_diagonal(&errors) * parts.eigenvectors * roots
}

/// The model with its coefficients drawn from their errors.
fn drawn(model: &Model, factor: &DMatrix<f64>, random: &mut Pcg64) -> Model {
    let mut model = model.clone();
    let normal = DVector::from_fn(factor.ncols(), |_, _| StandardNormal.sample(random));
    let errors = factor * normal;
    for (coefficient, error) in model.terms.iter_mut().flat_map(|t| &mut t.coefficients).zip(errors.iter()) {
        coefficient.value += error;
    }
    model
}

fn uncertainty(model: &Model, config: &Config, options: &CheckOptions) -> Result<Option<Uncertainty>> {
    if !has_errors(model) || options.samples == 0 {
        return Ok(None);
    }
    let mut random = Pcg64::seed_from_u64(options.seed);
    let factor = error_factor(model);
    let mut draws: Vec<Vec<LoopMargins>> = Vec::new();
    for _ in 0..options.samples {
        let model = drawn(model, &factor, &mut random);
        let margins = Study::new(&model, config, options.view).and_then(|study| study.margins());
        if let Ok(margins) = margins {
            draws.push(margins.into_iter().map(|(_, margins)| margins).collect());
        }
    }
    let loops = LOOPS.iter().enumerate().map(|(k, name)| {
        let of = |value: &dyn Fn(&LoopMargins) -> Option<f64>| {
            spread(draws.iter().filter_map(|margins| value(&margins[k])).collect())
        };
        LoopSpread {
            name: name.name(),
            unstable: draws.iter().filter(|margins| !margins[k].stable).count(),
            phase_margin_deg: of(&|m| m.at_error.phase_margin_deg),
            gain_margin: of(&|m| m.at_error.gain_margin),
            delay_margin_s: of(&|m| m.delay_margin_s),
        }
    });
    Ok(Some(Uncertainty {
        samples: options.samples,
        seed: options.seed,
        coefficients: model
            .terms
            .iter()
            .flat_map(|t| &t.coefficients)
            .filter(|c| c.std_error.is_some_and(|e| e > 0.0))
            .count(),
        correlated: model.correlation.is_some(),
        failed: options.samples - draws.len(),
        loops: loops.collect(),
    }))
}

fn spread(mut values: Vec<f64>) -> Option<Spread> {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
    (!values.is_empty()).then(|| Spread { min: at(0.0), p05: at(0.05), median: at(0.5), p95: at(0.95) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20,000 draws of three coefficients, two of them known only together: their means and covariances come back. The
    /// deviation of a mean is the coefficient's over 141, that of a covariance about its square over 100; four of each.
    #[test]
    fn draws_have_the_covariance_of_the_model() {
        let mut model = Model::thesis();
        let given = DMatrix::from_row_slice(3, 3, &[4e-8, 1e-4, 0.0, 1e-4, 0.25, 0.03, 0.0, 0.03, 0.09]);
        model.set_covariance(&[0, 3, 4], &given);
        let factor = error_factor(&model);
        let mut random = Pcg64::seed_from_u64(7);
        let count = 20_000;
        let values = |model: &Model| -> Vec<f64> {
            let all: Vec<f64> = model.terms.iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect();
            [0, 3, 4].map(|k| all[k]).to_vec()
        };
        let mean = values(&model);
        let (mut sum, mut squares) = (DVector::zeros(3), DMatrix::zeros(3, 3));
        for _ in 0..count {
            let draw = values(&drawn(&model, &factor, &mut random));
            let off = DVector::from_fn(3, |k, _| draw[k] - mean[k]);
            squares += &off * off.transpose();
            sum += off;
        }
        for i in 0..3 {
            assert!((sum[i] / f64::from(count)).abs() < 4.0 * given[(i, i)].sqrt() / 141.0, "{sum}");
            for j in 0..3 {
                let scale = (given[(i, i)] * given[(j, j)]).sqrt();
                assert!((squares[(i, j)] / f64::from(count) - given[(i, j)]).abs() < 0.04 * scale, "{i} {j}");
            }
        }
    }
}
