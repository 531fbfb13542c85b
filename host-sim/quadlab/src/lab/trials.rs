//! Models with one effect more that are only looked at: in memory alone, and in no list.

use std::sync::Arc;

use model::{Effect, Model};

/// What sees a flight: a model, or the trial of that number of it.
pub(super) type Eye = (u32, Option<u64>);

/// A model with an effect that it did not have.
#[derive(Clone)]
pub(super) struct Trial {
    /// No other one has had it, so that what is made of a trial is never taken for that of a later one.
    pub(super) number: u64,
    /// The model without the effect.
    model: u32,
    effect: Effect,
    pub(super) with: Arc<Model>,
}

/// The trials of the flights, their uses and the effects as they are now.
#[derive(Default)]
pub(super) struct Trials {
    made: Vec<Trial>,
    /// Numbers given so far.
    numbers: u64,
    /// How often all was forgotten.
    pub(super) forgotten: u64,
}

impl Trials {
    /// Forgets what was fitted to flights, or with effects, that are others now.
    pub(super) fn forget(&mut self) {
        self.made.clear();
        self.forgotten += 1;
    }

    /// That of an effect, if it was made.
    pub(super) fn of(&self, model: u32, effect: Effect) -> Option<Trial> {
        self.made.iter().find(|trial| trial.model == model && trial.effect == effect).cloned()
    }

    /// Takes a new one.
    pub(super) fn keep(&mut self, model: u32, effect: Effect, with: Model) -> Trial {
        self.numbers += 1;
        let trial = Trial { number: self.numbers, model, effect, with: Arc::new(with) };
        self.made.push(trial.clone());
        trial
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_is_forgotten_with_what_it_was_fitted_to() {
        let mut trials = Trials::default();
        let first = trials.keep(1, Effect::SteadyWind, Model::thesis());
        assert_eq!(trials.of(1, Effect::SteadyWind).map(|trial| trial.number), Some(first.number));
        assert!(trials.of(2, Effect::SteadyWind).is_none() && trials.of(1, Effect::GroundEffect).is_none());
        trials.forget();
        assert!(trials.of(1, Effect::SteadyWind).is_none());
        // What was made of the first is not taken for that of the next.
        assert_ne!(trials.keep(1, Effect::SteadyWind, Model::thesis()).number, first.number);
    }
}
