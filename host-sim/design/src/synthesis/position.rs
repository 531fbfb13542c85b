//! Position along x and y, thesis 5.4: velocity and proportional gain for a phase margin at a
//! crossover frequency.

use control::Config;

use super::draft::Draft;
use super::scan::largest;
use super::shortfall::unmet;
use super::specs::{Method, PositionSpecs};
use crate::analysis::{Band, Margins, commanded_step, step_metrics};
use crate::error::{Criterion, DesignError, Result, Shortfall};
use crate::loops::{ClosedLoop, Gain, LoopName, LoopPlant, View, gain_mut};

/// How much of a position loop's step response is looked at for its overshoot, s.
const FOLLOWED_S: f64 = 12.0;
/// Part of the overshoot asked for that a design uses.
const OVERSHOOT_USED: f64 = 0.85;

/// Finds the gains of the position loop along x or y.
pub(super) fn position(draft: &mut Draft, name: LoopName) -> Result<()> {
    let trial = Trial {
        config: draft.config,
        plant: draft.plant(name)?,
        name,
        view: draft.specs.view(),
        specs: draft.specs.position,
        method: draft.specs.method,
    };
    let (kp, kd) = match trial.widest()? {
        Some(gains) => gains,
        None => trial.nearest()?,
    };
    let specs = &trial.specs;
    let ratio = specs.integral_rad_s;
    let rule = format!(
        "largest Kp that crosses at most at {} rad/s with {} degrees, over velocity gains",
        specs.crossover_rad_s, specs.phase_margin_deg
    );
    draft.found(name, Gain::Velocity, kd, rule.clone());
    draft.found(name, Gain::Proportional, kp, rule);
    let rule = format!("takes constant disturbances away at {ratio:.3} rad/s");
    draft.found(name, Gain::Integral, ratio * kp, rule);
    Ok(())
}

/// A position loop with gains that are tried on it.
struct Trial {
    config: Config,
    plant: LoopPlant,
    name: LoopName,
    view: View,
    specs: PositionSpecs,
    method: Method,
}

/// What a position loop comes to.
struct Reached {
    phase_margin_deg: f64,
    gain_margin: f64,
    crossover_rad_s: f64,
}

impl Trial {
    fn close(&self, kp: f64, kd: f64) -> Result<ClosedLoop> {
        let mut config = self.config;
        *gain_mut(&mut config, self.name, Gain::Velocity) = kd;
        *gain_mut(&mut config, self.name, Gain::Proportional) = kp;
        *gain_mut(&mut config, self.name, Gain::Integral) = self.specs.integral_rad_s * kp;
        ClosedLoop::new(&config, &self.plant, self.name, self.view)
    }

    /// Margins at the error; absent: the loop is unstable.
    fn margins(&self, kp: f64, kd: f64) -> Result<Option<Margins>> {
        let closed = self.close(kp, kd)?;
        if !closed.closed.is_stable()? {
            return Ok(None);
        }
        // On the fine grid: a resonance of the inner loop that rises through 1 is a narrow one.
        let sweep = closed.at_error.sweep(0, 0)?;
        Ok(Some(Margins::of(|w| sweep.response(w), Band::of(closed.closed.period_s), true)))
    }

    /// Overshoot of 1 m through the rate limit, per cent.
    fn overshoot_percent(&self, kp: f64, kd: f64) -> Result<f64> {
        let step = commanded_step(&self.close(kp, kd)?, Some(self.specs.rate_limit_m_s), FOLLOWED_S)?;
        Ok(step_metrics(&step.values, step.period_s).overshoot_percent)
    }

    fn meets(&self, margins: &Margins) -> bool {
        let specs = &self.specs;
        margins.crossover_rad_s.is_some_and(|w| w <= specs.crossover_rad_s)
            && margins.phase_margin_deg.is_none_or(|phase| phase >= specs.phase_margin_deg)
            && (self.method == Method::Thesis || margins.gain_margin.is_none_or(|g| g >= specs.gain_margin))
    }

    /// Kp and Kd. Velocity gains from none to twice the proportional one; for each the largest
    /// proportional gain within the crossover; of those the fastest with just the margin asked for.
    /// As it flies, first of all one that does not come close to its overshoot.
    fn widest(&self) -> Result<Option<(f64, f64)>> {
        let mut chosen: Option<(f64, f64, f64)> = None;
        for k in 0..=20 {
            let share = 0.1 * f64::from(k);
            let within = |kp: f64| Ok(self.margins(kp, share * kp)?.is_some_and(|m| self.meets(&m)));
            let Some(kp) = largest(0.01, 3.0, within)? else { continue };
            let excess = match self.view {
                View::Continuous => 0.0,
                View::Sampled { .. } => {
                    let used = OVERSHOOT_USED * self.specs.overshoot_percent;
                    (self.overshoot_percent(kp, share * kp)? - used).max(0.0)
                }
            };
            let worth = kp - excess;
            if chosen.is_none_or(|(best, ..)| worth > best) {
                chosen = Some((worth, kp, share * kp));
            }
        }
        Ok(chosen.map(|(_, kp, kd)| (kp, kd)))
    }

    /// What a loop that meets nothing comes to; absent: it is unstable, or never crosses.
    fn reached(&self, kp: f64, kd: f64) -> Result<Option<Reached>> {
        Ok(self.margins(kp, kd)?.and_then(|m| {
            Some(Reached {
                crossover_rad_s: m.crossover_rad_s?,
                phase_margin_deg: m.phase_margin_deg.unwrap_or(90.0),
                gain_margin: m.gain_margin.unwrap_or(100.0),
            })
        }))
    }

    /// Kp and Kd of a position loop that meets nothing: those that lack least, so that all
    /// shortfalls are reported together. The thesis' way reports the first one as an error.
    fn nearest(&self) -> Result<(f64, f64)> {
        let specs = &self.specs;
        let searched = self.method == Method::Delay;
        let mut nearest: Option<(f64, f64, f64, Reached)> = None;
        for k in 0..=10 {
            let share = 0.2 * f64::from(k);
            for step in 0..=40 {
                let kp = 0.01 * 300_f64.powf(f64::from(step) / 40.0);
                let Some(reached) = self.reached(kp, share * kp)? else { continue };
                let lack = (1.0 - reached.phase_margin_deg / specs.phase_margin_deg.max(1e-3)).max(0.0)
                    + (reached.crossover_rad_s / specs.crossover_rad_s - 1.0).max(0.0)
                    + if searched { (1.0 - reached.gain_margin / specs.gain_margin).max(0.0) } else { 0.0 };
                if nearest.as_ref().is_none_or(|(least, ..)| lack < *least) {
                    nearest = Some((lack, kp, share * kp, reached));
                }
            }
        }
        let shortfall: Shortfall = match nearest {
            None => unmet(self.name, Criterion::StabilisingGain, 0.01, 0.0),
            Some((_, kp, kd, _)) if searched => return Ok((kp, kd)),
            Some((.., r)) if r.phase_margin_deg < specs.phase_margin_deg => {
                unmet(self.name, Criterion::PhaseMargin, specs.phase_margin_deg, r.phase_margin_deg)
            }
            Some((.., r)) => unmet(self.name, Criterion::Crossover, specs.crossover_rad_s, r.crossover_rad_s),
        };
        Err(DesignError::Unmet(shortfall))
    }
}

#[cfg(test)]
mod tests {
    use model::Model;

    use super::*;
    use crate::plant::{Linear, TrimTarget};
    use crate::synthesis::specs::Specs;

    fn draft<'a>(model: &'a Model, specs: Specs) -> Draft<'a> {
        let linear = Linear::new(model, &TrimTarget::default()).unwrap();
        Draft { model, linear, specs, config: Config::thesis(), steps: Vec::new() }
    }

    /// Around the thesis' own attitude loops, with what the thesis asks for: 45 degrees at most at
    /// 1.2 rad/s, and the integral at a fifteenth of Kp.
    #[test]
    fn a_position_loop_crosses_where_it_may() {
        let model = Model::thesis();
        let mut draft = draft(&model, Specs::thesis());
        position(&mut draft, LoopName::X).unwrap();
        let plant = draft.plant(LoopName::X).unwrap();
        let closed = ClosedLoop::new(&draft.config, &plant, LoopName::X, View::Continuous).unwrap();
        let margins = crate::analysis::LoopMargins::of(&closed).unwrap();
        let crossover = margins.at_error.crossover_rad_s.unwrap();
        assert!(margins.stable && margins.at_error.phase_margin_deg.unwrap() >= 45.0);
        assert!(crossover <= 1.2 && crossover > 1.0, "{crossover}");
        let [kp, ki] = [Gain::Proportional, Gain::Integral]
            .map(|gain| crate::loops::gain_of(&draft.config, LoopName::X, gain));
        assert!((15.0 * ki - kp).abs() < 1e-12);
    }

    #[test]
    fn a_phase_margin_out_of_reach_is_said_with_the_best_there_is() {
        let model = Model::thesis();
        let mut specs = Specs::thesis();
        specs.position.phase_margin_deg = 89.9;
        let Err(DesignError::Unmet(shortfall)) = position(&mut draft(&model, specs), LoopName::X) else {
            panic!("met")
        };
        assert_eq!((shortfall.what, shortfall.wanted), (Criterion::PhaseMargin, 89.9));
        assert!(shortfall.reached > 45.0 && shortfall.reached < 89.9, "{shortfall:?}");
    }
}
