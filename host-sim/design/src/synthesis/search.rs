//! The search of one loop's gains on the loop as it flies: the simplex of Nelder and Mead (crate
//! argmin) on the logarithms of the gains. Deterministic, and without derivatives, which margins do
//! not have where another crossing becomes the nearest.
//!
//! What is made small: first what the specifications lack, each relative to itself; beyond them the
//! sensitivity peak at the actuator, and of roll and pitch the rise time and the dip.

use argmin::core::{CostFunction, Executor, State as _};
use argmin::solver::neldermead::NelderMead;
use control::Config;

use super::judging::at_error;
use super::specs::Specs;
use crate::analysis::{Band, Margins, commanded_step, step_metrics};
use crate::error::{DesignError, Result};
use crate::loops::{
    ClosedLoop, LoopName, LoopPlant, View, inner_gains, inner_gains_mut, loops_of, loops_of_mut,
};

/// What the simplex searches: logarithms of Kd, Kp, Ki; of roll and pitch also those of the
/// prefilter's corner and, where there is a canceller, of its zero. (The prefilters of yaw and
/// altitude keep a large step from the ends of the motors.)
#[derive(Clone)]
pub(super) struct Search<'a> {
    pub(super) plant: &'a LoopPlant,
    pub(super) config: Config,
    pub(super) name: LoopName,
    pub(super) specs: Specs,
}

impl Search<'_> {
    fn is_tilt(&self) -> bool {
        matches!(self.name, LoopName::Roll | LoopName::Pitch)
    }

    fn parameters(&self) -> Vec<f64> {
        let mut config = self.config;
        let gains = inner_gains_mut(loops_of_mut(&mut config), self.name);
        let mut parameters = vec![gains.kd.ln(), gains.kp.ln(), gains.ki.max(1e-3).ln()];
        parameters.extend(gains.prefilter_rad_s.filter(|_| self.is_tilt()).map(f64::ln));
        parameters.extend(gains.canceller.map(|c| c.zero_rad_s.ln()));
        parameters
    }

    fn with(&self, parameters: &[f64]) -> Config {
        let mut config = self.config;
        let gains = inner_gains_mut(loops_of_mut(&mut config), self.name);
        (gains.kd, gains.kp, gains.ki) = (parameters[0].exp(), parameters[1].exp(), parameters[2].exp());
        let mut others = parameters[3..].iter().map(|x| x.exp());
        if let Some(corner) = &mut gains.prefilter_rad_s
            && self.is_tilt()
        {
            *corner = others.next().unwrap_or(*corner).min(FASTEST_PREFILTER_RAD_S);
        }
        if let Some(canceller) = &mut gains.canceller {
            canceller.zero_rad_s = others.next().unwrap_or(canceller.zero_rad_s);
        }
        config
    }

    fn wanted(&self) -> Wanted {
        let a = &self.specs.attitude;
        let slow = match self.name {
            LoopName::Yaw => &self.specs.yaw,
            LoopName::Z => &self.specs.altitude,
            _ => {
                return Wanted {
                    phase_margin_deg: a.phase_margin_deg,
                    gain_margin: a.gain_margin,
                    least_after_peak: a.least_after_peak,
                    rise_s: a.rise_s.unwrap_or(0.3),
                    overshoot_percent: a.overshoot_percent,
                    integral_rad_s: a.integral_rad_s,
                };
            }
        };
        Wanted {
            phase_margin_deg: slow.phase_margin_deg,
            gain_margin: slow.gain_margin,
            least_after_peak: 0.0,
            rise_s: slow.rise_s,
            overshoot_percent: slow.overshoot_percent,
            integral_rad_s: slow.integral_rad_s,
        }
    }

    /// Searches from the configuration's gains; the cost reached, and the configuration there.
    pub(super) fn run(&self) -> Result<(f64, Config)> {
        let start = self.parameters();
        let mut best = (f64::INFINITY, start.clone());
        // From the thesis' gains, and again from the best: a simplex can collapse on the edge of
        // what is allowed.
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
                Executor::new(self.clone(), solver).configure(|state| state.max_iters(SEARCH_STEPS)).run();
            let result = run.map_err(|e| DesignError::Optimiser(e.to_string()))?;
            let cost = result.state().get_best_cost();
            if let Some(x) = result.state().get_best_param()
                && cost < best.0
            {
                best = (cost, x.clone());
            }
        }
        Ok((best.0, self.with(&best.1)))
    }

    /// How good gains are, where `reserve` is what each specification is to be kept by.
    pub(super) fn worth(&self, config: &Config, reserve: f64) -> Result<Worth> {
        let wanted = self.wanted();
        let view = |delay_samples| View::Sampled { delay_samples };
        let closed = ClosedLoop::new(config, self.plant, self.name, view(self.specs.delay_samples))?;
        let late = ClosedLoop::new(config, self.plant, self.name, view(self.specs.stable_delay_samples))?;
        let radius = |closed: &ClosedLoop| -> Result<f64> {
            Ok(closed.closed.poles()?.first().map_or(0.0, |p| p.norm()))
        };
        let (radius, late_radius) = (radius(&closed)?, radius(&late)?);
        if radius >= 1.0 {
            return Ok(Worth { shortfall: 10.0 * radius, rest: 0.0 });
        }
        let at_error = at_error(&closed)?;
        let (pose, gyro) = (closed.at_actuator.sweep(0, 0)?, closed.at_actuator.sweep(1, 0)?);
        let actuator = |w: f64| pose.response(w) + gyro.response(w);
        let at_actuator = Margins::of(actuator, Band::coarse(closed.closed.period_s), true);
        let step = commanded_step(&closed, None, SEARCHED_S)?;
        let metrics = step_metrics(&step.values, step.period_s);
        let gains = inner_gains(loops_of(config), self.name);
        // Each shortfall relative to what is asked.
        let lack =
            |reached: f64, wanted: f64| (((1.0 + reserve) * wanted - reached) / wanted.max(1e-9)).max(0.0);
        let excess = |reached: f64, wanted: f64| ((reached - (1.0 - reserve) * wanted) / wanted).max(0.0);
        let lowest = metrics.lowest_after_peak.unwrap_or(1.0);
        let rise_s = metrics.rise_s.unwrap_or(10.0);
        let latest = if reserve > 0.0 { LATE_RADIUS } else { 1.0 };
        let shortfall = lack(at_error.phase_margin_deg.unwrap_or(90.0), wanted.phase_margin_deg)
            + lack(at_error.gain_margin.unwrap_or(100.0), wanted.gain_margin)
            + 10.0 * (late_radius - latest).max(0.0)
            + lack(gains.ki / gains.kp, wanted.integral_rad_s)
            + lack(lowest, wanted.least_after_peak)
            + excess(rise_s, wanted.rise_s)
            + excess(metrics.overshoot_percent, wanted.overshoot_percent.max(1.0));
        // Beyond the specifications: distance from -1 at the actuator, where the rotors' own errors
        // enter, and little dip.
        let quick = if self.is_tilt() { (1.0 - lowest).max(0.0) + rise_s } else { 0.0 };
        Ok(Worth { shortfall, rest: at_actuator.sensitivity_peak + quick })
    }
}

/// What a search asks of a loop.
struct Wanted {
    phase_margin_deg: f64,
    gain_margin: f64,
    least_after_peak: f64,
    rise_s: f64,
    overshoot_percent: f64,
    integral_rad_s: f64,
}

/// What gains are worth.
pub(super) struct Worth {
    /// Sum of what the specifications lack, each relative to itself.
    pub(super) shortfall: f64,
    /// What is made small beyond them.
    rest: f64,
}

impl Worth {
    pub(super) fn cost(&self) -> f64 {
        100.0 * self.shortfall + self.rest
    }
}

/// What a search keeps each specification by, so that rounding does not undo it.
pub(super) const RESERVE: f64 = 0.04;
/// How much of a step response the search looks at, s: past the dip.
const SEARCHED_S: f64 = 5.0;
/// Spectral radius below which a loop with the latest pose counts as stable: a mode that halves in
/// about a second.
const LATE_RADIUS: f64 = 0.994;

impl CostFunction for Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, parameters: &Self::Param) -> std::result::Result<f64, argmin::core::Error> {
        let config = self.with(parameters);
        if config.check().is_err() {
            return Ok(1e6);
        }
        Ok(self.worth(&config, RESERVE).map_or(1e6, |worth| worth.cost()))
    }
}

/// A prefilter beyond this is none: what it lets through is the noise of the position loops.
const FASTEST_PREFILTER_RAD_S: f64 = 20.0;
/// Steps of one run of the simplex.
const SEARCH_STEPS: u64 = 150;

#[cfg(test)]
mod tests {
    use super::*;

    fn yaw_plant() -> LoopPlant {
        LoopPlant::of_transfer(&[1.0], &[1.0, 0.4833, 0.0], None, Some(21.5)).unwrap()
    }

    /// The parameters are the gains: what is taken out of a configuration and put back changes
    /// nothing beyond rounding.
    #[test]
    fn parameters_are_the_logarithms_of_the_gains() {
        let (plant, config) = (yaw_plant(), Config::thesis());
        for name in [LoopName::Roll, LoopName::Yaw] {
            let search = Search { plant: &plant, config, name, specs: Specs::default() };
            let again = search.with(&search.parameters());
            let (before, after) = (inner_gains(loops_of(&config), name), inner_gains(loops_of(&again), name));
            for (x, y) in [(before.kd, after.kd), (before.kp, after.kp), (before.ki, after.ki)] {
                assert!((x / y - 1.0).abs() < 1e-14, "{before:?} {after:?}");
            }
        }
        // Kd, Kp and Ki; of roll the prefilter and the canceller too.
        let count = |name| Search { plant: &plant, config, name, specs: Specs::default() }.parameters().len();
        assert_eq!((count(LoopName::Yaw), count(LoopName::Roll)), (3, 5));
    }

    /// From a proportional gain four times too large the simplex finds its way back, and its cost
    /// is that of what it found.
    #[test]
    fn a_search_ends_better_than_it_began() {
        let plant = yaw_plant();
        let mut config = Config::thesis();
        inner_gains_mut(loops_of_mut(&mut config), LoopName::Yaw).kp *= 4.0;
        let search = Search { plant: &plant, config, name: LoopName::Yaw, specs: Specs::default() };
        let before = search.worth(&config, RESERVE).unwrap();
        let (cost, found) = search.run().unwrap();
        let after = search.worth(&found, RESERVE).unwrap();
        assert!((after.cost() - cost).abs() < 1e-9 * cost);
        assert!(after.shortfall < 0.2 * before.shortfall, "{} {}", before.shortfall, after.shortfall);
    }
}
