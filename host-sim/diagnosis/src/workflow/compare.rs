//! A model against flights, and where it fails.

use model::Model;
use sysid::checks::vehicle::Likeness;
use sysid::{Comparison, Reference};

use crate::observer::{Observer, Progress};
use crate::workflow::error::WorkflowError;
use crate::workflow::sets::FlightsOfOneKind;

/// Holds a model against flights.
pub fn compare(
    model: &Model,
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<Comparison, WorkflowError> {
    line_up(model, flights, observer)?;
    observer.progress(Progress { activity: "predicting", steps: None });
    Ok(sysid::compare(model, &flights.prepared()))
}

/// Checks flights against a model and sets their clocks and trim, so that its residuals can be looked at.
pub fn line_up(
    model: &Model,
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<(), WorkflowError> {
    flights.recall_weather(model);
    // Offsets of flights of commands are counted from what the training flights had in common.
    let delay_s = model.fit.as_ref().and_then(|fit| fit.rotor_delay_s);
    flights.hold_against(model, &[], (Likeness::SAME, Reference::Model(delay_s)), observer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};
    use crate::workflow::{Reading, Silent};

    #[test]
    fn the_true_model_explains_flights_without_noise() {
        let flights = [1, 2].map(|seed| fly(&truth(), seed, 6.0, &NONE));
        let vehicle = truth().vehicle;
        let mut held =
            FlightsOfOneKind::from_flights(&flights, &vehicle, Reading::default(), &Silent).unwrap();
        let comparison = compare(&truth(), &mut held, &Silent).unwrap();
        assert_eq!(comparison.flights.len(), 2);
        for axis in model::AXES {
            assert!(comparison.total[axis].r2 > 0.95, "{axis}: {:?}", comparison.total[axis]);
        }
    }
}
