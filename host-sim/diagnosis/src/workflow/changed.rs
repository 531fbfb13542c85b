//! The model was good once: what has changed since?

use model::{Effect, Model};
use sysid::Reference;
use sysid::checks::vehicle::Likeness;

use crate::changes;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::names;
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
    flights.hold_against(model, effects, (Likeness::CHANGED, Reference::Flights), observer)?;
    let (all, mut tried) = (Change::all(model).len(), 0);
    changes::changed(model, &flights.prepared(), |step| {
        observer.progress(Progress { activity: &format!("trying {step}"), steps: Some((tried, all)) });
        tried += 1;
    })
    .map_err(|why| WorkflowError::Fit { flights: names(&flights.flights), why })
}
