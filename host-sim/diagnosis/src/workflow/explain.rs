//! The whole loop: identify, diagnose, add what is found, until nothing that the flights support is left.
//!
//! What was found first need not be the cause: it may have stood for what is found next. So with each effect that joins, those before it
//! are asked again, as if they were to be added now, and what is worth nothing any more is taken out.

use std::fmt;

use model::{Effect, GROUPS, Model, NotIdentified, PerGroup, Vehicle};
use sysid::fit::output_error::Rows;
use sysid::{Comparison, RefinementOutcome, RotorComparison};

use crate::conclusion::{NOT_YET, counts_in, first_of, what_is_unknown, without};
use crate::criteria::harm;
use crate::finding::EffectFinding;
use crate::observer::{Observer, Once};
use crate::reason::Reason;
use crate::unidentified::recorded;
use crate::workflow::add::join;
use crate::workflow::diagnose::search;
use crate::workflow::error::WorkflowError;
use crate::workflow::headings::warn_of_one_heading;
use crate::workflow::identify::{Rotation, fit_basic, tell_doubts, warn_of_clocks};
use crate::workflow::refinement::refine;
use crate::workflow::sets::FlightSets;
use crate::workflow::unlike_rotors::unlike_rotors;
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

/// An effect that joined the model, and is worth nothing since another did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TakenOut {
    /// The effect.
    pub effect: Effect,
    /// The one that made it superfluous.
    pub by: Effect,
}

/// For people: "wind-shear was added first and taken out again: it adds nothing once steady-wind is in the model".
impl fmt::Display for TakenOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { effect, by } = self;
        write!(f, "{effect} was added first and taken out again: it adds nothing once {by} is in the model")
    }
}

/// From the basic model to one in which nothing supported is missing.
pub struct Explanation {
    /// The basic model.
    pub basic: Model,
    /// The basic model against the held-out flights.
    pub basic_comparison: Comparison,
    /// Effects in the order they were added, without those that were taken out again.
    pub steps: Vec<Step>,
    /// Effects that were taken out again.
    pub taken_out: Vec<TakenOut>,
    /// What is found in the last model.
    pub last_diagnosis: Diagnosis,
    /// The model at the end, refined where that was asked for.
    pub model: Model,
    /// What a refinement did, where one was asked for.
    pub refinement: Option<RefinementOutcome>,
    /// The rotors against each other, where the last model tells: what is unlike in all flights is in its coefficients.
    pub rotors: Option<RotorComparison>,
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

    /// The models on the way to that at the end. One that is kept as well needs [`record_for_changes`](FlightSets::record_for_changes) before new
    /// flights are held against it.
    pub fn on_the_way_mut(&mut self) -> impl Iterator<Item = &mut Model> {
        let on_the_way = self.steps.len() + usize::from(self.refinement.is_some());
        let steps = self.steps.iter_mut().map(|step| &mut step.model);
        std::iter::once(&mut self.basic).chain(steps).take(on_the_way)
    }

    /// What is found in the basic model.
    pub fn first_diagnosis(&self) -> &Diagnosis {
        self.steps.first().map_or(&self.last_diagnosis, |step| &step.diagnosis)
    }

    /// What was found, in a sentence, and what was not.
    pub fn conclusion(&self) -> String {
        let (added, found): (Vec<&Step>, Vec<&Step>) =
            self.steps.iter().partition(|step| self.is_in_vain(step));
        let alike: String = found.iter().map(|step| step.addition.finding.late_attitude()).collect();
        let found: Vec<&str> = found.iter().map(|step| step.effect.id()).collect();
        let taken_out: String = self.taken_out.iter().map(|taken| format!(" {taken}.")).collect();
        let conclusion = match (found.as_slice(), what_is_unknown(&self.last_diagnosis.not_identified)) {
            ([], _) => format!("Found: nothing. {}", self.last_diagnosis.summary),
            (names, None) => format!("Found: {}.", names.join(", then ")),
            (names, Some(unknown)) => format!("Found: {}. {unknown}", names.join(", then ")),
        };
        let (nothing, rotation) = (found.is_empty(), self.verdicts().rotation);
        let unlike = unlike_rotors(self.rotors.as_ref(), rotation, nothing);
        conclusion + &alike + &added_in_vain(&added) + &taken_out + &unlike
    }

    /// Whether the flights do not determine the axes on which an effect was found, even with it.
    fn is_in_vain(&self, step: &Step) -> bool {
        let counts = |unknown: &[NotIdentified]| {
            GROUPS.iter().any(|group| counts_in(&step.addition.finding, *group, unknown))
        };
        counts(&[]) && !counts(&self.last_diagnosis.not_identified)
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

/// " steady-wind was added to the model, but ..."
fn added_in_vain(steps: &[&Step]) -> String {
    let names: Vec<&str> = steps.iter().map(|step| step.effect.id()).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!(" {one} was added to the model, but {NOT_YET}."),
        all => format!(
            " {} were added to the model, but the axes they act on are still not identified: these are not yet findings.",
            all.join(" and ")
        ),
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
    // The basic model is fitted again in other winds, with the same doubts.
    let observer = &Once::new(observer);
    sets.leave_out_undefined(&Model::new(vehicle.clone()), effects, observer)?;
    let explanation = go_through(vehicle, sets, options, Rotation::Mended(options), observer)?;
    let doubted = sysid::has_rotation(explanation.last_model())
        && !sysid::rotation_doubts(explanation.last_model(), &sets.train()).is_empty();
    let mut explanation = match doubted {
        // What was to mend the rotation was not found in the end, or did not.
        true => go_through(vehicle, sets, options, Rotation::Refused, observer)?,
        false => explanation,
    };
    tell_doubts(explanation.last_model(), sets, observer);
    if let Some(loaded) = explanation.last_diagnosis.with_refused_load(explanation.last_model()) {
        sets.add_wide_swings(&loaded);
    }
    warn_of_clocks(sets, observer);
    warn_of_one_heading(&explanation.found(), sets, observer);
    (explanation.model, explanation.refinement) =
        refine(explanation.last_model().clone(), sets, rows, observer)?;
    sets.record_for_changes(&mut explanation.model);
    if explanation.refinement.is_none() {
        let last = explanation.steps.last_mut().map_or(&mut explanation.basic, |step| &mut step.model);
        last.clone_from(&explanation.model);
    }
    explanation.rotors = sets.compare_rotors(explanation.last_model());
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
    let fitted = fit_basic(vehicle, sets, rotation, observer)?.model;
    let diagnosis = search(&fitted, sets, options, observer)?;
    let basic_of = |fitted: Model, sets: &mut FlightSets| {
        sets.concealed(|sets| {
            let again =
                sets.has_weather().then(|| fit_basic(vehicle, sets, rotation, observer)).transpose()?;
            let basic = again.map_or(fitted, |basic| basic.model);
            let comparison = sysid::compare(&basic, &sets.validate());
            Ok((basic, comparison))
        })
    };
    let had_weather = sets.has_weather();
    let (first, first_comparison) = basic_of(fitted, sets)?;
    let Added { steps, taken_out, last_diagnosis } =
        add_what_is_found(&first, diagnosis, sets, options, observer)?;
    let (basic, basic_comparison) = match sets.has_weather() && !had_weather {
        // What winds explain that were found later is no merit of the effects before.
        true => basic_of(first, sets)?,
        false => (first, first_comparison),
    };
    let model = steps.last().map_or(&basic, |step| &step.model).clone();
    Ok(Explanation {
        basic,
        basic_comparison,
        steps,
        taken_out,
        last_diagnosis,
        model,
        refinement: None,
        rotors: None,
    })
}

/// What was added.
pub(crate) struct Added {
    /// In order, without what was taken out again.
    pub(crate) steps: Vec<Step>,
    pub(crate) taken_out: Vec<TakenOut>,
    /// What is found in the last model.
    pub(crate) last_diagnosis: Diagnosis,
}

/// Adds what a diagnosis of a model finds, one effect after the other, until nothing supported is left. It ends: what was taken out does
/// not come back.
pub(crate) fn add_what_is_found(
    basic: &Model,
    first: Diagnosis,
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Added, WorkflowError> {
    let in_weather = sets.has_weather();
    let mut adding =
        Adding { basic, steps: Vec::new(), in_weather, diagnosis: first, sets, options, observer };
    let mut taken_out: Vec<TakenOut> = Vec::new();
    while let Some(effect) = adding.diagnosis.best() {
        if let Some(TakenOut { by, .. }) = taken_out.iter().find(|taken| taken.effect == effect) {
            adding.refuse(effect, &Reason::AddsNothing { beside: vec![*by] });
            continue;
        }
        adding.add(effect)?;
        while let Some(superfluous) = adding.superfluous() {
            adding.take_out(superfluous)?;
            taken_out.push(TakenOut { effect: superfluous, by: effect });
        }
    }
    Ok(Added { steps: adding.steps, taken_out, last_diagnosis: adding.diagnosis })
}

/// The loop on its way.
struct Adding<'a> {
    basic: &'a Model,
    steps: Vec<Step>,
    /// The steps are compared in winds of the flights' own.
    in_weather: bool,
    /// What is found in the model so far.
    diagnosis: Diagnosis,
    sets: &'a mut FlightSets,
    options: &'a Options,
    observer: &'a dyn Observer,
}

impl Adding<'_> {
    fn model(&self) -> &Model {
        self.steps.last().map_or(self.basic, |step| &step.model)
    }

    /// Adds an effect that was found, or says why not.
    fn add(&mut self, effect: Effect) -> Result<(), WorkflowError> {
        let model = self.model().clone();
        match join_and_search(&model, effect, self.sets, self.options, self.observer) {
            Ok((Joined { model: better, addition, comparison }, next)) => {
                // Nothing joins that makes the model predict worse, whatever it promised beside others.
                if let Some(why) = makes_worse(&addition.finding) {
                    self.sets.go_back_to(&model);
                    self.refuse(effect, &why);
                    return Ok(());
                }
                self.sets.judge_clocks(&better, effect);
                self.compare_in_weather()?;
                let diagnosis = std::mem::replace(&mut self.diagnosis, next);
                self.steps.push(Step { diagnosis, effect, addition, model: better, comparison });
            }
            // What cannot be fitted takes no answer away from the others.
            Err(WorkflowError::Fit { why, .. }) => {
                self.sets.go_back_to(&model);
                self.refuse(effect, &Reason::NotFittedTogether(why));
            }
            Err(why) => return Err(why),
        }
        Ok(())
    }

    /// What winds explain that have just been found is no merit of the steps before.
    fn compare_in_weather(&mut self) -> Result<(), WorkflowError> {
        if self.in_weather || !self.sets.has_weather() {
            return Ok(());
        }
        self.in_weather = true;
        for step in &mut self.steps {
            (step.model, step.comparison) = self.sets.concealed(|sets| {
                let model = fit_again(&step.model, sets)?;
                let comparison = sysid::compare(&model, &sets.validate());
                Ok((model, comparison))
            })?;
        }
        Ok(())
    }

    fn refuse(&mut self, effect: Effect, why: &Reason) {
        self.diagnosis = without(&self.diagnosis, effect, why, recorded(self.model()));
    }

    /// An effect that was worth adding when it joined, and is not beside those that came later.
    fn superfluous(&self) -> Option<Effect> {
        let before_last = self.steps.len().checked_sub(1)?;
        let once_supported = self.steps[..before_last].iter().filter(|step| step.addition.finding.supported);
        let is_none = |effect: &Effect| {
            // An effect that the flights' own winds stand for is no matter of a fit.
            self.sets.revealed_as(*effect).is_none()
                && is_worth_nothing(self.model(), *effect, self.sets, self.options)
        };
        once_supported.map(|step| step.effect).find(is_none)
    }

    /// Goes back to the basic model and adds the others again.
    fn take_out(&mut self, effect: Effect) -> Result<(), WorkflowError> {
        let steps = std::mem::take(&mut self.steps);
        let others: Vec<Effect> = steps.iter().map(|step| step.effect).filter(|e| *e != effect).collect();
        if let Some(first) = steps.into_iter().next() {
            self.diagnosis = first.diagnosis;
        }
        self.sets.go_back_to(self.basic);
        others.into_iter().try_for_each(|other| self.add(other))
    }
}

/// Whether an effect of a model would not be added to the rest of it. What cannot be fitted says nothing against it.
fn is_worth_nothing(model: &Model, effect: Effect, sets: &FlightSets, options: &Options) -> bool {
    let mut rest = model.clone();
    rest.terms.retain(|term| term.effect != effect);
    crate::add(&rest, effect, &sets.train(), &sets.validate(), options)
        .is_ok_and(|addition| !addition.finding.supported)
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
            better = fit_again(&better, sets)?;
        }
        let comparison = sysid::compare(&better, &sets.validate());
        Ok((better, comparison))
    })?;
    Ok((Joined { model, addition, comparison }, next))
}

/// A model fitted again, in other winds.
fn fit_again(model: &Model, sets: &FlightSets) -> Result<Model, WorkflowError> {
    let again = sysid::fit(&sets.train(), &model.vehicle, &model.effects(), Some(model));
    let again = again.map_err(|why| sets.blame(why))?.model;
    let fit = Some(sets.record_after(model, &again));
    Ok(Model { fit, history: model.history.clone(), ..again })
}

#[cfg(test)]
mod tests {
    use model::{Axis, Group};

    use super::*;
    use crate::conclusion::conclude;
    use crate::testing::{ORDINARY, fly, prepared, truth};
    use crate::workflow::unlike_rotors;
    use crate::workflow::{Reading, Silent};

    fn diagnosis(verdict: Verdict, summary: &str) -> Diagnosis {
        Diagnosis {
            verdict,
            verdicts: PerGroup { translation: verdict, rotation: Verdict::Adequate },
            summary: summary.into(),
            effects: Vec::new(),
            unexplained: Vec::new(),
            not_identified: Vec::new(),
            since: None,
            rotors: None,
            with_changes: None,
        }
    }

    fn explanation(steps: Vec<Step>, last: Verdict) -> Explanation {
        Explanation {
            basic: truth(),
            basic_comparison: sysid::compare(&truth(), &[]),
            steps,
            taken_out: Vec::new(),
            last_diagnosis: diagnosis(last, "Nothing is left."),
            model: truth(),
            refinement: None,
            rotors: None,
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

    /// A shear stands for a wind in which the craft climbs and descends, until the wind itself is in the model. Where both are there, both
    /// stay.
    #[test]
    fn an_effect_that_stood_for_a_later_one_is_taken_out_again() {
        for (shear, stays) in [(0.0, false), (0.6, true)] {
            let mut world = truth();
            world.set(Effect::SteadyWind, &[1.5, 0.0]);
            world.set(Effect::WindShear, &[shear, 0.0]);
            let flown = |seed| fly(&world, seed, 12.0, &ORDINARY);
            let (train, validate) = ([1, 2, 3].map(flown), [4, 5].map(flown));
            let mut sets =
                FlightSets::from_flights(&train, &validate, &world.vehicle, Reading::default(), &Silent)
                    .unwrap();
            let basic = sysid::fit(&sets.train(), &world.vehicle, &truth().effects(), None).unwrap().model;
            let shear_first =
                crate::add(&basic, Effect::WindShear, &sets.train(), &sets.validate(), &Options::default())
                    .unwrap()
                    .finding;
            assert!(shear_first.supported, "{}", shear_first.reason);
            let first = conclude(vec![shear_first], Vec::new(), Vec::new());
            let Added { steps, taken_out, .. } =
                add_what_is_found(&basic, first, &mut sets, &Options::default(), &Silent).unwrap();
            let found: Vec<Effect> = steps.iter().map(|step| step.effect).collect();
            assert!(found.contains(&Effect::SteadyWind), "{found:?}");
            assert_eq!(found.contains(&Effect::WindShear), stays, "{found:?}");
            let out = TakenOut { effect: Effect::WindShear, by: Effect::SteadyWind };
            assert_eq!(taken_out, if stays { Vec::new() } else { vec![out] });
            assert_eq!(steps.last().unwrap().model.has(Effect::WindShear), stays);
        }
    }

    #[test]
    fn the_last_model_is_not_on_the_way() {
        let steps = vec![step(Effect::SteadyWind), step(Effect::WindShear)];
        let mut explanation = explanation(steps, Verdict::Adequate);
        let on_the_way: Vec<Model> = explanation.on_the_way_mut().map(|model| model.clone()).collect();
        assert_eq!(on_the_way, [explanation.basic.clone(), explanation.steps[0].model.clone()]);
        explanation.refinement = Some(RefinementOutcome {
            rows: Rows::All,
            kept: true,
            reason: String::new(),
            before: sysid::compare::HorizonError::default(),
            after: sysid::compare::HorizonError::default(),
            steps: 1,
        });
        assert_eq!(explanation.on_the_way_mut().count(), 3, "a refined model follows the last of the steps");
        explanation.refinement = None;
        explanation.steps.clear();
        assert_eq!(explanation.on_the_way_mut().count(), 0);
    }

    #[test]
    fn what_was_taken_out_is_told_after_what_was_found() {
        let mut explanation = explanation(vec![step(Effect::SteadyWind)], Verdict::Adequate);
        explanation.taken_out = vec![TakenOut { effect: Effect::WindShear, by: Effect::SteadyWind }];
        assert_eq!(
            explanation.conclusion(),
            "Found: steady-wind. wind-shear was added first and taken out again: it adds nothing once steady-wind is in the \
             model."
        );
    }

    #[test]
    fn a_weak_motor_is_told_unless_the_flights_do_not_determine_the_rotation() {
        let told = |rotation, steps: Vec<Step>| {
            let mut told = explanation(steps, Verdict::Adequate);
            told.last_diagnosis.verdicts.rotation = rotation;
            told.rotors = Some(unlike_rotors::tests::weak());
            told.conclusion()
        };
        let weak = "motor 2 gives 6.0 % less thrust than the mean of the other three (standard error of the fit 0.1 %).";
        let plain = told(Verdict::Adequate, Vec::new());
        assert_eq!(plain, format!("Found: nothing. Nothing is left. But at the same speed, {weak}"));
        let after = told(Verdict::Adequate, vec![step(Effect::SteadyWind)]);
        assert_eq!(after, format!("Found: steady-wind. At the same speed, {weak}"));
        assert!(
            told(Verdict::Unexplained, Vec::new()).contains(&format!("{weak} Because the rotation is still"))
        );
        assert_eq!(told(Verdict::NotIdentified, Vec::new()), "Found: nothing. Nothing is left.");
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

    /// It stays in the model, where it predicts better; but a model worse than a mean is no evidence of a cause.
    #[test]
    fn what_was_added_to_axes_that_stay_unidentified_is_not_found() {
        let steps = vec![step(Effect::QuadraticDrag), step(Effect::SteadyWind)];
        let mut explanation = explanation(steps, Verdict::NotIdentified);
        explanation.steps[0].addition.finding.axes.clear();
        let drop = crate::AxisDrop { sse_before: 4.0, sse_after: 1.0, drop_percent: 75.0 };
        explanation.steps[0].addition.finding.axes.insert("w", drop);
        let last = &mut explanation.last_diagnosis;
        last.not_identified =
            vec![NotIdentified::of_axis(Axis::U, "u is worse than a mean".into(), "fly more")];
        assert_eq!(
            explanation.conclusion(),
            "Found: quadratic-drag. The translation (u) is not identified by these flights: u is worse than a mean. To determine it: \
             fly more. steady-wind was added to the model, but the axes it acts on are still not identified: this is not yet a finding."
        );
        explanation.steps.remove(0);
        assert_eq!(
            explanation.conclusion(),
            "Found: nothing. Nothing is left. steady-wind was added to the model, but the axes it acts on are still not identified: \
             this is not yet a finding."
        );
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
