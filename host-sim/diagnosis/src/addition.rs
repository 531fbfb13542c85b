//! An effect joins a model.

use model::{Effect, Model, PerAxis};
use sysid::prepare::Prepared;
use sysid::{Fit, FitError, errors};

use crate::finding::EffectFinding;
use crate::held_out::{Validated, examine, fit_and_validate};
use crate::options::Options;

/// An effect added to a model: the better model and the held-out errors without and with it.
#[derive(Debug, Clone)]
pub struct Addition {
    /// The refitted model with the effect.
    pub fit: Fit,
    /// The evidence.
    pub finding: EffectFinding,
    /// Held-out errors of the model refitted without it.
    pub before: PerAxis<f64>,
    /// Held-out errors with it.
    pub after: PerAxis<f64>,
}

/// Adds an effect to a model, refits everything on the training flights and validates it on the held-out ones. It counts as one
/// of the candidates that `options` leave.
pub fn add(
    model: &Model,
    effect: Effect,
    train: &[&Prepared],
    validate: &[&Prepared],
    options: &Options,
) -> Result<Addition, FitError> {
    let base = fit_and_validate(model, &model.effects(), train, validate)?;
    add_to(&base, effect, None, (train, validate), options)
}

/// The same beside a model that is fitted already, from values of the effect's coefficients that are known to be near.
pub(crate) fn add_to(
    base: &Validated,
    effect: Effect,
    near: Option<&[f64]>,
    (train, validate): (&[&Prepared], &[&Prepared]),
    options: &Options,
) -> Result<Addition, FitError> {
    let model = &base.fit.model;
    let mut effects = model.effects();
    effects.push(effect);
    let mut start = model.clone();
    if let Some(values) = near {
        start.set(effect, values);
    }
    let with = fit_and_validate(&start, &effects, train, validate)?;
    let candidates = options.candidates_with(effect, model);
    let finding = examine(base, &with, effect, (train, validate), candidates.len());
    let (before, after) = (errors(&base.held_out), errors(&with.held_out));
    Ok(Addition {
        fit: with.fit,
        finding,
        before: PerAxis::from_fn(|a| before[a].sse),
        after: PerAxis::from_fn(|a| after[a].sse),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    #[test]
    fn a_missing_drag_is_supported_and_a_tether_that_is_not_there_is_not() {
        let mut world = truth();
        world.set(Effect::QuadraticDrag, &[-0.25; 2]);
        let flights = prepared(&world, 20..25, 15.0, &ORDINARY);
        let all: Vec<&Prepared> = flights.iter().collect();
        let (train, validate) = all.split_at(3);
        let base = sysid::fit(train, &world.vehicle, &truth().effects(), None).unwrap().model;
        let added = add(&base, Effect::QuadraticDrag, train, validate, &Options::default()).unwrap();
        assert!(added.finding.supported, "{}", added.finding.reason);
        assert!(added.after.u < 0.9 * added.before.u, "{:?} {:?}", added.before, added.after);
        // It acts on forces alone.
        assert!((added.after.r / added.before.r - 1.0).abs() < 0.02);
        let effects = added.fit.model.effects();
        assert_eq!(effects.last(), Some(&Effect::QuadraticDrag));
        assert_eq!(effects.len(), base.effects().len() + 1);
        let none = add(&added.fit.model, Effect::Tether, train, validate, &Options::default());
        assert!(none.is_ok_and(|added| !added.finding.supported));
    }

    #[test]
    fn without_flights_to_fit_on_nothing_is_added() {
        let refused = add(&truth(), Effect::QuadraticDrag, &[], &[], &Options::default());
        assert_eq!(refused.err(), Some(FitError::NoFlights));
    }
}
