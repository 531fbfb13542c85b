//! Gains from a model and specifications: `quadlab design`.
//!
//! Two methods share one set of steps, inner loops before outer ones:
//!
//! - [`Method::Thesis`]: chapter 5 step by step, on the continuous loops. Where the thesis reads a root locus by eye, a rule
//!   stands here (each is told in its step), so the gains come out near Tables 5.1 to 5.3 and not equal to them.
//! - [`Method::Delay`] (default): starts from those gains and searches, on the loops as they fly (100 Hz, matched-Z filters, a
//!   late pose), for gains that keep the margins, stay stable with a pose later still, and answer fast without a dip. The
//!   search is the simplex of Nelder and Mead (crate argmin) on the logarithms of the gains: deterministic, no derivative.
//!
//! Deliberately absent: the nonlinear flight (crate `sil`), which is to be flown with the result.

use argmin::core::{CostFunction, Executor, State as _};
use argmin::solver::neldermead::NelderMead;
use control::Config;
use control::filter::GainRule;
use control::gains::{
    CancellerParams, InnerLoop, Law, Mixing, MotorMapParams, PositionLoop, Saturation, VelocityEstimator,
};
use model::Model;
use serde::{Deserialize, Serialize};

use crate::check::{Study, commanded};
use crate::curves::{Gain, gain_mut, gain_of};
use crate::error::{DesignError, Result};
use crate::linear::{CANCEL_TOLERANCE, Linear};
use crate::loops::{
    ClosedLoop, LoopName, LoopPlant, View, inner_gains, inner_gains_mut, law_effect, loops_of, loops_of_mut,
};
use crate::margins::{Band, Margins};
use crate::response::{commanded_step, least_damped, step_metrics};
use crate::trim::TrimTarget;

/// How gains are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The thesis' procedure on continuous loops.
    Thesis,
    /// A search on the loops as they fly.
    Delay,
}

/// What is asked of the gains; the defaults are the thesis' specifications and, for the late pose, twice its gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Specs {
    /// How gains are found.
    pub method: Method,
    /// Age of the pose at which the margins are to hold, samples (thesis 5.5: about 2).
    pub delay_samples: usize,
    /// Age of the pose with which every loop is to be stable, samples.
    pub stable_delay_samples: usize,
    /// Roll and pitch.
    pub attitude: AttitudeSpecs,
    /// Yaw.
    pub yaw: SlowSpecs,
    /// Altitude.
    pub altitude: SlowSpecs,
    /// Position along x and y.
    pub position: PositionSpecs,
}

/// Specifications of roll and pitch, thesis 5.3.1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AttitudeSpecs {
    /// Least phase margin, degrees (thesis: 45).
    pub phase_margin_deg: f64,
    /// Least gain margin.
    pub gain_margin: f64,
    /// Greatest gain crossover frequency, rad/s (thesis: 6).
    pub crossover_rad_s: f64,
    /// Greatest overshoot by the damping of the closed-loop poles, per cent (thesis: 35).
    pub damping_overshoot_percent: f64,
    /// Velocity gain over the least one that stabilises (the thesis' 10 is 1.18 times).
    pub velocity_gain_ratio: f64,
    /// Where the canceller moves the slow zero, rad/s (thesis: 0.6).
    pub zero_rad_s: f64,
    /// Corner of the prefilter, rad/s (thesis: 5); the search starts from it.
    pub prefilter_rad_s: f64,
    /// Least value of a commanded step's response after its first peak (the thesis' gains: 0.62). Less dip costs margin: the
    /// plant's slow zero has to be moved further, or the integral raised.
    pub least_after_peak: f64,
    /// Greatest rise time of a commanded step, s (the thesis' gains: 0.38 roll, 0.33 pitch; 0.30 and 0.27 as they fly).
    pub rise_s: f64,
    /// Greatest overshoot of a commanded step, per cent.
    pub overshoot_percent: f64,
}

/// Specifications of yaw or altitude, thesis 5.3.2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlowSpecs {
    /// Greatest overshoot, per cent (thesis: 5).
    pub overshoot_percent: f64,
    /// Greatest rise time, s (thesis: 1 yaw, 1.5 altitude).
    pub rise_s: f64,
    /// Corner of the prefilter, rad/s (thesis: 4 yaw, 2 altitude).
    pub prefilter_rad_s: f64,
    /// Ki over Kp: how fast a constant disturbance is taken away, rad/s (thesis: 1/15 yaw, 1/18 altitude).
    pub integral_rad_s: f64,
}

/// Specifications of the position loops, thesis 5.4.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PositionSpecs {
    /// Least phase margin, degrees (thesis: 45).
    pub phase_margin_deg: f64,
    /// Least gain margin, for the late pose.
    pub gain_margin: f64,
    /// Gain crossover frequency, rad/s (thesis: about 1, found 1.17 and 1.12).
    pub crossover_rad_s: f64,
    /// Ki over Kp, rad/s (thesis: 1/15).
    pub integral_rad_s: f64,
    /// Fastest motion of the reference, m/s (thesis: 0.5).
    pub rate_limit_m_s: f64,
    /// Corner of the velocity filter, rad/s (thesis: 10).
    pub velocity_filter_rad_s: f64,
    /// Greatest overshoot of 1 m through the rate limit, per cent (thesis: 15 and 17).
    pub overshoot_percent: f64,
}

impl Default for Specs {
    fn default() -> Self {
        Self {
            method: Method::Delay,
            delay_samples: 2,
            stable_delay_samples: 4,
            attitude: AttitudeSpecs::default(),
            yaw: SlowSpecs {
                overshoot_percent: 5.0,
                rise_s: 1.0,
                prefilter_rad_s: 4.0,
                integral_rad_s: 1.0 / 15.0,
            },
            altitude: SlowSpecs {
                overshoot_percent: 5.0,
                rise_s: 1.5,
                prefilter_rad_s: 2.0,
                integral_rad_s: 1.0 / 18.0,
            },
            position: PositionSpecs::default(),
        }
    }
}

impl Default for AttitudeSpecs {
    fn default() -> Self {
        Self {
            phase_margin_deg: 45.0,
            gain_margin: 2.0,
            crossover_rad_s: 6.0,
            damping_overshoot_percent: 35.0,
            velocity_gain_ratio: 1.2,
            zero_rad_s: 0.6,
            prefilter_rad_s: 5.0,
            least_after_peak: 0.7,
            rise_s: 0.3,
            overshoot_percent: 2.0,
        }
    }
}

impl Default for PositionSpecs {
    fn default() -> Self {
        Self {
            phase_margin_deg: 45.0,
            gain_margin: 2.0,
            crossover_rad_s: 1.2,
            integral_rad_s: 1.0 / 15.0,
            rate_limit_m_s: 0.5,
            velocity_filter_rad_s: 10.0,
            overshoot_percent: 17.0,
        }
    }
}

impl Specs {
    /// The thesis' procedure and specifications.
    pub fn thesis() -> Self {
        Self { method: Method::Thesis, ..Self::default() }
    }

    /// Parses and checks the text of a specifications file; `path` is for messages.
    pub fn parse(text: &str, path: &std::path::Path) -> Result<Self> {
        let refuse = |message: String| DesignError::Parse { path: path.to_owned(), message };
        let specs: Self = toml::from_str(text).map_err(|e| refuse(gains_file::toml_message(text, &e)))?;
        let (a, p) = (&specs.attitude, &specs.position);
        let ranges = [
            ("attitude.phase_margin_deg", a.phase_margin_deg, 0.0, 90.0),
            ("attitude.gain_margin", a.gain_margin, 1.0, 100.0),
            ("attitude.crossover_rad_s", a.crossover_rad_s, 0.01, 1000.0),
            ("attitude.damping_overshoot_percent", a.damping_overshoot_percent, 0.1, 99.0),
            ("attitude.velocity_gain_ratio", a.velocity_gain_ratio, 1.0, 100.0),
            ("attitude.zero_rad_s", a.zero_rad_s, 1e-3, 100.0),
            ("attitude.prefilter_rad_s", a.prefilter_rad_s, 1e-2, 300.0),
            ("attitude.least_after_peak", a.least_after_peak, 0.0, 1.0),
            ("attitude.rise_s", a.rise_s, 1e-3, 100.0),
            ("attitude.overshoot_percent", a.overshoot_percent, 0.0, 100.0),
            ("yaw.overshoot_percent", specs.yaw.overshoot_percent, 0.1, 99.0),
            ("yaw.rise_s", specs.yaw.rise_s, 1e-3, 100.0),
            ("yaw.prefilter_rad_s", specs.yaw.prefilter_rad_s, 1e-2, 300.0),
            ("yaw.integral_rad_s", specs.yaw.integral_rad_s, 0.0, 100.0),
            ("altitude.overshoot_percent", specs.altitude.overshoot_percent, 0.1, 99.0),
            ("altitude.rise_s", specs.altitude.rise_s, 1e-3, 100.0),
            ("altitude.prefilter_rad_s", specs.altitude.prefilter_rad_s, 1e-2, 300.0),
            ("altitude.integral_rad_s", specs.altitude.integral_rad_s, 0.0, 100.0),
            ("position.phase_margin_deg", p.phase_margin_deg, 0.0, 90.0),
            ("position.gain_margin", p.gain_margin, 1.0, 100.0),
            ("position.crossover_rad_s", p.crossover_rad_s, 0.01, 100.0),
            ("position.integral_rad_s", p.integral_rad_s, 0.0, 100.0),
            ("position.rate_limit_m_s", p.rate_limit_m_s, 1e-3, 100.0),
            ("position.velocity_filter_rad_s", p.velocity_filter_rad_s, 1e-2, 300.0),
            ("position.overshoot_percent", p.overshoot_percent, 0.0, 100.0),
        ];
        for (name, value, least, most) in ranges {
            if !(value >= least && value <= most) {
                return Err(refuse(format!("{name} is {value}: give a number from {least} to {most}")));
            }
        }
        if specs.delay_samples > 100 || specs.stable_delay_samples > 100 {
            return Err(refuse("delay_samples, stable_delay_samples: give at most 100".into()));
        }
        Ok(specs)
    }
}

/// A gain that a step found, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// The loop.
    #[serde(rename = "loop")]
    pub name: &'static str,
    /// The gain's symbol.
    pub gain: &'static str,
    /// Its value.
    pub value: f64,
    /// The rule, in words.
    pub rule: String,
}

/// A specification that is not met.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shortfall {
    /// The loop.
    #[serde(rename = "loop")]
    pub name: &'static str,
    /// Which number.
    pub what: &'static str,
    /// What was asked for.
    pub wanted: f64,
    /// What was reached.
    pub reached: f64,
}

/// Gains and how they came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Designed {
    /// What flies.
    pub config: Config,
    /// The steps in order.
    pub steps: Vec<Step>,
    /// Specifications that are not met; empty: all are.
    pub shortfalls: Vec<Shortfall>,
}

/// A design in the making.
struct Work<'a> {
    model: &'a Model,
    linear: Linear,
    specs: Specs,
    config: Config,
    steps: Vec<Step>,
}

/// Designs gains for a model.
///
/// # Errors
/// A model that cannot be linearised at hover or controlled, or that no motor map can be made for.
pub fn design(model: &Model, specs: &Specs) -> Result<Designed> {
    let linear = Linear::new(model, &TrimTarget::default())?;
    let config = blank(model, &linear, specs)?;
    let mut work = Work { model, linear, specs: *specs, config, steps: Vec::new() };
    for name in [LoopName::Roll, LoopName::Pitch] {
        work.attitude(name)?;
    }
    for name in [LoopName::Yaw, LoopName::Z] {
        work.slow(name)?;
    }
    if specs.method == Method::Delay {
        work.search_attitude()?;
    }
    for name in [LoopName::X, LoopName::Y] {
        work.position(name)?;
    }
    let shortfalls = shortfalls(model, &work.config, specs)?;
    Ok(Designed { config: work.config, steps: work.steps, shortfalls })
}

/// A configuration for the model's craft without gains: its mixing, motor map and hover.
fn blank(model: &Model, linear: &Linear, specs: &Specs) -> Result<Config> {
    let mut config = Config::thesis();
    let vehicle = &model.vehicle;
    config.command_range = vehicle.motors.command_range;
    if specs.method == Method::Delay {
        // A rate that is measured 6.5 % too large is gain that the margins do not have.
        config.estimation.gain_rule = GainRule::Slope;
        // What the linear loops do not see: motors at their ends, and a thrust that leans.
        config.saturation = Saturation::AttitudeFirst;
        config.tilt_compensation = true;
    }
    let map = vehicle.rotor_map();
    let k = &linear.effectiveness;
    let Law::ModelBased(law) = &mut config.law else {
        return Err(DesignError::Numerics("the thesis' configuration"));
    };
    law.hover_thrust_n = linear.equilibrium.inputs[0];
    law.mixing = Mixing::Matrix(std::array::from_fn(|i| std::array::from_fn(|j| k[(i, j)])));
    law.motor_map =
        MotorMapParams { command: map.command, voltage: map.voltage, offset: map.offset, inverse: None };
    let still = |prefilter_rad_s: f64| InnerLoop {
        kp: 0.0,
        ki: 0.0,
        kd: 0.0,
        prefilter_rad_s: Some(prefilter_rad_s),
        canceller: None,
        output_limit: None,
    };
    let position = PositionLoop {
        kp: 0.0,
        ki: 0.0,
        kd: 0.0,
        velocity_filter_rad_s: specs.position.velocity_filter_rad_s,
        rate_limit_m_s: specs.position.rate_limit_m_s,
        output_limit_rad: None,
    };
    law.loops.roll = still(specs.attitude.prefilter_rad_s);
    law.loops.pitch = law.loops.roll;
    law.loops.yaw = still(specs.yaw.prefilter_rad_s);
    law.loops.altitude = still(specs.altitude.prefilter_rad_s);
    (law.loops.x, law.loops.y) = (position, position);
    Ok(config)
}

/// The largest value in `(low, high)` up to which a condition holds from `low` on, to a thousandth.
fn largest(low: f64, high: f64, holds: impl Fn(f64) -> Result<bool>) -> Result<Option<f64>> {
    const GRID: usize = 60;
    let at = |k: usize| low * (high / low).powf(k as f64 / GRID as f64);
    let mut last = None;
    for k in 0..=GRID {
        if !holds(at(k))? {
            if last.is_some() {
                return refine(at(k - 1), at(k), holds).map(Some);
            }
        } else {
            last = Some(at(k));
        }
    }
    Ok(last)
}

/// Where on a grid from `low` to `high` a value is greatest, and that value; absent where it has none anywhere.
fn greatest(low: f64, high: f64, value: impl Fn(f64) -> Result<Option<f64>>) -> Result<Option<(f64, f64)>> {
    const GRID: usize = 60;
    let mut most: Option<(f64, f64)> = None;
    for k in 0..=GRID {
        let at = low * (high / low).powf(k as f64 / GRID as f64);
        if let Some(value) = value(at)?
            && most.is_none_or(|(_, most)| value > most)
        {
            most = Some((at, value));
        }
    }
    Ok(most)
}

fn refine(mut good: f64, mut bad: f64, holds: impl Fn(f64) -> Result<bool>) -> Result<f64> {
    while (bad - good).abs() > 1e-3 * good.abs() {
        let middle = 0.5 * (good + bad);
        if holds(middle)? { good = middle } else { bad = middle }
    }
    Ok(good)
}

impl Work<'_> {
    fn plant(&self, name: LoopName) -> Result<LoopPlant> {
        let effect = law_effect(self.model, &self.linear, &self.config, self.linear.equilibrium.battery_v)?;
        LoopPlant::new(&self.linear, &effect, name, CANCEL_TOLERANCE)
    }

    fn found(&mut self, name: LoopName, gain: Gain, value: f64, rule: impl Into<String>) {
        *gain_mut(&mut self.config, name, gain) = value;
        self.steps.push(Step { name: name.name(), gain: gain.symbol(), value, rule: rule.into() });
    }

    fn with(&self, name: LoopName, gain: Gain, value: f64) -> Config {
        let mut config = self.config;
        *gain_mut(&mut config, name, gain) = value;
        config
    }

    /// Thesis 5.3.1.
    fn attitude(&mut self, name: LoopName) -> Result<()> {
        let plant = self.plant(name)?;
        let specs = self.specs.attitude;
        let close = |config: &Config| ClosedLoop::new(config, &plant, name, View::Continuous);
        let unstable = |what: &str| DesignError::Channel {
            channel: name.name(),
            reason: format!("no {what} makes it stable"),
        };
        // Velocity gain: from the root locus of (5.25). A pole at the origin is the proportional gain's to move.
        let slowest = |kd: f64| -> Result<f64> {
            let poles = close(&self.with(name, Gain::Velocity, kd))?.velocity_loop.poles()?;
            Ok(poles.iter().filter(|p| p.norm() > 1e-6).map(|p| p.re).fold(f64::NEG_INFINITY, f64::max))
        };
        let holds = |kd: f64| Ok(slowest(kd)? < 0.0);
        let (kd, rule) = if holds(0.0)? {
            let rule = "the axis is stable by itself: moves the slowest pole of the velocity loop as far left as it goes";
            (best(0.05, 500.0, slowest)?, rule.to_owned())
        } else {
            let least = first(0.05, 500.0, holds)?.ok_or_else(|| unstable("velocity gain"))?;
            let ratio = specs.velocity_gain_ratio;
            let rule =
                format!("{ratio:.2} times {least:.3}, the least that stabilises the velocity loop (5.25)");
            (ratio * least, rule)
        };
        if !holds(kd)? {
            return Err(unstable("velocity gain"));
        }
        self.found(name, Gain::Velocity, kd, rule);
        self.canceller(name, specs.zero_rad_s)?;
        // Proportional gain: (5.27), as large as overshoot, margin and crossover allow, with a third of the phase kept for Ki.
        let allowed = |config: &Config, reserve_deg: f64| -> Result<bool> {
            let closed = close(config)?;
            if !closed.closed.is_stable()? {
                return Ok(false);
            }
            let margins = at_error(&closed);
            let overshoot =
                least_damped(&closed.closed.poles()?, 0.0).map_or(0.0, |m| damping_overshoot(m.damping));
            Ok(overshoot <= specs.damping_overshoot_percent
                && margins.phase_margin_deg.is_none_or(|pm| pm >= specs.phase_margin_deg + reserve_deg)
                && margins.crossover_rad_s.is_none_or(|w| w <= specs.crossover_rad_s))
        };
        let found = largest(1.0, 2000.0, |kp| {
            allowed(&self.with(name, Gain::Proportional, kp), INTEGRAL_RESERVE_DEG)
        })?;
        let kp = match found {
            Some(kp) => kp,
            None => {
                let phase = |kp: f64| -> Result<Option<f64>> {
                    let closed = close(&self.with(name, Gain::Proportional, kp))?;
                    if !closed.closed.is_stable()? {
                        return Ok(None);
                    }
                    let margins = at_error(&closed);
                    let slow = margins.crossover_rad_s.is_none_or(|w| w <= specs.crossover_rad_s);
                    let mode = least_damped(&closed.closed.poles()?, 0.0);
                    let overshoot = mode.map_or(0.0, |m| damping_overshoot(m.damping));
                    let damped = overshoot <= specs.damping_overshoot_percent;
                    Ok(margins.phase_margin_deg.filter(|_| slow && damped))
                };
                let (kp, reached) = greatest(1.0, 2000.0, phase)?
                    .ok_or_else(|| unstable("proportional gain within its crossover and overshoot"))?;
                // A search goes on from the best there is.
                if self.specs.method == Method::Thesis {
                    let wanted = specs.phase_margin_deg + INTEGRAL_RESERVE_DEG;
                    let what = "phase margin before the integral, deg";
                    return Err(DesignError::Unmet(Shortfall { name: name.name(), what, wanted, reached }));
                }
                kp
            }
        };
        self.found(
            name,
            Gain::Proportional,
            kp,
            format!(
                "largest with at most {} % overshoot by damping, {} rad/s and {INTEGRAL_RESERVE_DEG} degrees beyond the phase margin, kept for Ki (5.27)",
                specs.damping_overshoot_percent, specs.crossover_rad_s
            ),
        );
        let ki = largest(0.01 * kp, 10.0 * kp, |ki| allowed(&self.with(name, Gain::Integral, ki), 0.0))?
            .unwrap_or(0.0);
        self.found(
            name,
            Gain::Integral,
            ki,
            format!(
                "largest with {} degrees of phase margin and the same overshoot (5.28)",
                specs.phase_margin_deg
            ),
        );
        Ok(())
    }

    /// (5.26): the pole on the plant's slow zero, where there is one.
    fn canceller(&mut self, name: LoopName, zero_rad_s: f64) -> Result<()> {
        let channel = self.linear.channel(name.channel(), CANCEL_TOLERANCE)?;
        let slow = channel.zeros.iter().find(|z| z.im == 0.0 && z.re < 0.0 && -z.re < zero_rad_s);
        if let Some(slow) = slow {
            let pole_rad_s = -slow.re;
            inner_gains_mut(loops_of_mut(&mut self.config), name).canceller =
                Some(CancellerParams { zero_rad_s, pole_rad_s });
            self.steps.push(Step {
                name: name.name(),
                gain: "canceller pole",
                value: pole_rad_s,
                rule: format!("on the plant's slow zero, which moves to {zero_rad_s} rad/s (5.26)"),
            });
        }
        Ok(())
    }

    /// Thesis 5.3.2.
    fn slow(&mut self, name: LoopName) -> Result<()> {
        let plant = self.plant(name)?;
        let specs = if name == LoopName::Yaw { self.specs.yaw } else { self.specs.altitude };
        let close = |config: &Config| ClosedLoop::new(config, &plant, name, View::Continuous);
        let slowest = |kd: f64| -> Result<f64> {
            // The integrator of the channel itself stays at the origin whatever the velocity gain; it is the proportional
            // gain's to move.
            let poles = close(&self.with(name, Gain::Velocity, kd))?.velocity_loop.poles()?;
            Ok(poles.iter().map(|p| p.re).filter(|re| re.abs() > 1e-6).fold(f64::NEG_INFINITY, f64::max))
        };
        let kd = best(0.05, 500.0, slowest)?;
        self.found(
            name,
            Gain::Velocity,
            kd,
            "moves the slowest pole of the velocity loop, rotors' lag included, as far left as it goes (5.29)",
        );
        let overshoot = |kp: f64| -> Result<Option<f64>> {
            let closed = close(&self.with(name, Gain::Proportional, kp))?;
            if !closed.closed.is_stable()? {
                return Ok(None);
            }
            let mode = least_damped(&closed.closed.poles()?, 0.0);
            Ok(Some(mode.map_or(0.0, |m| damping_overshoot(m.damping))))
        };
        let allowed = |kp: f64| Ok(overshoot(kp)?.is_some_and(|percent| percent <= specs.overshoot_percent));
        let Some(kp) = largest(0.05, 1000.0, allowed)? else {
            let least = greatest(0.05, 1000.0, |kp| Ok(overshoot(kp)?.map(|percent| -percent)))?;
            return Err(least.map_or_else(
                || DesignError::Channel {
                    channel: name.name(),
                    reason: "no proportional gain makes it stable".into(),
                },
                |(_, percent)| {
                    DesignError::Unmet(Shortfall {
                        name: name.name(),
                        what: "overshoot by damping, %",
                        wanted: specs.overshoot_percent,
                        reached: -percent,
                    })
                },
            ));
        };
        self.found(
            name,
            Gain::Proportional,
            kp,
            format!("largest with {} % overshoot by damping (5.30)", specs.overshoot_percent),
        );
        self.found(
            name,
            Gain::Integral,
            specs.integral_rad_s * kp,
            format!("takes constant disturbances away at {:.3} rad/s (5.31)", specs.integral_rad_s),
        );
        Ok(())
    }

    /// Thesis 5.4: velocity and proportional gain for a phase margin at a crossover frequency.
    fn position(&mut self, name: LoopName) -> Result<()> {
        let plant = self.plant(name)?;
        let specs = self.specs.position;
        let view = match self.specs.method {
            Method::Thesis => View::Continuous,
            Method::Delay => View::Sampled { delay_samples: self.specs.delay_samples },
        };
        let ratio = specs.integral_rad_s;
        let with = |kp: f64, kd: f64| -> Config {
            let mut config = self.config;
            *gain_mut(&mut config, name, Gain::Velocity) = kd;
            *gain_mut(&mut config, name, Gain::Proportional) = kp;
            *gain_mut(&mut config, name, Gain::Integral) = ratio * kp;
            config
        };
        let tried = |kp: f64, kd: f64| -> Result<Option<Margins>> {
            let closed = ClosedLoop::new(&with(kp, kd), &plant, name, view)?;
            if !closed.closed.is_stable()? {
                return Ok(None);
            }
            Ok(Some(at_error(&closed)))
        };
        // Velocity gains from none to twice the proportional one; for each the largest proportional gain within the
        // crossover; of those the one with the widest margins.
        let mut chosen: Option<(f64, f64, f64)> = None;
        for k in 0..=20 {
            let share = 0.1 * f64::from(k);
            let within = |kp: f64| -> Result<bool> {
                Ok(tried(kp, share * kp)?.is_some_and(|m| {
                    m.crossover_rad_s.is_some_and(|w| w <= specs.crossover_rad_s)
                        && m.phase_margin_deg.is_none_or(|phase| phase >= specs.phase_margin_deg)
                        && (self.specs.method == Method::Thesis
                            || m.gain_margin.is_none_or(|g| g >= specs.gain_margin))
                }))
            };
            let Some(kp) = largest(0.01, 3.0, within)? else { continue };
            let Some(margins) = tried(kp, share * kp)? else { continue };
            let phase = margins.phase_margin_deg.unwrap_or(90.0);
            // A fast loop with just the margin asked for, or else the most margin. As it flies, first of all one that does not
            // come close to its overshoot.
            let excess = match view {
                View::Continuous => 0.0,
                View::Sampled { .. } => {
                    let closed = ClosedLoop::new(&with(kp, share * kp), &plant, name, view)?;
                    let step = commanded_step(&closed, Some(specs.rate_limit_m_s), POSITION_S)?;
                    let overshoot = step_metrics(&step.values, step.period_s).overshoot_percent;
                    (overshoot - OVERSHOOT_USED * specs.overshoot_percent).max(0.0)
                }
            };
            let worth = if phase >= specs.phase_margin_deg { 100.0 + kp - excess } else { phase };
            if chosen.is_none_or(|(best, ..)| worth > best) {
                chosen = Some((worth, kp, share * kp));
            }
        }
        let Some((_, kp, kd)) = chosen else {
            let phase = |kp: f64| -> Result<Option<f64>> {
                let mut most: Option<f64> = None;
                for k in 0..=10 {
                    let margins = tried(kp, 0.2 * f64::from(k) * kp)?;
                    let slow =
                        margins.filter(|m| m.crossover_rad_s.is_some_and(|w| w <= specs.crossover_rad_s));
                    let phase = slow.and_then(|m| m.phase_margin_deg);
                    most = phase.map_or(most, |phase| Some(most.map_or(phase, |most| most.max(phase))));
                }
                Ok(most)
            };
            return Err(match greatest(0.01, 3.0, phase)? {
                // Enough phase, so it is the gain margin that none of them has beside it.
                Some((_, reached)) if reached < specs.phase_margin_deg => DesignError::Unmet(Shortfall {
                    name: name.name(),
                    what: "phase margin, deg",
                    wanted: specs.phase_margin_deg,
                    reached,
                }),
                _ => DesignError::Channel {
                    channel: name.name(),
                    reason: format!(
                        "no gain crosses below {} rad/s with {} degrees of phase margin and a gain margin of {}",
                        specs.crossover_rad_s, specs.phase_margin_deg, specs.gain_margin
                    ),
                },
            });
        };
        let rule = format!(
            "largest Kp that crosses at most at {} rad/s with {} degrees, over velocity gains",
            specs.crossover_rad_s, specs.phase_margin_deg
        );
        self.found(name, Gain::Velocity, kd, rule.clone());
        self.found(name, Gain::Proportional, kp, rule);
        self.found(
            name,
            Gain::Integral,
            ratio * kp,
            format!("takes constant disturbances away at {ratio:.3} rad/s"),
        );
        Ok(())
    }

    /// Roll and pitch on the loops as they fly. The estimator is common to both: each of a few is tried, and the one with
    /// the lower cost of both axes together flies.
    fn search_attitude(&mut self) -> Result<()> {
        let start = self.config;
        let mut best: Option<(f64, Config)> = None;
        for estimator in ESTIMATORS {
            let mut config = start;
            config.estimation.velocity = estimator;
            let mut cost = 0.0;
            for name in [LoopName::Roll, LoopName::Pitch] {
                cost += self.search_axis(&mut config, name)?;
            }
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, config));
            }
        }
        let Some((cost, config)) = best else { return Ok(()) };
        self.config = config;
        let VelocityEstimator { natural_frequency_rad_s, damping_ratio } = config.estimation.velocity;
        self.steps.push(Step {
            name: "roll",
            gain: "estimator damping",
            value: damping_ratio,
            rule: format!(
                "of {} estimators the one with the least cost ({cost:.3}) over roll and pitch; natural frequency {natural_frequency_rad_s} rad/s",
                ESTIMATORS.len()
            ),
        });
        for name in [LoopName::Roll, LoopName::Pitch] {
            for gain in crate::curves::GAINS {
                let value = gain_of(&self.config, name, gain);
                let rule = format!(
                    "searched on the sampled loop with {} samples of delay, stable with {}",
                    self.specs.delay_samples, self.specs.stable_delay_samples
                );
                self.found(name, gain, value, rule);
            }
            let gains = *inner_gains(loops_of(&self.config), name);
            if let Some(corner) = gains.prefilter_rad_s {
                self.steps.push(Step {
                    name: name.name(),
                    gain: "prefilter",
                    value: corner,
                    rule: format!(
                        "searched with the gains: rise of at most {} s with at most {} % overshoot",
                        self.specs.attitude.rise_s, self.specs.attitude.overshoot_percent
                    ),
                });
            }
            if let Some(canceller) = gains.canceller {
                self.steps.push(Step {
                    name: name.name(),
                    gain: "canceller zero",
                    value: canceller.zero_rad_s,
                    rule: "searched with the gains: further out it lifts the dip and costs phase".into(),
                });
            }
        }
        Ok(())
    }

    /// Searches the gains of one axis in `config`; gives the cost reached.
    fn search_axis(&self, config: &mut Config, name: LoopName) -> Result<f64> {
        let plant = self.plant(name)?;
        let search = Search { plant: &plant, config: *config, name, specs: self.specs };
        let start = search.parameters();
        let mut best = (f64::INFINITY, start.clone());
        // From the thesis' gains, and again from the best: a simplex can collapse on the edge of what is allowed.
        for size in [0.4, 0.2, 0.1] {
            let from = best.1.clone();
            let mut simplex = vec![from.clone()];
            simplex.extend((0..from.len()).map(|k| {
                let mut corner = from.clone();
                corner[k] += size;
                corner
            }));
            let solver = NelderMead::new(simplex)
                .with_sd_tolerance(1e-5)
                .map_err(|e| DesignError::Optimiser(e.to_string()))?;
            let run =
                Executor::new(search.clone(), solver).configure(|state| state.max_iters(SEARCH_STEPS)).run();
            let result = run.map_err(|e| DesignError::Optimiser(e.to_string()))?;
            let cost = result.state().get_best_cost();
            if let Some(x) = result.state().get_best_param()
                && cost < best.0
            {
                best = (cost, x.clone());
            }
        }
        *config = search.with(&best.1);
        Ok(best.0)
    }
}

/// Phase that the integral part may take away, degrees.
const INTEGRAL_RESERVE_DEG: f64 = 8.0;
/// A prefilter beyond this is none: what it lets through is the noise of the position loops.
const FASTEST_PREFILTER_RAD_S: f64 = 20.0;
/// Steps of one run of the simplex.
const SEARCH_STEPS: u64 = 150;
/// Estimators that are tried; none is faster than the thesis', whose noise is known to fly.
const ESTIMATORS: [VelocityEstimator; 3] = [
    VelocityEstimator::CRITICAL_150,
    VelocityEstimator { natural_frequency_rad_s: 75.0, damping_ratio: 0.7 },
    VelocityEstimator::PRINTED_75,
];

/// The first value for which a condition holds, going up.
fn first(low: f64, high: f64, holds: impl Fn(f64) -> Result<bool>) -> Result<Option<f64>> {
    const GRID: usize = 200;
    let at = |k: usize| low * (high / low).powf(k as f64 / GRID as f64);
    for k in 0..=GRID {
        if holds(at(k))? {
            return if k == 0 { Ok(Some(low)) } else { refine(at(k), at(k - 1), holds).map(Some) };
        }
    }
    Ok(None)
}

/// The least gain at which a function is as small as it gets, to a per cent, on a fine grid: beyond the point where two
/// real poles meet, more gain only makes them ring.
fn best(low: f64, high: f64, value: impl Fn(f64) -> Result<f64>) -> Result<f64> {
    const GRID: usize = 400;
    let at = |k: usize| low * (high / low).powf(k as f64 / GRID as f64);
    let values = (0..=GRID).map(|k| value(at(k))).collect::<Result<Vec<f64>>>()?;
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let near = values.iter().position(|value| *value <= least + 0.01 * least.abs()).unwrap_or(0);
    Ok(at(near))
}

/// Overshoot of a second-order system of this damping ratio, per cent: what a root locus shows.
fn damping_overshoot(damping: f64) -> f64 {
    if damping <= 0.0 {
        return 100.0;
    }
    if damping >= 1.0 {
        return 0.0;
    }
    100.0 * (-std::f64::consts::PI * damping / (1.0 - damping * damping).sqrt()).exp()
}

/// Margins of a stable loop, fast.
fn at_error(closed: &ClosedLoop) -> Margins {
    Margins::of(|w| closed.gain_at_error(w), Band::coarse(closed.closed.period_s), true)
}

/// What the simplex searches: logarithms of Kd, Kp, Ki, of the prefilter's corner and, where there is a canceller, of its zero.
#[derive(Clone)]
struct Search<'a> {
    plant: &'a LoopPlant,
    config: Config,
    name: LoopName,
    specs: Specs,
}

impl Search<'_> {
    fn parameters(&self) -> Vec<f64> {
        let mut config = self.config;
        let gains = inner_gains_mut(loops_of_mut(&mut config), self.name);
        let mut parameters = vec![gains.kd.ln(), gains.kp.ln(), gains.ki.max(1e-3).ln()];
        parameters.extend(gains.prefilter_rad_s.map(f64::ln));
        parameters.extend(gains.canceller.map(|c| c.zero_rad_s.ln()));
        parameters
    }

    fn with(&self, parameters: &[f64]) -> Config {
        let mut config = self.config;
        let gains = inner_gains_mut(loops_of_mut(&mut config), self.name);
        (gains.kd, gains.kp, gains.ki) = (parameters[0].exp(), parameters[1].exp(), parameters[2].exp());
        let mut others = parameters[3..].iter().map(|x| x.exp());
        if let Some(corner) = &mut gains.prefilter_rad_s {
            *corner = others.next().unwrap_or(*corner).min(FASTEST_PREFILTER_RAD_S);
        }
        if let Some(canceller) = &mut gains.canceller {
            canceller.zero_rad_s = others.next().unwrap_or(canceller.zero_rad_s);
        }
        config
    }

    fn worth(&self, config: &Config) -> Result<f64> {
        let specs = &self.specs.attitude;
        let view = |delay_samples| View::Sampled { delay_samples };
        let closed = ClosedLoop::new(config, self.plant, self.name, view(self.specs.delay_samples))?;
        let late = ClosedLoop::new(config, self.plant, self.name, view(self.specs.stable_delay_samples))?;
        let radius = |closed: &ClosedLoop| -> Result<f64> {
            Ok(closed.closed.poles()?.first().map_or(0.0, |p| p.norm()))
        };
        let (radius, late_radius) = (radius(&closed)?, radius(&late)?);
        if radius >= 1.0 {
            return Ok(1e3 * radius);
        }
        let at_error = at_error(&closed);
        let actuator = |w: f64| closed.gain_at_actuator(w).iter().sum();
        let at_actuator = Margins::of(actuator, Band::coarse(closed.closed.period_s), true);
        let step = commanded_step(&closed, None, SEARCHED_S)?;
        let metrics = step_metrics(&step.values, step.period_s);
        // Each shortfall relative to what is asked, with a reserve of 4 % so that rounding does not undo it.
        let lack = |reached: f64, wanted: f64| ((1.04 * wanted - reached) / wanted).max(0.0);
        let excess = |reached: f64, wanted: f64| ((reached - 0.96 * wanted) / wanted).max(0.0);
        let lowest = metrics.lowest_after_peak.unwrap_or(1.0);
        let rise_s = metrics.rise_s.unwrap_or(10.0);
        let shortfall = lack(at_error.phase_margin_deg.unwrap_or(90.0), specs.phase_margin_deg)
            + lack(at_error.gain_margin.unwrap_or(100.0), specs.gain_margin)
            + 10.0 * (late_radius - LATE_RADIUS).max(0.0)
            + lack(lowest, specs.least_after_peak)
            + excess(rise_s, specs.rise_s)
            + excess(metrics.overshoot_percent, specs.overshoot_percent.max(1.0));
        // Beyond the specifications: distance from -1 at the actuator, where the rotors' own errors enter, and little dip.
        Ok(100.0 * shortfall + at_actuator.sensitivity_peak + (1.0 - lowest).max(0.0) + rise_s)
    }
}

/// How much of a step response the search looks at, s: past the dip.
const SEARCHED_S: f64 = 5.0;
/// How much of a position loop's step response is looked at for its overshoot, s.
const POSITION_S: f64 = 12.0;
/// Part of the overshoot of a position loop that a design uses.
const OVERSHOOT_USED: f64 = 0.85;
/// Spectral radius below which a loop with the latest pose counts as stable: a mode that halves in about a second.
const LATE_RADIUS: f64 = 0.994;

impl CostFunction for Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, parameters: &Self::Param) -> std::result::Result<f64, argmin::core::Error> {
        let config = self.with(parameters);
        if config.check().is_err() {
            return Ok(1e6);
        }
        Ok(self.worth(&config).unwrap_or(1e6))
    }
}

/// What of the specifications the gains do not meet, in the view of their method.
pub fn shortfalls(model: &Model, config: &Config, specs: &Specs) -> Result<Vec<Shortfall>> {
    let view = match specs.method {
        Method::Thesis => View::Continuous,
        Method::Delay => View::Sampled { delay_samples: specs.delay_samples },
    };
    let study = Study::new(model, config, view)?;
    let mut list = Vec::new();
    let mut at_least = |name: LoopName, what, wanted: f64, reached: Option<f64>| {
        if let Some(reached) = reached.filter(|reached| *reached < wanted) {
            list.push(Shortfall { name: name.name(), what, wanted, reached });
        }
    };
    // "At most" is "at least" with the signs turned, and turned back below.
    for ((_, closed), (name, margins)) in study.loops.iter().zip(study.margins()?) {
        at_least(name, "stability (1: stable)", 1.0, Some(f64::from(margins.stable)));
        if !margins.stable {
            continue;
        }
        let step = commanded(config, closed)?;
        let metrics = step_metrics(&step.values, step.period_s);
        let overshoot = Some(-metrics.overshoot_percent);
        let rise = metrics.rise_s.map(|rise| -rise);
        let error = &margins.at_error;
        match name {
            LoopName::Roll | LoopName::Pitch => {
                at_least(name, "phase margin, deg", specs.attitude.phase_margin_deg, error.phase_margin_deg);
                if specs.method == Method::Delay {
                    let a = &specs.attitude;
                    at_least(name, "gain margin", a.gain_margin, error.gain_margin);
                    at_least(
                        name,
                        "least value after the peak",
                        a.least_after_peak,
                        metrics.lowest_after_peak,
                    );
                    at_least(name, "overshoot, %", -a.overshoot_percent, overshoot);
                    at_least(name, "rise, s", -a.rise_s, rise);
                }
            }
            LoopName::Yaw | LoopName::Z => {
                let slow = if name == LoopName::Yaw { &specs.yaw } else { &specs.altitude };
                at_least(name, "overshoot, %", -slow.overshoot_percent, overshoot);
                at_least(name, "rise, s", -slow.rise_s, rise);
            }
            LoopName::X | LoopName::Y => {
                at_least(name, "phase margin, deg", specs.position.phase_margin_deg, error.phase_margin_deg);
                at_least(name, "overshoot, %", -specs.position.overshoot_percent, overshoot);
                if specs.method == Method::Delay {
                    at_least(name, "gain margin", specs.position.gain_margin, error.gain_margin);
                }
            }
        }
    }
    if specs.method == Method::Delay {
        let late = Study::new(model, config, View::Sampled { delay_samples: specs.stable_delay_samples })?;
        for (name, margins) in late.margins()? {
            at_least(
                name,
                "stability with the latest pose (1: stable)",
                1.0,
                Some(f64::from(margins.stable)),
            );
        }
    }
    for shortfall in list.iter_mut().filter(|s| s.wanted < 0.0) {
        (shortfall.wanted, shortfall.reached) = (-shortfall.wanted, -shortfall.reached);
    }
    Ok(list)
}
