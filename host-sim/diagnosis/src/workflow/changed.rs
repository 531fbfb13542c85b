//! The model was good once: what has changed since? And why, or why not, one change?

use model::{Effect, Model};
use sysid::Reference;
use sysid::checks::vehicle::Likeness;

use crate::observer::Observer;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::names;
use crate::workflow::sets::FlightsOfOneKind;
use crate::{Diagnosis, Options, WhyChanged, changes, why_changed};

/// Explains new flights by one change of a model whose coefficients stay.
pub fn changed(
    model: &Model,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    hold_against(model, effects, flights, observer)?;
    let tried = options.changes(model);
    changes::changed(model, &tried, &flights.prepared(), observer)
        .map_err(|why| WorkflowError::of_search(why, names(&flights.flights)))
}

/// The evidence for and against the changes that one effect can be.
pub fn changed_why(
    model: &Model,
    effect: Effect,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    options: &Options,
    observer: &dyn Observer,
) -> Result<WhyChanged, WorkflowError> {
    hold_against(model, effects, flights, observer)?;
    why_changed(model, effect, &flights.prepared(), options, observer)
        .map_err(|why| WorkflowError::of_why(why, names(&flights.flights)))
}

fn hold_against(
    model: &Model,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<(), WorkflowError> {
    flights.hold_against(model, effects, (Likeness::CHANGED, Reference::Flights), observer)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::change::Change;
    use crate::observer::Progress;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::Reading;

    #[derive(Default)]
    struct Counting(Mutex<Vec<(usize, usize)>>);

    impl Observer for Counting {
        fn progress(&self, progress: Progress<'_>) {
            if progress.activity.starts_with("trying ") {
                self.0.lock().unwrap().extend(progress.steps);
            }
        }
    }

    #[test]
    fn a_heavier_craft_is_named_after_every_change_was_tried_once() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        let flights = [1, 2].map(|seed| fly(&heavy, seed, 8.0, &ORDINARY));
        let counting = Counting::default();
        let mut held =
            FlightsOfOneKind::from_flights(&flights, &heavy.vehicle, Reading::default(), &counting).unwrap();
        let diagnosis = changed(&truth(), &[], &mut held, &Options::default(), &counting).unwrap();
        assert_eq!(diagnosis.best(), Some(Effect::MassChange), "{}", diagnosis.summary);
        let count = Change::all(&truth()).len();
        let tried: Vec<(usize, usize)> = (0..count).map(|k| (k, count)).collect();
        assert_eq!(counting.0.into_inner().unwrap(), tried);
    }
}
