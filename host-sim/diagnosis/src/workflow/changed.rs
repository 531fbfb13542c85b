//! The model was good once: what has changed since? And why, or why not, one change?

use model::{Effect, Model};
use sysid::checks::vehicle::Likeness;
use sysid::{FitError, Reference};

use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::names;
use crate::workflow::observer::{Observer, Progress};
use crate::workflow::sets::FlightsOfOneKind;
use crate::{Change, Diagnosis, Options, WhyChanged, WhyError, changes, why_changed};

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
    changes::changed(model, &tried, &flights.prepared(), steps(tried.len(), observer))
        .map_err(|why| blamed(flights, why))
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
    let tried = options.changes_with(effect, model).len();
    why_changed(model, effect, &flights.prepared(), options, steps(tried, observer)).map_err(|refused| {
        match refused {
            WhyError::Fit(why) => blamed(flights, why),
            other => WorkflowError::Why(other),
        }
    })
}

fn hold_against(
    model: &Model,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<(), WorkflowError> {
    flights.hold_against(model, effects, (Likeness::CHANGED, Reference::Flights), observer)
}

/// Tells the observer which of so many changes is tried.
fn steps(all: usize, observer: &dyn Observer) -> impl FnMut(&Change) {
    let mut tried = 0;
    move |change| {
        observer.progress(Progress { activity: &format!("trying {change}"), steps: Some((tried, all)) });
        tried += 1;
    }
}

fn blamed(flights: &FlightsOfOneKind, why: FitError) -> WorkflowError {
    WorkflowError::Fit { flights: names(&flights.flights), why }
}
