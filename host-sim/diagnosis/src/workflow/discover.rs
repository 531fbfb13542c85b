//! What an unknown effect looks like, when no known one fits.
//!
//! Known effects come first, as in [`super::explain`]. What they leave of the training flights is searched for its form
//! ([`crate::discovery`]). The form is chosen without a look at the flights held out, then fitted with all of the model's
//! coefficients as an effect of users, and judged on them once. Further terms join until one fails.

use std::path::Path;

use model::user_effects::{USUAL_COLUMNS, file_of, place_of_column};
use model::{Axis, Effect, Model, effects};

use crate::addition::add_to;
use crate::criteria::SIGNIFICANCE;
use crate::diagnose::what_is_left;
use crate::discovery::candidates::{Candidates, candidates};
use crate::discovery::choice::{quantities, ranked, rivals};
use crate::discovery::define::{Defined, define};
use crate::discovery::form::Form;
use crate::discovery::memory::{remembering, remembers};
use crate::discovery::problem::Problem;
use crate::discovery::refine::Refined;
use crate::discovery::variables::Variable;
use crate::discovery::words::{formula, known_physics, sentence, short, to_fly};
use crate::discovery::{Discovery, DiscoveryVerdict, FlightFall, FormNumber, Proposal};
use crate::finding::{CoefficientFigures, EffectFinding, Unexplained};
use crate::held_out::{Validated, fit_and_validate, validated};
use crate::noise::squares_of_noise;
use crate::observer::{Observer, Progress};
use crate::workflow::asked::{Asked, holds, questions};
use crate::workflow::diagnose::search;
use crate::workflow::error::WorkflowError;
use crate::workflow::estimates::{Estimated, estimated, with_values};
use crate::workflow::explain::{Explanation, add_what_is_found};
use crate::workflow::headings::{warn_of_forms_at_one_heading, warn_of_one_heading};
use crate::workflow::sets::FlightSets;
use crate::{Addition, Options};

/// Terms of a formula at most.
const MOST_TERMS: usize = 3;
/// Forms that are looked at until one can be fitted with the model's own coefficients and holds on the flights held out.
const FITTED: usize = 8;
/// Fits of a term with the levers of the model that came of the one before.
const LEVER_STEPS: usize = 2;
/// Rivals that are fitted and judged beside the first proposal.
const RIVALS_JUDGED: usize = 2;
/// Where drafts of effects come from, for messages.
const HERE: &str = "discover";
/// The first proposal.
const FIRST: &str = "discovered-1";
/// What a form says of itself before it is fitted.
const DRAFT: &str = "Discovered.";

/// Makes flights that are read from now on include what forms may depend on besides: the time of each row, where a load hangs,
/// where another craft flies. Columns that the effects of users name come first, where there is no room for all.
pub fn prepare_to_discover() {
    for (name, _) in USUAL_COLUMNS {
        place_of_column(name);
    }
}

/// Training flights that a form is fitted to and left out of, one after the other.
const LEAST_TRAINING_FLIGHTS: usize = 2;

/// Whether there are flights enough to discover anything by.
///
/// # Errors
/// Where there are not.
pub fn can_discover(sets: &FlightSets) -> Result<(), WorkflowError> {
    let train = sets.train().len();
    if train < LEAST_TRAINING_FLIGHTS { Err(WorkflowError::TooFewToDiscover { train }) } else { Ok(()) }
}

/// Searches what is left of flights that have been explained by known effects.
pub fn discover_after(
    explanation: &Explanation,
    sets: &FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Discovery, WorkflowError> {
    can_discover(sets)?;
    discover_beyond(explanation.last_model(), explanation.found(), sets, options, observer)
}

/// Adds the known effects that a model lacks, then searches what is left.
pub fn discover(
    model: &Model,
    own: &[Effect],
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Discovery, WorkflowError> {
    can_discover(sets)?;
    sets.hold_against(model, own, observer)?;
    let diagnosis = search(model, sets, options, observer)?;
    let steps = add_what_is_found(model, diagnosis, sets, options, observer)?.steps;
    let known: Vec<Effect> = steps.iter().map(|step| step.effect).collect();
    warn_of_one_heading(&known, sets, observer);
    let model = steps.last().map_or(model, |step| &step.model).clone();
    discover_beyond(&model, known, sets, options, observer)
}

/// Searches what a model leaves to which nothing known is missing.
fn discover_beyond(
    model: &Model,
    known: Vec<Effect>,
    sets: &FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Discovery, WorkflowError> {
    let variables = Variable::all(&sets.train(), model);
    let mut hunt = Hunt { model, sets, variables, options, observer };
    let known_fit = hunt.fitted(model)?;
    let left_by = |rest: &Validated| what_is_left(rest, &sets.train(), &sets.validate()).unexplained;
    let mut terms = Terms { left: vec![left_by(&known_fit)], ..Terms::default() };
    let (mut rest, mut refused) = (known_fit.clone(), None);
    let found = candidates(&sets.train(), model, &hunt.variables, observer);
    let mut further: Option<Candidates> = None;
    loop {
        if observer.is_cancelled() {
            return Err(WorkflowError::Cancelled);
        }
        let found = further.as_ref().unwrap_or(&found);
        if !found.are_significant() {
            break;
        }
        match hunt.next_term(&rest, found, &terms.forms) {
            Next::Term(found) => {
                let (term, with) = hunt.remembering(&rest, &terms.forms, *found);
                if let Some(why) = hunt.why_no_cause(&term.form) {
                    refused = Some(why);
                    break;
                }
                rest = validated(with.fit.clone(), &sets.validate()).map_err(|why| sets.blame(why))?;
                terms.join(term, with, left_by(&rest));
            }
            Next::Refused(why) => {
                refused = Some(why);
                break;
            }
        }
        // Where nothing is left, no further term is looked for.
        if terms.forms.len() == MOST_TERMS || terms.left.last().is_some_and(Vec::is_empty) {
            break;
        }
        further = Some(candidates(&sets.train(), &rest.fit.model, &hunt.variables, observer));
    }
    let (proposals, model) = hunt.proposals(&known_fit, &mut terms, &found)?;
    if !proposals.is_empty() {
        let forms: Vec<Form> = terms.forms.iter().map(|term| term.form.clone()).collect();
        warn_of_forms_at_one_heading(&forms, sets, observer);
    }
    let left = terms.left.pop().unwrap_or_default();
    let verdict = match (proposals.is_empty(), left.is_empty()) {
        (false, _) => DiscoveryVerdict::Proposed,
        (true, true) => DiscoveryVerdict::Nothing,
        (true, false) => DiscoveryVerdict::NotAFormula,
    };
    let refused = refused.filter(|_| verdict == DiscoveryVerdict::NotAFormula);
    Ok(Discovery { proposals, verdict, known, refused, left, search_p_value: found.p_value, model })
}

/// Terms that hold, one after the other.
#[derive(Default)]
struct Terms {
    forms: Vec<Refined>,
    /// The effects that these are in the model with all of them.
    effects: Vec<Effect>,
    /// What is left of the flights without any, with the first, with the first two, and so on.
    left: Vec<Vec<Unexplained>>,
    /// The first by itself.
    first: Option<Addition>,
}

impl Terms {
    /// Takes in a further term, which came of a fit beside those before it.
    fn join(&mut self, term: Refined, with: Addition, left: Vec<Unexplained>) {
        self.forms.push(term);
        self.effects.push(with.finding.effect);
        self.left.push(left);
        if self.forms.len() == 1 {
            self.first = Some(with);
            return;
        }
        // Beside it, those before it fit best elsewhere: from where they were, a fit of all may lead astray.
        for (form, effect) in self.forms.iter_mut().zip(&self.effects) {
            let fitted = with.fit.model.term(*effect).map_or(&[][..], |term| &term.coefficients);
            *form = with_values(std::slice::from_ref(form), fitted.iter().map(|own| own.value)).remove(0);
        }
    }

    /// Drops the last one.
    fn drop_last(&mut self) {
        self.forms.pop();
        self.effects.pop();
        self.left.pop();
    }
}

/// The name of a term that is judged after so many others.
fn name_of_term(others: usize) -> String {
    if others == 0 { FIRST.into() } else { format!("discovered-term-{}", others + 1) }
}

/// What comes of a search for a further term.
enum Next {
    Term(Box<(Refined, Addition)>),
    /// Why there is none.
    Refused(String),
}

/// What is searched.
struct Hunt<'a> {
    model: &'a Model,
    sets: &'a FlightSets,
    variables: Vec<Variable>,
    options: &'a Options,
    observer: &'a dyn Observer,
}

impl Hunt<'_> {
    /// The next term beside those that there are, about a model with these, and the fit with it, unless the flights held out do not
    /// bear it out.
    fn next_term(&self, about: &Validated, found: &Candidates, terms: &[Refined]) -> Next {
        self.observer.progress(Progress { activity: "testing a form on the flights held out", steps: None });
        let id = name_of_term(terms.len());
        // The first that the flights held out were asked of says more than those before it.
        let mut refused: Option<(bool, String)> = None;
        let mut asked: Vec<Asked> = Vec::new();
        // All terms together become one effect of users, which has its limits.
        let joins = |chosen: &&Refined| {
            let all: Vec<Refined> = terms.iter().chain([*chosen]).cloned().collect();
            let joint = define(&id, DRAFT.into(), &all, &self.variables);
            effects::check(&file_of(vec![joint.definition]), Path::new(HERE)).is_ok()
        };
        for chosen in ranked(&found.refined, &self.variables).into_iter().filter(joins).take(FITTED) {
            let (axes, numbers) = (chosen.form.channel.axes(), chosen.form.count(&self.variables));
            let Some(questions) = questions(axes, numbers, &asked) else { continue };
            let defined = define(&id, DRAFT.into(), std::slice::from_ref(chosen), &self.variables);
            let (was_asked, why) = match self.judge(about, &defined) {
                Ok(addition) if holds(&addition, questions) => {
                    return Next::Term(Box::new(self.settled(about, &id, chosen, addition)));
                }
                Ok(addition) if terms.is_empty() && addition.finding.p_value > SIGNIFICANCE => {
                    // The training flights alone do not tell its numbers: those held out were not asked.
                    (false, addition.finding.reason.to_string())
                }
                Ok(addition) => {
                    asked.extend(axes.iter().map(|axis| Asked { axis: *axis, numbers }));
                    (true, addition.finding.reason.to_string())
                }
                // What cannot be fitted with the model's own coefficients takes no answer away.
                Err(why) => (false, why.to_string()),
            };
            if refused.as_ref().is_none_or(|(was_before, _)| was_asked && !was_before) {
                refused = Some((was_asked, format!("{}: {why}", short(&chosen.form, &self.variables))));
            }
        }
        let none = || "no form predicts a training flight that it was not fitted to".into();
        Next::Refused(refused.map_or_else(none, |(_, why)| why))
    }

    /// A term that holds, and the model with it. What a rotor does was known from a model without the term: where that counts, it is
    /// fitted again with what the model with the term says.
    fn settled(&self, about: &Validated, id: &str, term: &Refined, with: Addition) -> (Refined, Addition) {
        let mut better = (term.clone(), with);
        for _ in 0..LEVER_STEPS {
            let Some(channel) = term.form.channel.with_levers_of(&better.1.fit.model) else { break };
            let mut again = better.0.clone();
            again.form.channel = channel;
            let defined = define(id, DRAFT.into(), std::slice::from_ref(&again), &self.variables);
            match self.judge(about, &defined) {
                Ok(addition) if addition.finding.supported => better = (again, addition),
                _ => break,
            }
        }
        better
    }

    /// A term that looks back, with the time and the number of lags that fit best, where it holds with them too. Were they wrong, a further
    /// term would be found in what that leaves.
    fn remembering(
        &mut self,
        about: &Validated,
        terms: &[Refined],
        (term, with): (Refined, Addition),
    ) -> (Refined, Addition) {
        if !remembers(&term.form, &self.variables) {
            return (term, with);
        }
        let flights = self.sets.train();
        let problem = Problem::amid_noise_of(&with.fit.model, &flights, &about.fit.model);
        let Some(better) = remembering(&problem, &term.form, &mut self.variables) else {
            return (term, with);
        };
        let defined =
            define(&name_of_term(terms.len()), DRAFT.into(), std::slice::from_ref(&better), &self.variables);
        match self.judge(about, &defined) {
            Ok(addition) if addition.finding.supported => (better, addition),
            _ => (term, with),
        }
    }

    /// Why a form explains nothing: what it remembers says how fast the quantity changes, which is what it is to explain.
    fn why_no_cause(&self, form: &Form) -> Option<String> {
        let along =
            |variable: &Variable| form.channel.axes().iter().any(|axis| variable.is_slope_along(*axis));
        let mut variables = form.factors.iter().map(|factor| &self.variables[factor.variable]);
        variables.any(along).then(|| {
            format!("{}: that is how fast it changes, and no cause of it", short(form, &self.variables))
        })
    }

    /// The terms as one proposal, and their rivals as others; and the model with the first. The last terms are dropped where
    /// all together do not hold.
    fn proposals(
        &self,
        about: &Validated,
        terms: &mut Terms,
        found: &Candidates,
    ) -> Result<(Vec<Proposal>, Model), WorkflowError> {
        let Some(first) = terms.forms.first().cloned() else { return Ok((Vec::new(), self.model.clone())) };
        let rivals = rivals(&found.refined, &first, &self.variables);
        let (proposal, model) = loop {
            // One term by itself is fitted already.
            let known = terms.first.clone().filter(|_| terms.forms.len() == 1);
            let all = (&terms.forms[..], &rivals[..]);
            match self.propose((about, known), FIRST, all, found) {
                Ok(proposed) if proposed.0.finding.supported => break proposed,
                answer if terms.forms.len() == 1 => break answer?,
                // Each held beside those before it. If all of them as one effect do not, fewer may.
                _ => terms.drop_last(),
            }
        };
        let mut proposals = vec![proposal];
        for rival in rivals.into_iter().take(RIVALS_JUDGED) {
            let id = format!("discovered-{}", proposals.len() + 1);
            let others = self::rivals(&found.refined, rival, &self.variables);
            // A rival that cannot be fitted with the model's own coefficients is none.
            if let Ok((judged, _)) =
                self.propose((about, None), &id, (std::slice::from_ref(rival), &others[..]), found)
                && judged.finding.supported
            {
                proposals.push(judged);
            }
        }
        Ok((proposals, model))
    }

    /// Fits an effect that was found with everything, and holds it against the flights held out.
    fn judge(&self, about: &Validated, defined: &Defined) -> Result<Addition, WorkflowError> {
        let user = effects::draft_one(defined.definition.clone(), Path::new(HERE))?;
        let (train, validate) = (self.sets.train(), self.sets.validate());
        add_to(about, Effect::User(user), Some(&defined.values), (&train, &validate), self.options)
            .map_err(|why| self.sets.blame(why))
    }

    /// Terms with bearings and times of lags as estimated, and what the flights held out say of them; nothing where they have none, or
    /// these flights do not determine them.
    fn estimated(&self, about: &Validated, id: &str, terms: &[Refined]) -> Option<(Estimated, Addition)> {
        let fit = |defined: &Defined| {
            let addition = self.judge(about, defined).ok()?;
            addition.fit.is_settled.then_some(addition.finding.coefficients)
        };
        let estimated = estimated(terms, &self.variables, fit)?;
        let defined = define(id, DRAFT.into(), &estimated.terms, &estimated.variables);
        let addition = self.judge(about, &defined).ok().filter(|addition| addition.finding.supported)?;
        Some((estimated, addition))
    }

    /// Terms as one proposal, and the model with it; where they are known already, `known` is what the flights held out say of them.
    fn propose(
        &self,
        (about, known): (&Validated, Option<Addition>),
        id: &str,
        (terms, rivals): (&[Refined], &[&Refined]),
        found: &Candidates,
    ) -> Result<(Proposal, Model), WorkflowError> {
        let plain = || {
            let (terms, variables) = (terms.to_vec(), self.variables.to_vec());
            Estimated { terms, variables, constants: Vec::new(), std_errors: Vec::new() }
        };
        let (own, addition) = match (self.estimated(about, id, terms), known) {
            (Some(better), _) => better,
            (None, Some(known)) => (plain(), known),
            // A name for the fit; the words are those of what it finds.
            (None, None) => (plain(), self.judge(about, &define(id, DRAFT.into(), terms, &self.variables))?),
        };
        let model = addition.fit.model.clone();
        Ok((self.described(id, (&own, addition), (&terms[0], rivals), found.p_value), model))
    }

    /// By how much the error of each held-out flight falls.
    fn falls(&self, finding: &EffectFinding) -> Vec<FlightFall> {
        let flights = self.sets.validate();
        let falls = flights.iter().zip(&finding.drop_percent_by_flight);
        falls.map(|(flight, drop)| FlightFall { flight: flight.name.clone(), drop_percent: *drop }).collect()
    }

    /// What a proposal says of its form: `first` is its first term as the search found it.
    fn described(
        &self,
        id: &str,
        (own, addition): (&Estimated, Addition),
        (first, rivals): (&Refined, &[&Refined]),
        search_p_value: f64,
    ) -> Proposal {
        let share_of_structure_percent = self.share_percent(&addition);
        let finding = addition.finding;
        let variables = &own.variables;
        let thrust = self.model.term(Effect::Thrust).and_then(|term| term.coefficients.first());
        let thrust = thrust.map_or(1.0, |coefficient| coefficient.value);
        let fitted = with_values(&own.terms, finding.coefficients.iter().map(|own| own.value));
        let sentences: Vec<String> = fitted.iter().map(|term| sentence(term, variables, thrust)).collect();
        let sentence = format!("{}.", sentences.join(". "));
        let defined = define(id, sentence.chars().take(MOST_SENTENCE).collect(), &fitted, variables);
        let other_forms: Vec<Form> = rivals.iter().map(|rival| rival.form.clone()).collect();
        Proposal {
            id: id.to_owned(),
            axes: axes(&fitted),
            formula: formula(&defined.definition),
            quantities: names(&fitted, variables),
            sentence,
            physics: known_physics(&fitted[0], variables),
            coefficients: numbers(&finding, &defined.units, &own.std_errors),
            constants: own.constants.clone(),
            drop_percent: finding.axes.iter().map(|(axis, drop)| (*axis, drop.drop_percent)).collect(),
            share_of_structure_percent,
            p_value: search_p_value.max(finding.held_out_p_value.unwrap_or(1.0)),
            splits: [first.improved, self.sets.train().len()],
            flights_improved: finding.flights_improved,
            flights: self.falls(&finding),
            rivals: rivals.iter().map(|rival| short(&rival.form, &self.variables)).collect(),
            excite: to_fly(&first.form, &other_forms, &self.variables),
            definition: defined.definition,
            finding,
        }
    }

    /// Share of what is above the sensors' noise that falls, over the axes of an effect, each in units of what it was.
    fn share_percent(&self, addition: &Addition) -> f64 {
        let Addition { before, after, finding, .. } = addition;
        let noise = squares_of_noise(&self.sets.validate());
        let (mut fall, mut all) = (0.0, 0.0);
        for axis in model::AXES.into_iter().filter(|axis| finding.axes.contains_key(axis.name())) {
            let floor = noise[axis.index()].unwrap_or(0.0);
            // In units of the noise, so that axes of rotation and of translation can be added.
            let unit = if floor > 0.0 { floor } else { after[axis].max(f64::MIN_POSITIVE) };
            fall += (before[axis] - after[axis]) / unit;
            all += ((before[axis] - floor).max(before[axis] - after[axis]).max(0.0)) / unit;
        }
        if all > 0.0 { (100.0 * fall / all).clamp(0.0, 100.0) } else { 0.0 }
    }

    /// A model as it fits, and what it predicts of the flights held out.
    fn fitted(&self, model: &Model) -> Result<Validated, WorkflowError> {
        fit_and_validate(model, &model.effects(), &self.sets.train(), &self.sets.validate())
            .map_err(|why| self.sets.blame(why))
    }
}

/// Coefficients with their units for people, and with the errors that allow for bearings and times of lags where there are any.
fn numbers(finding: &EffectFinding, units: &[String], std_errors: &[f64]) -> Vec<FormNumber> {
    let number = |(k, (figures, unit)): (usize, (&CoefficientFigures, &String))| FormNumber {
        name: figures.name.to_owned(),
        value: figures.value,
        std_error: std_errors.get(k).copied().unwrap_or(figures.std_error),
        unit: unit.clone(),
    };
    finding.coefficients.iter().zip(units).enumerate().map(number).collect()
}

/// The axes that terms act on, each once.
fn axes(terms: &[Refined]) -> Vec<Axis> {
    let mut axes: Vec<Axis> = terms.iter().flat_map(|term| term.form.channel.axes()).copied().collect();
    axes.sort_by_key(|axis| axis.index());
    axes.dedup();
    axes
}

/// The quantities that terms depend on, each once.
fn names(terms: &[Refined], variables: &[Variable]) -> Vec<&'static str> {
    let mut names: Vec<&'static str> =
        terms.iter().flat_map(|term| quantities(&term.form, variables)).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// Longest sentence of a definition, characters.
const MOST_SENTENCE: usize = 290;

/// Proposals as the text of a file of users' effects.
pub fn effects_file(proposals: &[Proposal]) -> String {
    file_of(proposals.iter().map(|proposal| proposal.definition.clone()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent};

    /// A spring along an axis of the room to the place of take-off.
    fn spring(axis: usize, name: &str, variables: &[Variable]) -> Refined {
        let variable = variables.iter().position(|variable| variable.name == name).unwrap();
        let form = Form::in_proportion(axis, variable);
        Refined { form, amplitudes: vec![-0.1], gain_left_out: 1.0, improved: 2 }
    }

    /// Springs of 0.8 N/m along north and 0.5 N/m along east. One along north once more is none: no fit tells it from the first.
    #[test]
    fn terms_go_on_from_where_they_fit_together_and_are_dropped_where_they_do_not() {
        let text = "[[effect]]\nid = \"springs\"\nacceleration.north = \"k * north / mass\"\n\
                    acceleration.east = \"l * east / mass\"\n\
                    coefficient = [{ name = \"k\", unit = \"N/m\", possible = [-9.0, 9.0], typical = 1.0 }, \
                    { name = \"l\", unit = \"N/m\", possible = [-9.0, 9.0], typical = 1.0 }]\n";
        let [springs] = effects::draft(text, Path::new("test")).unwrap()[..] else { panic!("one effect") };
        let mut world = truth();
        world.set(Effect::User(springs), &[-0.8, -0.5]);
        let flown = |seed| fly(&world, seed, 8.0, &ORDINARY);
        let (train, validate) = ([50, 51].map(flown), [52].map(flown));
        let sets = FlightSets::from_flights(&train, &validate, &truth().vehicle, Reading::default(), &Silent)
            .unwrap();
        let (model, options) = (truth(), Options::default());
        let variables = Variable::all(&sets.train(), &model);
        let hunt = Hunt { model: &model, sets: &sets, variables, options: &options, observer: &Silent };
        let judge = |about: &Validated, id: &str, term: &Refined| {
            let defined = define(id, DRAFT.into(), std::slice::from_ref(term), &hunt.variables);
            hunt.judge(about, &defined).unwrap()
        };
        let [north, east] =
            [(0, "north"), (1, "east")].map(|(axis, name)| spring(axis, name, &hunt.variables));
        let about = hunt.fitted(&model).unwrap();
        let first = judge(&about, &name_of_term(0), &north);
        let rest = validated(first.fit.clone(), &sets.validate()).unwrap();
        let second = judge(&rest, &name_of_term(1), &east);
        let mut terms = Terms { left: vec![Vec::new()], ..Terms::default() };
        terms.join(north.clone(), first.clone(), Vec::new());
        terms.join(east, second, Vec::new());
        let near =
            |found: &[f64]| found.iter().zip([-0.8, -0.5]).all(|(own, value)| (own - value).abs() < 0.1);
        let amplitudes: Vec<f64> = terms.forms.iter().flat_map(|form| form.amplitudes.clone()).collect();
        assert!(near(&amplitudes), "{amplitudes:?}");

        terms.join(north, first, Vec::new());
        let found = Candidates { refined: Vec::new(), p_value: 0.0 };
        let (proposals, model) = hunt.proposals(&about, &mut terms, &found).unwrap();
        assert_eq!((terms.forms.len(), terms.left.len(), proposals.len()), (2, 3, 1));
        assert!(proposals[0].finding.supported);
        let values: Vec<f64> = proposals[0].coefficients.iter().map(|number| number.value).collect();
        assert!(values.len() == 2 && near(&values), "{values:?}");
        assert_eq!(model.terms.last().map(|term| term.coefficients.len()), Some(2));
    }
}
