//! Roll and pitch, thesis 5.3.1: velocity gain, canceller, proportional gain, integral gain.

use control::Config;

use super::damping::undamped;
use super::draft::Draft;
use super::judging::{at_error, seen_overshoot, slowest_moved, unstable};
use super::scan::{best, first, greatest, largest};
use super::shortfall::unmet;
use super::specs::Method;
use crate::analysis::Margins;
use crate::error::{Criterion, DesignError, Result};
use crate::loops::{ClosedLoop, Gain, LoopName, LoopPlant, View};

/// Phase that the integral part may take away, degrees.
const INTEGRAL_RESERVE_DEG: f64 = 8.0;

/// Finds the gains of roll or pitch.
pub(super) fn attitude(draft: &mut Draft, name: LoopName) -> Result<()> {
    let plant = draft.plant(name)?;
    velocity(draft, name, &plant)?;
    draft.canceller(name, draft.specs.attitude.zero_rad_s)?;
    proportional(draft, name, &plant)?;
    integral(draft, name, &plant)
}

/// The velocity gain, from the root locus of (5.25).
fn velocity(draft: &mut Draft, name: LoopName, plant: &LoopPlant) -> Result<()> {
    let slowest = |kd: f64| -> Result<f64> {
        let config = draft.with(name, Gain::Velocity, kd);
        slowest_moved(&ClosedLoop::new(&config, plant, name, View::Continuous)?.velocity_loop)
    };
    let holds = |kd: f64| Ok(slowest(kd)? < 0.0);
    let growth = Criterion::VelocityLoopGrowth;
    let (kd, rule) = if holds(0.0)? {
        let rule = "the axis is stable by itself: moves the slowest pole of the velocity loop as far left as it goes";
        (best(0.05, 500.0, slowest)?, rule.to_owned())
    } else {
        let Some(least) = first(0.05, 500.0, holds)? else {
            let at_best = greatest(0.05, 500.0, |kd| Ok(Some(-slowest(kd)?)))?;
            return Err(unstable(name, growth, at_best.map(|(_, growth)| -growth)));
        };
        let ratio = draft.specs.attitude.velocity_gain_ratio;
        let rule = format!("{ratio:.2} times {least:.3}, the least that stabilises the velocity loop (5.25)");
        (ratio * least, rule)
    };
    if !holds(kd)? {
        return Err(unstable(name, growth, Some(slowest(kd)?)));
    }
    draft.found(name, Gain::Velocity, kd, rule);
    Ok(())
}

/// What a stable attitude loop is judged by.
struct Judged {
    overshoot_percent: f64,
    margins: Margins,
}

impl Judged {
    /// Whether the loop is damped and slow enough.
    fn is_calm(&self, draft: &Draft) -> bool {
        let specs = &draft.specs.attitude;
        self.overshoot_percent <= specs.damping_overshoot_percent
            && self.margins.crossover_rad_s.is_none_or(|w| w <= specs.crossover_rad_s)
    }

    /// Whether it has the phase margin asked for, and so many degrees more.
    fn has_phase(&self, draft: &Draft, reserve_deg: f64) -> bool {
        let wanted_deg = draft.specs.attitude.phase_margin_deg + reserve_deg;
        self.margins.phase_margin_deg.is_none_or(|phase| phase >= wanted_deg)
    }
}

/// Absent: the loop is unstable.
fn judged(config: &Config, plant: &LoopPlant, name: LoopName) -> Result<Option<Judged>> {
    let closed = ClosedLoop::new(config, plant, name, View::Continuous)?;
    let Some(overshoot_percent) = seen_overshoot(&closed)? else { return Ok(None) };
    Ok(Some(Judged { overshoot_percent, margins: at_error(&closed)? }))
}

/// The proportional gain of (5.27): as large as overshoot, margin and crossover allow, with part of
/// the phase kept for Ki.
fn proportional(draft: &mut Draft, name: LoopName, plant: &LoopPlant) -> Result<()> {
    let specs = draft.specs.attitude;
    let at = |kp: f64| judged(&draft.with(name, Gain::Proportional, kp), plant, name);
    let found = largest(1.0, 2000.0, |kp| {
        Ok(at(kp)?.is_some_and(|j| j.is_calm(draft) && j.has_phase(draft, INTEGRAL_RESERVE_DEG)))
    })?;
    let kp = match found {
        Some(kp) => kp,
        None => {
            let phase =
                |kp: f64| Ok(at(kp)?.filter(|j| j.is_calm(draft)).and_then(|j| j.margins.phase_margin_deg));
            let Some((kp, reached)) = greatest(1.0, 2000.0, phase)? else {
                return Err(undamped(draft, name, plant, specs.damping_overshoot_percent, 1.0)?);
            };
            // A search goes on from the best there is.
            if draft.specs.method == Method::Thesis {
                let wanted = specs.phase_margin_deg + INTEGRAL_RESERVE_DEG;
                let what = Criterion::PhaseMarginBeforeIntegral;
                return Err(DesignError::Unmet(unmet(name, what, wanted, reached)));
            }
            kp
        }
    };
    let rule = format!(
        "largest with at most {} % overshoot by damping, {} rad/s and {INTEGRAL_RESERVE_DEG} degrees beyond the phase margin, kept for Ki (5.27)",
        specs.damping_overshoot_percent, specs.crossover_rad_s
    );
    draft.found(name, Gain::Proportional, kp, rule);
    Ok(())
}

/// The integral gain of (5.28).
fn integral(draft: &mut Draft, name: LoopName, plant: &LoopPlant) -> Result<()> {
    let kp = crate::loops::gain_of(&draft.config, name, Gain::Proportional);
    let allowed = |ki: f64| {
        let judged = judged(&draft.with(name, Gain::Integral, ki), plant, name)?;
        Ok(judged.is_some_and(|j| j.is_calm(draft) && j.has_phase(draft, 0.0)))
    };
    let ki = largest(0.01 * kp, 10.0 * kp, allowed)?.unwrap_or(0.0);
    let rule = format!(
        "largest with {} degrees of phase margin and the same overshoot (5.28)",
        draft.specs.attitude.phase_margin_deg
    );
    draft.found(name, Gain::Integral, ki, rule);
    Ok(())
}

#[cfg(test)]
mod tests {
    use model::Model;

    use super::*;
    use crate::loops::{GAINS, gain_of};
    use crate::plant::{Linear, TrimTarget};
    use crate::synthesis::specs::Specs;

    /// The thesis' craft: Kd is 10 in Table 5.1, where this rule takes 1.2 times the least that
    /// stabilises, and Kp and Ki keep the 45 degrees and 6 rad/s that were asked for, none to spare.
    #[test]
    fn roll_is_as_fast_as_its_specifications_allow() {
        let model = Model::thesis();
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        let (specs, config) = (Specs::thesis(), Config::thesis());
        let mut draft = Draft { model: &model, linear, specs, config, steps: Vec::new() };
        for gain in GAINS {
            draft.config = draft.with(LoopName::Roll, gain, 0.0);
        }
        attitude(&mut draft, LoopName::Roll).unwrap();
        assert!((gain_of(&draft.config, LoopName::Roll, Gain::Velocity) - 10.0).abs() < 0.2);
        let plant = draft.plant(LoopName::Roll).unwrap();
        let judged = judged(&draft.config, &plant, LoopName::Roll).unwrap().unwrap();
        let phase_deg = judged.margins.phase_margin_deg.unwrap();
        assert!(judged.is_calm(&draft) && judged.has_phase(&draft, 0.0), "{phase_deg}");
        // A per cent more of Kp breaks one of them.
        let kp = gain_of(&draft.config, LoopName::Roll, Gain::Proportional);
        let ki = gain_of(&draft.config, LoopName::Roll, Gain::Integral);
        let more = draft.with(LoopName::Roll, Gain::Integral, 1.01 * ki);
        let more = super::judged(&more, &plant, LoopName::Roll).unwrap().unwrap();
        assert!(!more.is_calm(&draft) || !more.has_phase(&draft, 0.0), "{kp} {ki}");
        let names: Vec<_> = draft.steps.iter().map(|step| step.gain).collect();
        assert_eq!(names, ["Kd", "canceller pole", "Kp", "Ki"]);
    }
}
