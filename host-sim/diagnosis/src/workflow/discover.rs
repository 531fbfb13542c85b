//! What an unknown effect looks like, when no known one fits.
//!
//! Known effects come first, as in [`super::explain`]. What they leave of the training flights is searched for its form
//! ([`crate::discovery`]). The form is chosen without a look at the flights held out, then fitted with all of the model's
//! coefficients as an effect of users, and judged on them once. Further terms join until one fails.

use std::path::Path;

use model::user_effects::{USUAL_COLUMNS, file_of, place_of_column};
use model::{Axis, Effect, Model, PerAxis, effects};
use sysid::{Fit, FitError};

use crate::addition::add_to;
use crate::criteria::{HELD_OUT_SIGNIFICANCE, SIGNIFICANCE};
use crate::diagnose::what_is_left;
use crate::discovery::candidates::{Candidates, candidates};
use crate::discovery::choice::{quantities, ranked, rivals};
use crate::discovery::define::{Defined, define};
use crate::discovery::form::Form;
use crate::discovery::refine::Refined;
use crate::discovery::variables::Variable;
use crate::discovery::words::{formula, known_physics, sentence, short, to_fly};
use crate::discovery::{Discovery, DiscoveryVerdict, Proposal};
use crate::finding::{CoefficientFigures, Unexplained};
use crate::held_out::{Validated, fit_and_validate, validated};
use crate::noise::squares_of_noise;
use crate::observer::{Observer, Progress};
use crate::workflow::diagnose::search;
use crate::workflow::error::WorkflowError;
use crate::workflow::explain::{Explanation, add_what_is_found};
use crate::workflow::sets::FlightSets;
use crate::{Addition, Options};

/// Terms of a formula at most.
const MOST_TERMS: usize = 3;
/// Forms that are looked at until one can be fitted with the model's own coefficients and holds on the flights held out.
const FITTED: usize = 8;
/// Forms of an axis that the flights held out are asked of at most.
const MOST_QUESTIONS: usize = 2;
/// Fits of a term with the levers of the model that came of the one before.
const LEVER_STEPS: usize = 2;
/// Rivals that are fitted and judged beside the first proposal.
const RIVALS_JUDGED: usize = 2;
/// Where drafts of effects come from, for messages.
const HERE: &str = "discover";

/// Makes flights that are read from now on include what forms may depend on besides: the time of each row, where a load hangs,
/// where another craft flies. Columns that the effects of users name come first, where there is no room for all.
pub fn prepare_to_discover() {
    for (name, _) in USUAL_COLUMNS {
        place_of_column(name);
    }
}

/// Searches what is left of flights that have been explained by known effects.
pub fn discover_after(
    explanation: &Explanation,
    sets: &FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Discovery, WorkflowError> {
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
    sets.hold_against(model, own, observer)?;
    let diagnosis = search(model, sets, options, observer)?;
    let (steps, _) = add_what_is_found(model, diagnosis, sets, options, observer)?;
    let known = steps.iter().map(|step| step.effect).collect();
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
    let hunt = Hunt { model, sets, variables: &variables, options, observer };
    let mut terms: Vec<Refined> = Vec::new();
    let known_fit = hunt.fitted(model)?;
    let mut left = hunt.left(&known_fit);
    let (mut rest, mut refused) = (known_fit.clone(), None);
    let found = candidates(&sets.train(), model, &variables, observer);
    let mut further: Option<Candidates> = None;
    loop {
        if observer.is_cancelled() {
            return Err(WorkflowError::Cancelled);
        }
        let found = further.as_ref().unwrap_or(&found);
        if !found.are_significant() {
            break;
        }
        match hunt.next_term(&rest, found, &terms) {
            Next::Term(found) => {
                let (term, with) = *found;
                terms.push(term);
                rest = validated(with, &sets.validate()).map_err(|why| sets.blame(why))?;
                left = hunt.left(&rest);
            }
            Next::Refused(why) => {
                refused = Some(why);
                break;
            }
        }
        // Where nothing is left, no further term is looked for.
        if terms.len() == MOST_TERMS || left.is_empty() {
            break;
        }
        further = Some(candidates(&sets.train(), &rest.fit.model, &variables, observer));
    }
    let (proposals, model) = hunt.proposals(&known_fit, &terms, &found)?;
    let verdict = match (proposals.is_empty(), left.is_empty()) {
        (false, _) => DiscoveryVerdict::Proposed,
        (true, true) => DiscoveryVerdict::Nothing,
        (true, false) => DiscoveryVerdict::NotAFormula,
    };
    let refused = refused.filter(|_| verdict == DiscoveryVerdict::NotAFormula);
    Ok(Discovery { proposals, verdict, known, refused, left, search_p_value: found.p_value, model })
}

/// What comes of a search for a further term.
enum Next {
    Term(Box<(Refined, Fit)>),
    /// Why there is none.
    Refused(String),
}

/// What the flights held out were asked of an axis: whether a form of so many numbers predicts them.
struct Asked {
    axis: Axis,
    numbers: usize,
}

/// How many questions the flights held out are asked of some axes once they are asked of a form of so many numbers. Two are too many
/// unless this one is simpler: what is fitted to the one flight that shows it may go astray in others, where something simpler does not.
fn questions(axes: &[Axis], numbers: usize, asked: &[Asked]) -> Option<usize> {
    let of = |axis: &Axis| asked.iter().filter(|before| before.axis == *axis).count();
    let questions = 1 + axes.iter().map(of).max().unwrap_or(0);
    let is_simpler = asked.iter().filter(|one| axes.contains(&one.axis)).all(|one| numbers < one.numbers);
    (questions <= MOST_QUESTIONS && is_simpler).then_some(questions)
}

/// Whether a form is borne out by flights held out that were asked so many questions (Bonferroni).
fn holds(addition: &Addition, questions: usize) -> bool {
    let is_enough = |p_value: f64| p_value < HELD_OUT_SIGNIFICANCE / questions as f64;
    addition.finding.supported && (questions == 1 || addition.finding.held_out_p_value.is_some_and(is_enough))
}

/// What is searched.
struct Hunt<'a> {
    model: &'a Model,
    sets: &'a FlightSets,
    variables: &'a [Variable],
    options: &'a Options,
    observer: &'a dyn Observer,
}

impl Hunt<'_> {
    /// The next term beside those that there are, about a model with these, and the fit with it, unless the flights held out do not
    /// bear it out.
    fn next_term(&self, about: &Validated, found: &Candidates, terms: &[Refined]) -> Next {
        self.observer.progress(Progress { activity: "testing a form on the flights held out", steps: None });
        let id = format!("discovered-term-{}", terms.len() + 1);
        let mut refused: Option<String> = None;
        let mut asked: Vec<Asked> = Vec::new();
        // All terms together become one effect of users, which has its limits.
        let joins = |chosen: &&Refined| {
            let all: Vec<Refined> = terms.iter().chain([*chosen]).cloned().collect();
            let joint = define(&id, "Terms.".into(), &all, self.variables);
            effects::check(&file_of(vec![joint.definition]), Path::new(HERE)).is_ok()
        };
        for chosen in ranked(&found.refined, self.variables).into_iter().filter(joins).take(FITTED) {
            let (axes, numbers) = (chosen.form.channel.axes(), chosen.form.count(self.variables));
            let Some(questions) = questions(axes, numbers, &asked) else { continue };
            let defined = define(&id, "A term.".into(), std::slice::from_ref(chosen), self.variables);
            let why = match self.judge(about, &defined) {
                Ok(addition) if holds(&addition, questions) => {
                    return Next::Term(Box::new(self.settled(about, &id, chosen, addition.fit)));
                }
                Ok(addition) if terms.is_empty() && addition.finding.p_value > SIGNIFICANCE => {
                    // The training flights alone do not tell its numbers: those held out were not asked.
                    addition.finding.reason.to_string()
                }
                Ok(addition) => {
                    asked.extend(axes.iter().map(|axis| Asked { axis: *axis, numbers }));
                    addition.finding.reason.to_string()
                }
                // What cannot be fitted with the model's own coefficients takes no answer away.
                Err(why) => why.to_string(),
            };
            refused.get_or_insert_with(|| format!("{}: {why}", short(&chosen.form, self.variables)));
        }
        Next::Refused(
            refused.unwrap_or_else(|| "no form predicts a training flight that it was not fitted to".into()),
        )
    }

    /// A term that holds, and the fit with it. What a rotor does was known from a model without the term: where that counts, it is
    /// fitted again with what the model with the term says.
    fn settled(&self, about: &Validated, id: &str, term: &Refined, fit: Fit) -> (Refined, Fit) {
        let mut better = (term.clone(), fit);
        for _ in 0..LEVER_STEPS {
            let Some(channel) = term.form.channel.with_levers_of(&better.1.model) else { break };
            let mut again = better.0.clone();
            again.form.channel = channel;
            let defined = define(id, "A term.".into(), std::slice::from_ref(&again), self.variables);
            match self.judge(about, &defined) {
                Ok(addition) if addition.finding.supported => better = (again, addition.fit),
                _ => break,
            }
        }
        better
    }

    /// The terms as one proposal, and their rivals as others; and the model with the first.
    fn proposals(
        &self,
        about: &Validated,
        terms: &[Refined],
        found: &Candidates,
    ) -> Result<(Vec<Proposal>, Model), WorkflowError> {
        let Some(first) = terms.first() else { return Ok((Vec::new(), self.model.clone())) };
        let (proposal, model) = self.propose(about, "discovered-1", terms, found)?;
        let mut proposals = vec![proposal];
        for rival in rivals(&found.refined, first, self.variables).into_iter().take(RIVALS_JUDGED) {
            let id = format!("discovered-{}", proposals.len() + 1);
            // A rival that cannot be fitted with the model's own coefficients is none.
            if let Ok((judged, _)) = self.propose(about, &id, std::slice::from_ref(rival), found)
                && judged.finding.supported
            {
                proposals.push(judged);
            }
        }
        Ok((proposals, model))
    }

    /// Fits an effect that was found with everything, and holds it against the flights held out.
    fn judge(&self, about: &Validated, defined: &Defined) -> Result<Addition, WorkflowError> {
        let text = file_of(vec![defined.definition.clone()]);
        let drafts = effects::draft(&text, Path::new(HERE))?;
        let Some(user) = drafts.first() else { return Err(self.sets.blame(FitError::NoFlights)) };
        let (train, validate) = (self.sets.train(), self.sets.validate());
        add_to(about, Effect::User(*user), Some(&defined.values), (&train, &validate), self.options)
            .map_err(|why| self.sets.blame(why))
    }

    /// Terms as one proposal, and the model with it.
    fn propose(
        &self,
        about: &Validated,
        id: &str,
        terms: &[Refined],
        found: &Candidates,
    ) -> Result<(Proposal, Model), WorkflowError> {
        let variables = self.variables;
        let thrust = self
            .model
            .term(Effect::Thrust)
            .and_then(|term| term.coefficients.first())
            .map_or(1.0, |c| c.value);
        // A name for the fit; the words are those of what it finds.
        let addition = self.judge(about, &define(id, "Discovered.".into(), terms, variables))?;
        let fitted = with_values(terms, &addition.finding.coefficients);
        let sentences: Vec<String> = fitted.iter().map(|term| sentence(term, variables, thrust)).collect();
        let sentence = format!("{}.", sentences.join(". "));
        let defined = define(id, sentence.chars().take(MOST_SENTENCE).collect(), &fitted, variables);
        let forms: Vec<&Form> = terms.iter().map(|term| &term.form).collect();
        let others = rivals(&found.refined, &terms[0], variables);
        let other_forms: Vec<Form> = others.iter().map(|rival| rival.form.clone()).collect();
        let mut names: Vec<&'static str> =
            forms.iter().flat_map(|form| quantities(form, variables)).collect();
        names.sort_unstable();
        names.dedup();
        let mut axes: Vec<Axis> = forms.iter().flat_map(|form| form.channel.axes()).copied().collect();
        axes.sort_by_key(|axis| axis.index());
        axes.dedup();
        let finding = addition.finding;
        let proposal = Proposal {
            id: id.to_owned(),
            axes,
            formula: formula(&defined.definition),
            quantities: names,
            sentence,
            physics: known_physics(&fitted[0], variables),
            coefficients: finding.coefficients.clone(),
            drop_percent: finding.axes.iter().map(|(axis, drop)| (*axis, drop.drop_percent)).collect(),
            share_of_structure_percent: self.share_percent(
                &addition.before,
                &addition.after,
                &finding.axes.keys().copied().collect::<Vec<_>>(),
            ),
            p_value: found.p_value.max(finding.held_out_p_value.unwrap_or(1.0)),
            splits: [terms[0].improved, self.sets.train().len()],
            flights_improved: finding.flights_improved,
            rivals: others.iter().map(|rival| short(&rival.form, variables)).collect(),
            excite: to_fly(forms[0], &other_forms, variables),
            definition: defined.definition,
            finding,
        };
        Ok((proposal, addition.fit.model))
    }

    /// Share of what is above the sensors' noise that falls, over some axes, each in units of what it was.
    fn share_percent(&self, before: &PerAxis<f64>, after: &PerAxis<f64>, axes: &[&str]) -> f64 {
        let noise = squares_of_noise(&self.sets.validate());
        let (mut fall, mut all) = (0.0, 0.0);
        for axis in model::AXES.into_iter().filter(|axis| axes.contains(&axis.name())) {
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

    /// What a fit leaves beyond noise.
    fn left(&self, rest: &Validated) -> Vec<Unexplained> {
        what_is_left(rest, &self.sets.train(), &self.sets.validate()).unexplained
    }
}

/// Forms with the values of a fit of them all, in the order of its coefficients.
fn with_values(terms: &[Refined], coefficients: &[CoefficientFigures]) -> Vec<Refined> {
    let mut values = coefficients.iter().map(|coefficient| coefficient.value);
    let mut fitted = terms.to_vec();
    for term in &mut fitted {
        for amplitude in &mut term.amplitudes {
            *amplitude = values.next().unwrap_or(*amplitude);
        }
        for parameter in term.form.parameters() {
            let value = values.next().unwrap_or_else(|| term.form.value(parameter));
            term.form = term.form.with(parameter, value);
        }
    }
    fitted
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

    #[test]
    fn flights_held_out_are_asked_twice_of_an_axis_and_the_second_time_of_something_simpler() {
        let vertical: &[Axis] = &[Axis::W];
        let forces: &[Axis] = &[Axis::U, Axis::V, Axis::W];
        assert_eq!(questions(vertical, 5, &[]), Some(1));
        let once = [Asked { axis: Axis::W, numbers: 5 }];
        assert_eq!(questions(vertical, 3, &once), Some(2));
        assert_eq!(questions(forces, 3, &once), Some(2), "one of its axes was asked");
        assert_eq!(questions(vertical, 5, &once), None, "it is no simpler");
        assert_eq!(questions(&[Axis::P], 7, &once), Some(1), "another axis");
        let twice = [Asked { axis: Axis::W, numbers: 5 }, Asked { axis: Axis::W, numbers: 3 }];
        assert_eq!(questions(vertical, 2, &twice), None);
    }
}
