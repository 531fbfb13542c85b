//! Changes that happened together.

use model::{Effect, Model};
use sysid::FitError;
use sysid::prepare::Prepared;

use crate::change::{Change, places};
use crate::change_fit::{Fitted, fit_change, fit_jointly};
use crate::finding::EffectFinding;

/// A change with its evidence.
pub(crate) type Found = (Change, EffectFinding);

/// Changes that happened together, fitted one on top of the other.
#[derive(Debug, Clone)]
pub(crate) struct Together {
    /// The model without them.
    pub(crate) before: Model,
    /// The model with them.
    pub(crate) model: Model,
    /// The changes, best first.
    pub(crate) changes: Vec<Change>,
    /// What was estimated together with them.
    pub(crate) revealed: Vec<Effect>,
    /// Standard errors of their coefficients, one change after the other, where they were estimated at once.
    pub(crate) std_errors: Vec<f64>,
}

impl Together {
    /// No change.
    pub(crate) fn none(model: &Model) -> Self {
        let (before, model) = (model.clone(), model.clone());
        Self { before, model, changes: Vec::new(), revealed: Vec::new(), std_errors: Vec::new() }
    }

    /// Several, each on top of those before it.
    pub(crate) fn of(model: &Model, changes: &[Change], flights: &[&Prepared]) -> Result<Self, FitError> {
        changes.iter().try_fold(Self::none(model), |before, change| before.and(*change, flights))
    }

    /// With one more.
    pub(crate) fn and(mut self, change: Change, flights: &[&Prepared]) -> Result<Self, FitError> {
        let fitted = fit_change(&self.model, change, flights)?;
        self.model = fitted.model;
        self.changes.push(change);
        self.revealed.extend(fitted.together);
        Ok(self)
    }

    /// The changes estimated at once: one after the other, the first takes what the second explains better. Where that finds no end, they
    /// stay as they were.
    pub(crate) fn settled(self, flights: &[&Prepared]) -> Self {
        if self.changes.len() < 2 {
            return self;
        }
        match fit_jointly((&self.before, &self.model), &self.changes, flights) {
            Ok(fitted) => self.fitted_as(&fitted),
            Err(_) => self,
        }
    }

    /// As they were estimated at once.
    pub(crate) fn fitted_as(self, fitted: &Fitted) -> Self {
        let variances = fitted.covariance.diagonal();
        let std_errors = variances.iter().map(|variance| variance.max(0.0).sqrt()).collect();
        Self { model: fitted.model.clone(), std_errors, ..self }
    }

    /// Writes the sizes that the changes have together into their findings.
    pub(crate) fn write_sizes(&self, findings: &mut [Found]) {
        if self.changes.len() < 2 {
            return;
        }
        for (change, place) in places(&self.changes) {
            let Some((_, finding)) = findings.iter_mut().find(|(other, _)| *other == change) else {
                continue;
            };
            let size = change.size(&self.model, &self.before);
            for ((coefficient, size), i) in finding.coefficients.iter_mut().zip(size).zip(place) {
                coefficient.value = size;
                // By itself, a change has the scatter between flights in its errors, but not what it shares with others.
                let own = self.std_errors.get(i).copied().unwrap_or(0.0);
                coefficient.std_error = coefficient.std_error.max(own);
            }
        }
    }

    /// The model with all but the best.
    pub(crate) fn without_best(&self, model: &Model, flights: &[&Prepared]) -> Model {
        let others = self.changes.get(1..).unwrap_or_default();
        Self::of(model, others, flights).map_or_else(|_| model.clone(), |rest| rest.model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::{ALL_ROTORS, HEAVIER};
    use crate::reason::Reason;
    use crate::testing::{ORDINARY, prepared, truth};

    /// All rotors give more thrust, and the craft is heavier: by themselves, each takes the other's lift.
    #[test]
    fn changes_that_hide_each_other_have_their_sizes_at_once() {
        let mut world = truth();
        world.set(Effect::MassChange, &[0.06]);
        world.set(Effect::MotorEfficiency, &[-0.04; 4]);
        let flights = prepared(&world, 30..33, 10.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let both = [HEAVIER, ALL_ROTORS];
        let together = Together::of(&truth(), &both, &flights).unwrap().settled(&flights);
        let size = |effect| together.model.term(effect).unwrap().values();
        assert!((size(HEAVIER.effect)[0] - 0.06).abs() < 0.01, "{:?}", size(HEAVIER.effect));
        assert!(
            size(ALL_ROTORS.effect).iter().all(|loss| (loss + 0.04).abs() < 0.006),
            "{:?}",
            size(ALL_ROTORS.effect)
        );
        assert_eq!(together.std_errors.len(), 5);
        let mut findings: Vec<Found> = both
            .map(|change| (change, EffectFinding::unsupported(change.effect, 3, Reason::LikeChance)))
            .to_vec();
        let info = &HEAVIER.effect.info().coefficients[0];
        findings[0].1.coefficients = vec![crate::CoefficientFigures::new(info, 0.01, 1e-9, &truth())];
        together.write_sizes(&mut findings);
        let written = &findings[0].1.coefficients[0];
        assert_eq!((written.value, written.std_error), (size(HEAVIER.effect)[0], together.std_errors[0]));
    }
}
