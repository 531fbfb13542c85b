//! The model was good once: what has changed since?

use model::{Effect, Model};
use sysid::Reference;
use sysid::checks::vehicle::Likeness;

use crate::changes;
use crate::workflow::corrections::align_to;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::{LoadedFlight, names};
use crate::workflow::observer::{Observer, Progress};
use crate::workflow::sets::FlightsOfOneKind;
use crate::{Change, Diagnosis};

/// Explains new flights by one change of a model whose coefficients stay.
pub fn changed(
    model: &Model,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    flights.leave_out_undefined(model, effects, observer)?;
    flights.faults.add_of_fitted(model, &flights.flights);
    let all: Vec<&LoadedFlight> = flights.flights.iter().collect();
    flights.faults.add_of_likeness(model, &all, Likeness::CHANGED);
    align_to(&mut flights.flights, model, Reference::Flights);
    let (all, mut tried) = (Change::all(model).len(), 0);
    changes::changed(model, &flights.prepared(), |step| {
        observer.progress(Progress { activity: &format!("trying {step}"), steps: Some((tried, all)) });
        tried += 1;
    })
    .map_err(|why| WorkflowError::Fit { flights: names(&flights.flights), why })
}
