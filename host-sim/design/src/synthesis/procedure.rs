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

use control::Config;
use control::filter::GainRule;
use control::gains::{
    CancellerParams, InnerLoop, Law, Mixing, MotorMapParams, PositionLoop, Saturation, VelocityEstimator,
};
use control::supervision::BatteryLevels;
use model::Model;
use serde::Serialize;

use crate::check::{Study, commanded};
use crate::curves::{Gain, gain_mut, gain_of};
use crate::error::{DesignError, Result};
use crate::linear::{CANCEL_TOLERANCE, Linear};
use crate::loops::{
    ClosedLoop, LoopName, LoopPlant, View, axis_channel, inner_gains, inner_gains_mut, law_effect, loops_of,
    loops_of_mut,
};
use crate::margins::{Band, Margins};
use crate::response::{commanded_step, least_damped_seen, step_metrics};
use crate::search::{RESERVE, Search, at_error};
pub use crate::specs::{AttitudeSpecs, Method, PositionSpecs, SlowSpecs, Specs};
use crate::state_space::StateSpace;
use crate::trim::TrimTarget;

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

impl Shortfall {
    /// The key of the specification in a specifications file; absent where none can be relaxed (an unstable loop).
    pub fn key(&self) -> Option<String> {
        let table = match self.name {
            "roll" | "pitch" => "attitude",
            "yaw" => "yaw",
            "z" => "altitude",
            "x" | "y" => "position",
            _ => return None,
        };
        let key = match self.what {
            "phase margin, deg" | "phase margin before the integral, deg" => "phase_margin_deg",
            "gain margin" => "gain_margin",
            "crossover, rad/s" => "crossover_rad_s",
            "overshoot by damping, %" if table == "attitude" => "damping_overshoot_percent",
            "overshoot, %" | "overshoot by damping, %" => "overshoot_percent",
            "rise, s" => "rise_s",
            "least value after the peak" => "least_after_peak",
            "Ki over Kp, rad/s" => "integral_rad_s",
            "stability with the latest pose (1: stable)" => return Some("stable_delay_samples".into()),
            _ => return None,
        };
        Some(format!("{table}.{key}"))
    }
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
    let specs = &specs.for_craft(&linear);
    let config = blank(model, &linear, specs)?;
    let mut work = Work { model, linear, specs: *specs, config, steps: Vec::new() };
    work.battery_levels();
    for name in [LoopName::Roll, LoopName::Pitch, LoopName::Yaw, LoopName::Z] {
        work.inner(name)?;
    }
    if specs.method == Method::Delay {
        work.search_attitude()?;
        for name in [LoopName::Yaw, LoopName::Z] {
            work.search_slow(name)?;
        }
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

    /// Voltages at which the craft warns and lands, for the pack that the model was made with. The thesis' levels are those of
    /// three cells; a craft of another voltage would land at once or never. Without a voltage they stay.
    fn battery_levels(&mut self) {
        let made_at_v = self.model.reference.battery_v;
        if !(made_at_v > 0.0) {
            return;
        }
        let cells = (made_at_v / CELL_IN_FLIGHT_V).round().max(1.0);
        let levels = &mut self.config.supervision.battery;
        for level in [&mut levels.warn_v, &mut levels.land_v, &mut levels.empty_v] {
            *level *= cells / 3.0;
        }
        let BatteryLevels { warn_v, land_v, .. } = *levels;
        self.steps.push(Step {
            name: "all",
            gain: "battery cells",
            value: cells,
            rule: format!(
                "lithium-polymer, by the model's {made_at_v:.1} V: warns under {warn_v:.1} V, lands under {land_v:.1} V"
            ),
        });
    }

    /// An inner loop by the thesis' steps. Where they lead nowhere the search has a start of its own.
    fn inner(&mut self, name: LoopName) -> Result<()> {
        let (config, steps) = (self.config, self.steps.len());
        let found = match name {
            LoopName::Roll | LoopName::Pitch => self.attitude(name),
            _ => self.slow(name),
        };
        match found {
            Err(DesignError::Unmet(unmet)) if self.specs.method == Method::Delay => {
                self.config = config;
                self.steps.truncate(steps);
                if matches!(name, LoopName::Roll | LoopName::Pitch) {
                    self.canceller(name, self.specs.attitude.zero_rad_s)?;
                }
                let plant = self.plant(name)?;
                if let Some((_, start)) = self.starts(&self.config, name, &plant)?.into_iter().next() {
                    self.config = start;
                }
                let what = format!(
                    "a start for the search: the thesis' steps end at {}, wanted {}, reached {}",
                    unmet.what,
                    short(unmet.wanted),
                    short(unmet.reached)
                );
                self.steps.push(Step {
                    name: name.name(),
                    gain: Gain::Velocity.symbol(),
                    value: gain_of(&self.config, name, Gain::Velocity),
                    rule: what,
                });
                Ok(())
            }
            found => found,
        }
    }

    /// Thesis 5.3.1.
    fn attitude(&mut self, name: LoopName) -> Result<()> {
        let plant = self.plant(name)?;
        let specs = self.specs.attitude;
        let close = |config: &Config| ClosedLoop::new(config, &plant, name, View::Continuous);
        // Velocity gain: from the root locus of (5.25).
        let slowest = |kd: f64| -> Result<f64> {
            slowest_moved(&close(&self.with(name, Gain::Velocity, kd))?.velocity_loop)
        };
        let holds = |kd: f64| Ok(slowest(kd)? < 0.0);
        let (kd, rule) = if holds(0.0)? {
            let rule = "the axis is stable by itself: moves the slowest pole of the velocity loop as far left as it goes";
            (best(0.05, 500.0, slowest)?, rule.to_owned())
        } else {
            let Some(least) = first(0.05, 500.0, holds)? else {
                let at_best = greatest(0.05, 500.0, |kd| Ok(Some(-slowest(kd)?)))?;
                return Err(unstable(name, "velocity loop", at_best.map(|(_, growth)| -growth)));
            };
            let ratio = specs.velocity_gain_ratio;
            let rule =
                format!("{ratio:.2} times {least:.3}, the least that stabilises the velocity loop (5.25)");
            (ratio * least, rule)
        };
        if !holds(kd)? {
            return Err(unstable(name, "velocity loop", Some(slowest(kd)?)));
        }
        self.found(name, Gain::Velocity, kd, rule);
        self.canceller(name, specs.zero_rad_s)?;
        // Proportional gain: (5.27), as large as overshoot, margin and crossover allow, with a third of the phase kept for Ki.
        let allowed = |config: &Config, reserve_deg: f64| -> Result<bool> {
            let closed = close(config)?;
            if !closed.closed.is_stable()? {
                return Ok(false);
            }
            let margins = at_error(&closed)?;
            let overshoot = least_damped_seen(&closed.closed)?.map_or(0.0, |m| damping_overshoot(m.damping));
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
                    let margins = at_error(&closed)?;
                    let slow = margins.crossover_rad_s.is_none_or(|w| w <= specs.crossover_rad_s);
                    let mode = least_damped_seen(&closed.closed)?;
                    let overshoot = mode.map_or(0.0, |m| damping_overshoot(m.damping));
                    let damped = overshoot <= specs.damping_overshoot_percent;
                    Ok(margins.phase_margin_deg.filter(|_| slow && damped))
                };
                let Some((kp, reached)) = greatest(1.0, 2000.0, phase)? else {
                    return Err(self.undamped(name, &plant, specs.damping_overshoot_percent, 1.0)?);
                };
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

    /// No proportional gain is stable, damped and slow enough: what is reached at best.
    fn undamped(&self, name: LoopName, plant: &LoopPlant, wanted: f64, unit: f64) -> Result<DesignError> {
        let close = |kp: f64| {
            ClosedLoop::new(&self.with(name, Gain::Proportional, kp), plant, name, View::Continuous)
        };
        let (low, high) = (0.05 * unit, 2000.0 * unit);
        let damped = |kp: f64| -> Result<Option<f64>> {
            let closed = close(kp)?;
            if !closed.closed.is_stable()? {
                return Ok(None);
            }
            Ok(Some(-least_damped_seen(&closed.closed)?.map_or(0.0, |m| damping_overshoot(m.damping))))
        };
        let unmet = |what, wanted, reached| {
            DesignError::Unmet(Shortfall { name: name.name(), what, wanted, reached })
        };
        if let Some((_, percent)) = greatest(low, high, damped)? {
            if -percent > wanted {
                return Ok(unmet("overshoot by damping, %", wanted, -percent));
            }
            let slow = |kp: f64| -> Result<Option<f64>> {
                let enough = damped(kp)?.filter(|percent| -percent <= wanted);
                Ok(enough.map(|_| at_error(&close(kp)?)).transpose()?.and_then(|m| Some(-m.crossover_rad_s?)))
            };
            let least = greatest(low, high, slow)?.map_or(f64::NAN, |(_, crossover)| -crossover);
            return Ok(unmet("crossover, rad/s", self.specs.attitude.crossover_rad_s, least));
        }
        let growth = |kp: f64| Ok(close(kp)?.closed.poles()?.first().map(|p| -p.re));
        let at_best = greatest(low, high, growth)?.map(|(_, growth)| -growth);
        Ok(unstable(name, "proportional loop", at_best))
    }

    /// (5.26): the pole on the plant's slow zero, where there is one.
    fn canceller(&mut self, name: LoopName, zero_rad_s: f64) -> Result<()> {
        let channel = axis_channel(&self.linear, name)?;
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
            slowest_moved(&close(&self.with(name, Gain::Velocity, kd))?.velocity_loop)
        };
        // In the channel's own unit: N for altitude, whose acceleration is a force over the mass.
        let unit = 1.0 / plant_gain(&self.linear, name)?;
        let kd = best(0.05 * unit, 500.0 * unit, slowest)?;
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
            let mode = least_damped_seen(&closed.closed)?;
            Ok(Some(mode.map_or(0.0, |m| damping_overshoot(m.damping))))
        };
        let allowed = |kp: f64| Ok(overshoot(kp)?.is_some_and(|percent| percent <= specs.overshoot_percent));
        let Some(kp) = largest(0.05 * unit, 1000.0 * unit, allowed)? else {
            return Err(self.undamped(name, &plant, specs.overshoot_percent, unit)?);
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
            // On the fine grid: a resonance of the inner loop that rises through 1 is a narrow one.
            let sweep = closed.at_error.sweep(0, 0)?;
            Ok(Some(Margins::of(|w| sweep.response(w), Band::of(closed.closed.period_s), true)))
        };
        // Velocity gains from none to twice the proportional one; for each the largest proportional gain within the
        // crossover; of those the one with the widest margins.
        let overshoot = |kp: f64, kd: f64| -> Result<f64> {
            let closed = ClosedLoop::new(&with(kp, kd), &plant, name, view)?;
            let step = commanded_step(&closed, Some(specs.rate_limit_m_s), POSITION_S)?;
            Ok(step_metrics(&step.values, step.period_s).overshoot_percent)
        };
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
            // A fast loop with just the margin asked for. As it flies, first of all one that does not come close to its
            // overshoot.
            let excess = match view {
                View::Continuous => 0.0,
                View::Sampled { .. } => {
                    (overshoot(kp, share * kp)? - OVERSHOOT_USED * specs.overshoot_percent).max(0.0)
                }
            };
            let worth = kp - excess;
            if chosen.is_none_or(|(best, ..)| worth > best) {
                chosen = Some((worth, kp, share * kp));
            }
        }
        let (kp, kd) = match chosen {
            Some((_, kp, kd)) => (kp, kd),
            None => {
                let reach = |kp: f64, kd: f64| -> Result<Option<Reached>> {
                    let Some(m) = tried(kp, kd)?.filter(|m| m.crossover_rad_s.is_some()) else {
                        return Ok(None);
                    };
                    Ok(Some(Reached {
                        phase_margin_deg: m.phase_margin_deg.unwrap_or(90.0),
                        gain_margin: m.gain_margin.unwrap_or(100.0),
                        crossover_rad_s: m.crossover_rad_s.unwrap_or(0.0),
                    }))
                };
                self.nearest_position(name, reach)?
            }
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

    /// Gains of a position loop that meets nothing: those that lack least, for the shortfalls to be told together; by the
    /// thesis' way, which knows one, that one.
    fn nearest_position(
        &self,
        name: LoopName,
        reach: impl Fn(f64, f64) -> Result<Option<Reached>>,
    ) -> Result<(f64, f64)> {
        let specs = self.specs.position;
        let searched = self.specs.method == Method::Delay;
        let mut nearest: Option<(f64, f64, f64, Reached)> = None;
        for k in 0..=10 {
            let share = 0.2 * f64::from(k);
            for step in 0..=40 {
                let kp = 0.01 * 300_f64.powf(f64::from(step) / 40.0);
                let Some(reached) = reach(kp, share * kp)? else { continue };
                let lack = (1.0 - reached.phase_margin_deg / specs.phase_margin_deg.max(1e-3)).max(0.0)
                    + (reached.crossover_rad_s / specs.crossover_rad_s - 1.0).max(0.0)
                    + if searched { (1.0 - reached.gain_margin / specs.gain_margin).max(0.0) } else { 0.0 };
                if nearest.as_ref().is_none_or(|(least, ..)| lack < *least) {
                    nearest = Some((lack, kp, share * kp, reached));
                }
            }
        }
        let unmet = |what, wanted, reached| {
            Err(DesignError::Unmet(Shortfall { name: name.name(), what, wanted, reached }))
        };
        match nearest {
            None => unmet("proportional gain that makes it stable, at least", 0.01, 0.0),
            Some((_, kp, kd, _)) if searched => Ok((kp, kd)),
            Some((.., r)) if r.phase_margin_deg < specs.phase_margin_deg => {
                unmet("phase margin, deg", specs.phase_margin_deg, r.phase_margin_deg)
            }
            Some((.., r)) => unmet("crossover, rad/s", specs.crossover_rad_s, r.crossover_rad_s),
        }
    }

    /// Roll and pitch on the loops as they fly. The estimator is common to both: each of a few is tried, and the one with
    /// the lower cost of both axes together flies.
    fn search_attitude(&mut self) -> Result<()> {
        let both = [LoopName::Roll, LoopName::Pitch];
        let start = self.config;
        let mut found: Option<(f64, Config)> = None;
        for estimator in ESTIMATORS {
            let mut config = start;
            config.estimation.velocity = estimator;
            let mut cost = 0.0;
            for name in both {
                cost += self.search_axis(&mut config, name)?;
            }
            if found.as_ref().is_none_or(|(least, _)| cost < *least) {
                found = Some((cost, config));
            }
        }
        let Some((mut cost, mut config)) = found else { return Ok(()) };
        // Where the thesis' gains are too far from what this craft needs, others to start from.
        for name in both {
            cost += self.search_anew(&mut config, name)?;
        }
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
                        "searched with the gains: rise of at most {:.3} s with at most {} % overshoot",
                        self.specs.attitude.rise_s.unwrap_or(0.3),
                        self.specs.attitude.overshoot_percent
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

    /// Yaw or altitude as it flies, where the thesis' steps leave something short of the specifications.
    fn search_slow(&mut self, name: LoopName) -> Result<()> {
        let mut config = self.config;
        if !self.lacks(&config, name)? {
            return Ok(());
        }
        self.search_axis(&mut config, name)?;
        self.search_anew(&mut config, name)?;
        self.config = config;
        let rule = format!(
            "searched on the sampled loop with {} samples of delay, stable with {}: the thesis' steps fall short there",
            self.specs.delay_samples, self.specs.stable_delay_samples
        );
        for gain in crate::curves::GAINS {
            self.found(name, gain, gain_of(&config, name, gain), rule.clone());
        }
        Ok(())
    }

    /// Whether gains fall short of the specifications on the loop as it flies.
    fn lacks(&self, config: &Config, name: LoopName) -> Result<bool> {
        let plant = self.plant(name)?;
        let search = Search { plant: &plant, config: *config, name, specs: self.specs };
        Ok(search.worth(config, 0.0)?.shortfall > 0.0)
    }

    /// Searches one axis from gains made for its delays, slower and faster ones, if it falls short; gives what the cost falls
    /// by, not above zero.
    fn search_anew(&self, config: &mut Config, name: LoopName) -> Result<f64> {
        if !self.lacks(config, name)? {
            return Ok(0.0);
        }
        let plant = self.plant(name)?;
        let cost = |config: &Config| -> Result<f64> {
            let search = Search { plant: &plant, config: *config, name, specs: self.specs };
            Ok(search.worth(config, RESERVE)?.cost())
        };
        let before = cost(config)?;
        let mut least = before;
        for (_, mut other) in self.starts(config, name, &plant)?.into_iter().take(STARTS) {
            self.search_axis(&mut other, name)?;
            let reached = cost(&other)?;
            if reached < least {
                (*config, least) = (other, reached);
            }
        }
        Ok(least - before)
    }

    /// Gains to start a search from with their costs, the best first: slower and faster ones, soft and stiff. (A craft that the
    /// air tips over as it gains speed is held by stiffness alone, and one that it rights by none.)
    fn starts(&self, config: &Config, name: LoopName, plant: &LoopPlant) -> Result<Vec<(f64, Config)>> {
        let mut starts = Vec::new();
        for pace in [0.5, 1.0, 2.0] {
            for stiffness in [0.5, 1.0, 2.0, 4.0, 8.0] {
                let mut other = started(config, &self.linear, name, &self.specs, pace);
                let gains = inner_gains_mut(loops_of_mut(&mut other), name);
                (gains.kp, gains.ki) = (stiffness * gains.kp, stiffness * gains.ki);
                let search = Search { plant, config: other, name, specs: self.specs };
                starts.push((search.worth(&other, RESERVE)?.cost(), other));
            }
        }
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(starts)
    }

    /// Searches the gains of one axis in `config`; gives the cost reached.
    fn search_axis(&self, config: &mut Config, name: LoopName) -> Result<f64> {
        let plant = self.plant(name)?;
        let search = Search { plant: &plant, config: *config, name, specs: self.specs };
        let (cost, found) = search.run()?;
        *config = found;
        Ok(cost)
    }
}

/// What a lithium-polymer cell has in the middle of a flight, under load, V.
const CELL_IN_FLIGHT_V: f64 = 3.75;
/// Phase that the integral part may take away, degrees.
const INTEGRAL_RESERVE_DEG: f64 = 8.0;
/// How much of a position loop's step response is looked at for its overshoot, s.
const POSITION_S: f64 = 12.0;
/// Part of the overshoot of a position loop that a design uses.
const OVERSHOOT_USED: f64 = 0.85;
/// Starts of a search beside the thesis' steps.
const STARTS: usize = 3;
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

/// Real part of the slowest pole that a velocity gain moves. The channel's own integrator stays at the origin, or close to
/// it where something weak holds the variable (a floor's cushion, a lean): that pole is the proportional gain's to move.
fn slowest_moved(velocity_loop: &StateSpace) -> Result<f64> {
    const AT_ORIGIN_RAD_S: f64 = 0.1;
    let mut poles = velocity_loop.poles()?;
    let nearest = (0..poles.len()).min_by(|&i, &j| poles[i].norm().total_cmp(&poles[j].norm()));
    if let Some(nearest) = nearest
        && poles[nearest].norm() < AT_ORIGIN_RAD_S
        && poles[nearest].im == 0.0
    {
        poles.swap_remove(nearest);
    }
    // Two at the origin come out of the eigenvalues a rounding apart, as a pair.
    Ok(poles.iter().filter(|p| p.norm() > 1e-6).map(|p| p.re).fold(f64::NEG_INFINITY, f64::max))
}

/// What a position loop comes to.
struct Reached {
    phase_margin_deg: f64,
    gain_margin: f64,
    crossover_rad_s: f64,
}

/// A loop that no gain makes stable: how fast its worst mode grows at best.
fn unstable(name: LoopName, which: &'static str, growth: Option<f64>) -> DesignError {
    let what = match which {
        "velocity loop" => "growth of the velocity loop's worst mode, 1/s",
        _ => "growth of the proportional loop's worst mode, 1/s",
    };
    DesignError::Unmet(Shortfall {
        name: name.name(),
        what,
        wanted: 0.0,
        reached: growth.unwrap_or(f64::NAN),
    })
}

/// What the law's unit of output accelerates its variable by.
fn plant_gain(linear: &Linear, name: LoopName) -> Result<f64> {
    Ok(axis_channel(linear, name)?.gain.abs().max(1e-9))
}

fn short(value: f64) -> String {
    format!("{value:.3}")
}

/// All that delays a loop at low frequencies, s: rotors, dead time, pose, half a period of the hold, estimator.
pub(crate) fn delay_s(config: &Config, linear: &Linear, delay_samples: usize) -> f64 {
    let VelocityEstimator { natural_frequency_rad_s, damping_ratio } = config.estimation.velocity;
    linear.motor_lag_rad_s.map_or(0.0, |lag| 1.0 / lag)
        + linear.input_delay_s
        + (delay_samples as f64 + 0.5) * config.sample_time_s
        + 2.0 * damping_ratio / natural_frequency_rad_s
}

/// Gains to start a search from, made for a double integrator behind the delays of the loop. The velocity loop crosses where those delays take 20 degrees, the proportional one at a third of that;
/// `pace` is how much faster.
fn started(config: &Config, linear: &Linear, name: LoopName, specs: &Specs, pace: f64) -> Config {
    let mut config = *config;
    let delay_s = delay_s(&config, linear, specs.delay_samples);
    let unit = 1.0 / plant_gain(linear, name).unwrap_or(1.0);
    let velocity_rad_s = pace * 0.35 / delay_s;
    let angle_rad_s = velocity_rad_s / 3.0;
    let gains = inner_gains_mut(loops_of_mut(&mut config), name);
    gains.kd = unit * velocity_rad_s;
    gains.kp = gains.kd * angle_rad_s;
    gains.ki = 0.1 * gains.kp * angle_rad_s;
    if matches!(name, LoopName::Roll | LoopName::Pitch) {
        gains.prefilter_rad_s = Some(3.0 * angle_rad_s);
    }
    config
}

/// What of the specifications the gains do not meet, in the view of their method.
pub fn shortfalls(model: &Model, config: &Config, specs: &Specs) -> Result<Vec<Shortfall>> {
    let view = match specs.method {
        Method::Thesis => View::Continuous,
        Method::Delay => View::Sampled { delay_samples: specs.delay_samples },
    };
    let study = Study::new(model, config, view)?;
    let specs = &specs.for_craft(&study.linear);
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
                    let gains = inner_gains(loops_of(config), name);
                    at_least(name, "Ki over Kp, rad/s", a.integral_rad_s, Some(gains.ki / gains.kp));
                    at_least(name, "gain margin", a.gain_margin, error.gain_margin);
                    at_least(
                        name,
                        "least value after the peak",
                        a.least_after_peak,
                        metrics.lowest_after_peak,
                    );
                    at_least(name, "overshoot, %", -a.overshoot_percent, overshoot);
                    at_least(name, "rise, s", -a.rise_s.unwrap_or(0.3), rise);
                }
            }
            LoopName::Yaw | LoopName::Z => {
                let slow = if name == LoopName::Yaw { &specs.yaw } else { &specs.altitude };
                if specs.method == Method::Delay {
                    at_least(name, "phase margin, deg", slow.phase_margin_deg, error.phase_margin_deg);
                    at_least(name, "gain margin", slow.gain_margin, error.gain_margin);
                }
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
    let together = study.together(model, config, view)?;
    list.extend((!together.stable).then_some(Shortfall {
        name: "all loops together",
        what: "decay of the slowest mode, 1/s (above 0: stable)",
        wanted: 0.0,
        reached: together.slowest_1_s,
    }));
    let mut at_least = |name: LoopName, what, wanted: f64, reached: Option<f64>| {
        if let Some(reached) = reached.filter(|reached| *reached < wanted) {
            list.push(Shortfall { name: name.name(), what, wanted, reached });
        }
    };
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
