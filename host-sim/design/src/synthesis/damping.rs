//! Why no proportional gain serves: the loop is never stable, never damped enough, or never slow
//! enough.

use super::draft::Draft;
use super::judging::{at_error, seen_overshoot, unstable};
use super::scan::greatest;
use super::shortfall::unmet;
use crate::error::{Criterion, DesignError, Result};
use crate::loops::{ClosedLoop, Gain, LoopName, LoopPlant, View};

/// The error of a loop that no proportional gain makes stable, damped and slow enough, with what is
/// reached at best. `unit` is the unit of the gain, and `wanted` the greatest overshoot by damping,
/// per cent.
///
/// # Errors
/// A loop that cannot be analysed.
pub(super) fn undamped(
    draft: &Draft,
    name: LoopName,
    plant: &LoopPlant,
    wanted: f64,
    unit: f64,
) -> Result<DesignError> {
    let close =
        |kp: f64| ClosedLoop::new(&draft.with(name, Gain::Proportional, kp), plant, name, View::Continuous);
    let (low, high) = (0.05 * unit, 2000.0 * unit);
    let least_overshoot = greatest(low, high, |kp| Ok(seen_overshoot(&close(kp)?)?.map(|percent| -percent)))?;
    if let Some((_, percent)) = least_overshoot {
        if -percent > wanted {
            return Ok(DesignError::Unmet(unmet(name, Criterion::OvershootByDamping, wanted, -percent)));
        }
        let slow = |kp: f64| -> Result<Option<f64>> {
            let closed = close(kp)?;
            match seen_overshoot(&closed)? {
                Some(percent) if percent <= wanted => Ok(at_error(&closed)?.crossover_rad_s.map(|w| -w)),
                _ => Ok(None),
            }
        };
        let least = greatest(low, high, slow)?.map_or(f64::NAN, |(_, crossover)| -crossover);
        let most = draft.specs.attitude.crossover_rad_s;
        return Ok(DesignError::Unmet(unmet(name, Criterion::Crossover, most, least)));
    }
    let decay = |kp: f64| Ok(close(kp)?.closed.poles()?.first().map(|p| -p.re));
    let at_best = greatest(low, high, decay)?.map(|(_, decay)| -decay);
    Ok(unstable(name, Criterion::ProportionalLoopGrowth, at_best))
}

#[cfg(test)]
mod tests {
    use control::Config;
    use model::Model;

    use super::*;
    use crate::plant::{Linear, TrimTarget};
    use crate::synthesis::specs::Specs;

    /// Without velocity feedback the thesis' roll grows whatever Kp is, (5.20); with it, an overshoot
    /// below nothing cannot be had.
    #[test]
    fn the_first_thing_that_fails_is_named() {
        let model = Model::thesis();
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        let (specs, config) = (Specs::thesis(), Config::thesis());
        let mut draft = Draft { model: &model, linear, specs, config, steps: Vec::new() };
        draft.config = draft.with(LoopName::Roll, Gain::Integral, 0.0);
        let plant = draft.plant(LoopName::Roll).unwrap();
        let failed = |draft: &Draft, wanted: f64| match undamped(draft, LoopName::Roll, &plant, wanted, 1.0)
            .unwrap()
        {
            DesignError::Unmet(shortfall) => (shortfall.what, shortfall.reached),
            other => panic!("{other}"),
        };
        let (what, reached) = failed(&draft, -1.0);
        assert!(what == Criterion::OvershootByDamping && reached >= 0.0, "{what:?} {reached}");
        draft.config = draft.with(LoopName::Roll, Gain::Velocity, 0.0);
        let (what, growth) = failed(&draft, 35.0);
        assert!(what == Criterion::ProportionalLoopGrowth && growth > 0.0, "{what:?} {growth}");
    }
}
