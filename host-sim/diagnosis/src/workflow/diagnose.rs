//! Which physical effect is missing from a model? And why, or why not, one of them?

use model::{Effect, Model};

use crate::observer::Observer;
use crate::workflow::error::WorkflowError;
use crate::workflow::sets::FlightSets;
use crate::{Diagnosis, Options, SearchError, Why, WhyError, diagnose_with};

/// Diagnoses a model on flights; `effects` are users' own that may join it.
pub fn diagnose(
    model: &Model,
    effects: &[Effect],
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    sets.hold_against(model, effects, observer)?;
    search(model, sets, options, observer)
}

/// The evidence for and against one effect, missing from the model or in it.
pub fn why(
    model: &Model,
    effect: Effect,
    effects: &[Effect],
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Why, WorkflowError> {
    sets.hold_against(model, effects, observer)?;
    crate::why(model, effect, &sets.train(), &sets.validate(), options, observer).map_err(|refused| {
        match refused {
            WhyError::Search(why) => blamed(sets, why),
            other => WorkflowError::Why(other),
        }
    })
}

/// Diagnoses on flights whose clocks and trim are set.
pub(crate) fn search(
    model: &Model,
    sets: &FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    diagnose_with(model, &sets.train(), &sets.validate(), options, observer).map_err(|why| blamed(sets, why))
}

fn blamed(sets: &FlightSets, why: SearchError) -> WorkflowError {
    match why {
        SearchError::Fit(why) => sets.blame(why),
        SearchError::Cancelled => WorkflowError::Cancelled,
    }
}
