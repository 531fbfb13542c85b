//! An effect joins a model, and everything is fitted again.

use model::{Effect, HistoryEntry, Model};
use sysid::RefinementOutcome;
use sysid::fit::output_error::Rows;

use crate::addition::add_to;
use crate::held_out::fit_and_validate;
use crate::observer::{Observer, Progress};
use crate::workflow::error::WorkflowError;
use crate::workflow::headings::warn_of_one_heading;
use crate::workflow::refinement::refine;
use crate::workflow::sets::FlightSets;
use crate::{Addition, Options};

/// A model with one more effect.
pub struct Added {
    /// The model, its fit record and history brought up to date.
    pub model: Model,
    /// The evidence, and the errors without and with the effect.
    pub addition: Addition,
    /// What a refinement did, where one was asked for.
    pub refinement: Option<RefinementOutcome>,
}

/// Adds `effect` to `model`, whether the flights support it or not.
pub fn add(
    model: &Model,
    effect: Effect,
    sets: &mut FlightSets,
    rows: Option<Rows>,
    observer: &dyn Observer,
) -> Result<Added, WorkflowError> {
    sets.hold_against(model, &[effect], observer)?;
    let (better, addition) = join(model, effect, sets, &Options::default(), observer)?;
    if addition.finding.supported {
        sets.judge_clocks(&better, effect);
        warn_of_one_heading(&[effect], sets, observer);
    }
    let (mut model, refinement) = refine(better, sets, rows, observer)?;
    sets.record_for_changes(&mut model);
    Ok(Added { model, addition, refinement })
}

/// The model with `effect`, on flights whose clocks and trim are set. Winds that the flights have of their own are found anew about it.
pub(crate) fn join(
    model: &Model,
    effect: Effect,
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<(Model, Addition), WorkflowError> {
    if observer.is_cancelled() {
        return Err(WorkflowError::Cancelled);
    }
    observer.progress(Progress { activity: &format!("adding {effect}"), steps: None });
    let mut with = model.clone();
    with.set(effect, &vec![0.0; effect.info().coefficients.len()]);
    sets.trim(&with);
    let addition = added(model, effect, sets, options)?;
    let better = addition.fit.model.clone();
    let mut better = sets.follow_weather(&better).unwrap_or(better);
    better.fit = Some(sets.record_after(model, &better));
    better.history.clone_from(&model.history);
    better.history.push(HistoryEntry {
        effect: effect.id().into(),
        supported: addition.finding.supported,
        sse_before: addition.before,
        sse_after: addition.after,
    });
    Ok((better, addition))
}

/// The model with `effect`, held against the model without it: each in the winds that belong to it.
fn added(
    model: &Model,
    effect: Effect,
    sets: &mut FlightSets,
    options: &Options,
) -> Result<Addition, WorkflowError> {
    if sets.revealed_as(effect).is_none() {
        sets.conceal();
    }
    let base = sets.concealed(|sets| {
        let base = fit_and_validate(model, &model.effects(), &sets.train(), &sets.validate());
        base.map_err(|why| sets.blame(why))
    })?;
    let flights = (&sets.train()[..], &sets.validate()[..]);
    let mut addition = add_to(&base, effect, None, flights, options).map_err(|why| sets.blame(why))?;
    if let Some(finding) = sets.revealed_as(effect) {
        addition.finding = finding.clone();
    }
    Ok(addition)
}

#[cfg(test)]
mod tests {
    use model::FitRecord;

    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent};

    #[test]
    fn an_effect_joins_the_model_and_its_history_whether_it_is_there_or_not() {
        let mut world = truth();
        world.set(Effect::MassChange, &[0.2]);
        let flown = |seed| fly(&world, seed, 8.0, &ORDINARY);
        let (train, validate) = ([flown(1), flown(2)], [flown(3), flown(4)]);
        let vehicle = truth().vehicle;
        let mut sets =
            FlightSets::from_flights(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap();
        let mut model = truth();
        model.fit = Some(FitRecord { rotation_refused: vec!["kept".into()], ..FitRecord::default() });
        let added = add(&model, Effect::QuadraticYawDamping, &mut sets, None, &Silent).unwrap();
        assert!(added.model.has(Effect::QuadraticYawDamping) && added.refinement.is_none());
        let [entry] = &added.model.history[..] else { panic!("one effect has joined") };
        assert_eq!(entry.effect, "quadratic-yaw-damping");
        assert_eq!(entry.supported, added.addition.finding.supported);
        assert_eq!((entry.sse_before, entry.sse_after), (added.addition.before, added.addition.after));
        let record = added.model.fit.unwrap();
        assert_eq!(record.rotation_refused, ["kept"]);
        assert!(!record.scatter.is_empty(), "new flights can be held against it");
    }
}
