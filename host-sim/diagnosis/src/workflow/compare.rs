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
    // Offsets of flights of commands are counted from what the training flights had in common.
    let delay_s = model.fit.as_ref().and_then(|fit| fit.rotor_delay_s);
    flights.hold_against(model, &[], (Likeness::SAME, Reference::Model(delay_s)), observer)?;
    observer.progress(Progress { activity: "predicting", steps: None });
    Ok(sysid::compare(model, &flights.prepared()))
}
