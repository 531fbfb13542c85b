//! The whole loop: identify, diagnose, add what is found, until nothing that the flights support is left.

use model::{Effect, Model, PerGroup, Vehicle};
use sysid::fit::output_error::Rows;
use sysid::{Comparison, RefinementOutcome};

use crate::conclusion::{counts_in, first_of, what_is_unknown, without};
use crate::criteria::harm;
use crate::finding::EffectFinding;
use crate::observer::Observer;
use crate::reason::Reason;
use crate::unidentified::recorded;
use crate::workflow::add::join;
use crate::workflow::diagnose::search;
use crate::workflow::error::WorkflowError;
use crate::workflow::headings::warn_of_one_heading;
use crate::workflow::identify::{Rotation, fit_basic, tell_scatter, warn_of_clocks};
use crate::workflow::refinement::refine;
use crate::workflow::sets::FlightSets;
use crate::{Addition, Diagnosis, Options, Verdict};

/// Verdicts in the order in which the first that either part has is that of the loop: something left at the end comes first.
const ORDER: [Verdict; 4] =
    [Verdict::Unexplained, Verdict::MissingEffect, Verdict::NotIdentified, Verdict::Adequate];

/// One round: a diagnosis and the effect that was added after it.
pub struct Step {
    /// What was found before the effect joined.
    pub diagnosis: Diagnosis,
    /// The effect.
    pub effect: Effect,
    /// Its evidence and the errors without and with it.
    pub addition: Addition,
    /// The model with it.
    pub model: Model,
    /// The model with it against the held-out flights.
    pub comparison: Comparison,
}

/// From the basic model to one in which nothing supported is missing.
pub struct Explanation {
    /// The basic model.
    pub basic: Model,
    /// The basic model against the held-out flights.
    pub basic_comparison: Comparison,
    /// Effects in the order they were added.
    pub steps: Vec<Step>,
    /// What is found in the last model.
    pub last_diagnosis: Diagnosis,
    /// The model at the end, refined where that was asked for.
    pub model: Model,
    /// What a refinement did, where one was asked for.
    pub refinement: Option<RefinementOutcome>,
}

impl Explanation {
    /// The model at the end against the held-out flights, before any refinement.
    pub fn last_comparison(&self) -> &Comparison {
        self.steps.last().map_or(&self.basic_comparison, |step| &step.comparison)
    }

    /// The model at the end, before any refinement.
    pub fn last_model(&self) -> &Model {
        self.steps.last().map_or(&self.basic, |step| &step.model)
    }

    /// What is found in the basic model.
    pub fn first_diagnosis(&self) -> &Diagnosis {
        self.steps.first().map_or(&self.last_diagnosis, |step| &step.diagnosis)
    }

    /// What was found, in a sentence, and what was not.
    pub fn conclusion(&self) -> String {
        let found: Vec<&str> = self.found().iter().map(|e| e.id()).collect();
        match (found.as_slice(), what_is_unknown(&self.last_diagnosis.not_identified)) {
            ([], _) => format!("Found: nothing. {}", self.last_diagnosis.summary),
            (names, None) => format!("Found: {}.", names.join(", then ")),
            (names, Some(unknown)) => format!("Found: {}. {unknown}", names.join(", then ")),
        }
    }

    /// The conclusion of the whole loop: was anything missing, and is anything left?
    pub fn verdict(&self) -> Verdict {
        first_of(&ORDER, self.verdicts())
    }

    /// That of the translation and that of the rotation. What is left at the end comes before what was added, and that before
    /// what is not identified.
    pub fn verdicts(&self) -> PerGroup<Verdict> {
        let last = &self.last_diagnosis;
        let was_missing = |group| {
            self.steps.iter().any(|step| counts_in(&step.addition.finding, group, &last.not_identified))
        };
        PerGroup::from_fn(|group| match last.verdicts[group] {
            Verdict::Adequate | Verdict::NotIdentified if was_missing(group) => Verdict::MissingEffect,
            verdict => verdict,
        })
    }

    /// Effects in the order they were added.
    pub fn found(&self) -> Vec<Effect> {
        self.steps.iter().map(|step| step.effect).collect()
    }
}

/// Goes through the loop. It ends: every round adds an effect that the model does not have.
pub fn explain(
    vehicle: &Vehicle,
    effects: &[Effect],
    sets: &mut FlightSets,
    options: &Options,
    rows: Option<Rows>,
    observer: &dyn Observer,
) -> Result<Explanation, WorkflowError> {
    sets.leave_out_undefined(&Model::new(vehicle.clone()), effects, observer)?;
    let explanation = go_through(vehicle, sets, options, Rotation::Mended(options), observer)?;
    let doubted = sysid::has_rotation(explanation.last_model())
        && !sysid::rotation_doubts(explanation.last_model(), &sets.train()).is_empty();
    let mut explanation = match doubted {
        // What was to mend the rotation was not found in the end, or did not.
        true => go_through(vehicle, sets, options, Rotation::Refused, observer)?,
        false => explanation,
    };
    warn_of_clocks(sets, observer);
    warn_of_one_heading(&explanation.found(), sets, observer);
    (explanation.model, explanation.refinement) = refine(explanation.model, sets, rows, observer)?;
    let verdicts = explanation.verdicts();
    if let Some(record) = &mut explanation.model.fit {
        record.verdicts = Some(verdicts);
    }
    Ok(explanation)
}

/// The loop, with what becomes of a rotation that is in doubt. The model is not refined.
fn go_through(
    vehicle: &Vehicle,
    sets: &mut FlightSets,
    options: &Options,
    rotation: Rotation<'_>,
    observer: &dyn Observer,
) -> Result<Explanation, WorkflowError> {
    let mut basic = fit_basic(vehicle, sets, rotation, observer)?.model;
    let diagnosis = search(&basic, sets, options, observer)?;
    let (basic, basic_comparison) = sets.concealed(|sets| {
        if sets.has_weather() {
            basic = fit_basic(vehicle, sets, rotation, observer)?.model;
        }
        tell_scatter(&mut basic, sets);
        let comparison = sysid::compare(&basic, &sets.validate());
        Ok((basic, comparison))
    })?;
    let (steps, last_diagnosis) = add_what_is_found(&basic, diagnosis, sets, options, observer)?;
    let model = steps.last().map_or(&basic, |step| &step.model).clone();
    Ok(Explanation { basic, basic_comparison, steps, last_diagnosis, model, refinement: None })
}

/// Adds what a diagnosis of a model finds, one effect after the other, until nothing supported is left.
pub(crate) fn add_what_is_found(
    basic: &Model,
    mut diagnosis: Diagnosis,
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<(Vec<Step>, Diagnosis), WorkflowError> {
    let mut steps: Vec<Step> = Vec::new();
    while let Some(effect) = diagnosis.best() {
        let model = steps.last().map_or(basic, |step| &step.model).clone();
        match join_and_search(&model, effect, sets, options, observer) {
            Ok((Joined { model: better, addition, comparison }, next)) => {
                // Nothing joins that makes the model predict worse, whatever it promised beside others.
                if let Some(why) = makes_worse(&addition.finding) {
                    sets.go_back_to(&model);
                    diagnosis = without(&diagnosis, effect, &why, recorded(&model));
                    continue;
                }
                sets.judge_clocks(&better, effect);
                let before = std::mem::replace(&mut diagnosis, next);
                steps.push(Step { diagnosis: before, effect, addition, model: better, comparison });
            }
            // What cannot be fitted takes no answer away from the others.
            Err(WorkflowError::Fit { why, .. }) => {
                sets.go_back_to(&model);
                diagnosis = without(&diagnosis, effect, &Reason::NotFittedTogether(why), recorded(&model));
            }
            Err(why) => return Err(why),
        }
    }
    Ok((steps, diagnosis))
}

/// Why a model is worse with an effect; nothing where it is not.
fn makes_worse(finding: &EffectFinding) -> Option<Reason> {
    let [improved, flights] = finding.flights_improved;
    let worse = (finding.drop_percent < 0.0).then_some(Reason::MakesWorse { improved, flights });
    worse.or_else(|| harm(finding))
}

/// A model that an effect joined.
struct Joined {
    model: Model,
    addition: Addition,
    comparison: Comparison,
}

/// Adds an effect to a model and diagnoses the better one.
fn join_and_search(
    model: &Model,
    effect: Effect,
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<(Joined, Diagnosis), WorkflowError> {
    let (mut better, addition) = join(model, effect, sets, options, observer)?;
    let had_weather = sets.has_weather();
    let next = search(&better, sets, options, observer)?;
    let (model, comparison) = sets.concealed(|sets| {
        if sets.has_weather() && !had_weather {
            let again = sysid::fit(&sets.train(), &better.vehicle, &better.effects(), Some(&better));
            better = fitted_again(&better, again.map_err(|why| sets.blame(why))?.model, sets);
        }
        let comparison = sysid::compare(&better, &sets.validate());
        Ok((better, comparison))
    })?;
    Ok((Joined { model, addition, comparison }, next))
}

/// A model as it was fitted again, in other winds.
fn fitted_again(model: &Model, again: Model, sets: &FlightSets) -> Model {
    let fit = Some(sets.record_after(model, &again));
    Model { fit, history: model.history.clone(), ..again }
}

#[cfg(test)]
mod tests {
    use model::{Group, NotIdentified};

    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    fn diagnosis(verdict: Verdict, summary: &str) -> Diagnosis {
        Diagnosis {
            verdict,
            verdicts: PerGroup { translation: verdict, rotation: Verdict::Adequate },
            summary: summary.into(),
            effects: Vec::new(),
            unexplained: Vec::new(),
            not_identified: Vec::new(),
            since: None,
        }
    }

    fn explanation(steps: Vec<Step>, last: Verdict) -> Explanation {
        Explanation {
            basic: truth(),
            basic_comparison: sysid::compare(&truth(), &[]),
            steps,
            last_diagnosis: diagnosis(last, "Nothing is left."),
            model: truth(),
            refinement: None,
        }
    }

    fn step(effect: Effect) -> Step {
        let flights = prepared(&truth(), 1..3, 4.0, &ORDINARY);
        let [train, validate] = [[&flights[0]], [&flights[1]]];
        let mut addition = crate::add(&truth(), effect, &train, &validate, &Options::default()).unwrap();
        // As if the flights showed it.
        addition
            .finding
            .axes
            .insert("u", crate::AxisDrop { sse_before: 4.0, sse_after: 1.0, drop_percent: 75.0 });
        let mut model = truth();
        model.set(effect, &vec![0.0; effect.info().coefficients.len()]);
        let comparison = sysid::compare(&model, &[]);
        Step { diagnosis: diagnosis(Verdict::MissingEffect, "first"), effect, addition, model, comparison }
    }

    #[test]
    fn where_nothing_was_found_the_basic_model_and_the_last_diagnosis_stand() {
        for verdict in [Verdict::Adequate, Verdict::Unexplained] {
            let explanation = explanation(Vec::new(), verdict);
            assert_eq!(explanation.verdict(), verdict);
            assert_eq!(explanation.conclusion(), "Found: nothing. Nothing is left.");
            assert_eq!(explanation.last_model(), &explanation.basic);
            assert_eq!(explanation.first_diagnosis(), &explanation.last_diagnosis);
        }
    }

    #[test]
    fn what_was_added_is_named_in_its_order_and_counts_unless_something_is_left() {
        let steps = || vec![step(Effect::QuadraticDrag), step(Effect::SteadyWind)];
        let complete = explanation(steps(), Verdict::Adequate);
        assert_eq!(complete.verdict(), Verdict::MissingEffect);
        assert_eq!(complete.conclusion(), "Found: quadratic-drag, then steady-wind.");
        assert!(complete.last_model().has(Effect::SteadyWind));
        assert_eq!(complete.first_diagnosis().summary, "first");
        assert_eq!(explanation(steps(), Verdict::Unexplained).verdict(), Verdict::Unexplained);
    }

    #[test]
    fn what_is_not_identified_is_told_after_what_was_found_and_stands_behind_it() {
        let unknown = NotIdentified::of_group(Group::Rotation, "clocks drift".into(), "fly more");
        let with = |steps: Vec<Step>| {
            let mut explanation = explanation(steps, Verdict::NotIdentified);
            let last = &mut explanation.last_diagnosis;
            last.verdicts = PerGroup { translation: Verdict::Adequate, rotation: Verdict::NotIdentified };
            last.not_identified = vec![unknown.clone()];
            explanation
        };
        assert_eq!(with(Vec::new()).verdict(), Verdict::NotIdentified);
        let found = with(vec![step(Effect::QuadraticDrag)]);
        assert_eq!(found.verdict(), Verdict::MissingEffect);
        assert_eq!(found.verdicts().rotation, Verdict::NotIdentified);
        assert_eq!(
            found.conclusion(),
            "Found: quadratic-drag. The rotation is not identified by these flights: clocks drift. To determine it: fly more."
        );
    }
}
