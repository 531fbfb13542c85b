//! Which physical effect is missing?
//!
//! Every candidate is fitted together with the whole model on the training flights and validated on held-out flights. What makes it
//! **supported** is said in `criteria.rs`: its coefficients differ from zero on the training flights, the held-out error
//! falls by more than chance, in most flights and by enough to matter, and the coefficients are physically possible.
//!
//! Candidates overlap: a wind looks partly like a tilted tracker, and two missing effects can hide each other. So all sets of
//! up to three are compared, linearised about the model (`screen.rs`, [`crate::subsets`]); the best ones are fitted exactly, the
//! best of those joins the model, and the search goes on from there (`search.rs`). Each member must then be supported with the
//! others in place. What is not in the set is reported as explained by it, or, when it does as well in a member's place,
//! as confounded (`ranking.rs`).
//!
//! What is left after the supported effects is searched for dependence on every measured quantity, by the same
//! held-out standard (`residual_tests.rs`): that is the difference between "adequate" and "unexplained". What the flights do not
//! determine at all (`unidentified.rs`) is neither (`conclusion.rs`).

use model::{Effect, Model};
use sysid::fit::slow;
use sysid::prepare::Prepared;
use sysid::{Residuals, residuals};

use crate::conclusion::conclude;
use crate::criteria::{ABOVE_NOISE, Left, takes_most};
use crate::finding::{Diagnosis, Unexplained, supported};
use crate::held_out::Validated;
use crate::noise;
use crate::not_logged::without_sides;
use crate::observer::{Observer, Progress};
use crate::options::Options;
use crate::ranking::{Confounded, confounded, ranked};
use crate::residual_tests::{Structure, structure};
use crate::search::{Chosen, Search};
use crate::search_error::SearchError;
use crate::stand_ins::{above_noise, incomplete, refuse_stand_ins};
use crate::unidentified::unidentified;
use crate::wander;

/// Diagnoses a model with the whole catalogue: which effect is missing from it?
///
/// `observer` hears of what is tried, and may stop it.
pub fn diagnose(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    observer: &dyn Observer,
) -> Result<Diagnosis, SearchError> {
    diagnose_with(model, train, validate, &Options::default(), observer)
}

/// Diagnoses a model with the candidates that `options` leave: which effect is missing from it?
pub fn diagnose_with(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, SearchError> {
    let flights = [train, validate].concat();
    let candidates = options.candidates_by(model, &flights);
    let search = Search::new(model, candidates, train, validate, observer)?;
    let Found { chosen, confounded, mut unexplained, .. } = found(&search)?;
    without_sides(&mut unexplained, &flights);
    let effects = ranked(&search, chosen.findings, &confounded)?;
    let rest = chosen.validated.as_ref().unwrap_or(&search.base);
    let refused = model.fit.as_ref().map_or(&[][..], |fit| &fit.rotation_refused);
    let unknown = unidentified(&rest.fit.model, refused, &unexplained, train, (validate, &rest.held_out));
    Ok(conclude(effects, unexplained, unknown))
}

/// What a search found, once stand-ins are refused.
pub(crate) struct Found {
    pub(crate) chosen: Chosen,
    confounded: Vec<Confounded>,
    unexplained: Vec<Unexplained>,
    stand_ins: Vec<Effect>,
    /// Whether what is left still answers the rotors of the last half second.
    answers_late: bool,
}

/// What a search finds; where that is stand-ins alone, what it finds without them. A stand-in that fits better than the right effect keeps
/// it out of the set, for beside the stand-in it adds little.
pub(crate) fn found(search: &Search<'_>) -> Result<Found, SearchError> {
    let first = found_without(search, &[])?;
    if first.stand_ins.is_empty() || !supported(&first.chosen.findings).is_empty() {
        return Ok(first);
    }
    let mut second = found_without(search, &first.stand_ins)?;
    // What answers late and was refused for it is not what was found in its place.
    if !takes_most(&second.chosen.findings) || second.answers_late {
        return Ok(first);
    }
    second.confounded.retain(|(_, rival)| !first.stand_ins.contains(rival));
    let refused =
        first.chosen.findings.into_iter().filter(|finding| first.stand_ins.contains(&finding.effect));
    second.chosen.findings.extend(refused);
    Ok(second)
}

/// What a search finds without some candidates.
fn found_without(search: &Search<'_>, refused: &[Effect]) -> Result<Found, SearchError> {
    let (train, validate) = (search.train, search.validate);
    let noise_before = excess(&search.base, validate);
    let mut chosen = search.choose_without(refused)?;
    let noise_after = chosen.validated.as_ref().map_or(noise_before, |with| excess(with, validate));
    let left = noise_after.map(|ratio| ratio.is_some_and(|ratio| ratio > ABOVE_NOISE));
    chosen = search.with_hidden(chosen, &left, refused)?;
    let members = supported(&chosen.findings);
    let confounded = confounded(search, &chosen)?;
    search.observer.progress(Progress { activity: "testing what is left", steps: None });
    let mut stand_ins = Vec::new();
    let (unexplained, answers_late) = loop {
        let rest = chosen.validated.as_ref().unwrap_or(&search.base);
        let Structure { unexplained, answers_late } = what_is_left(rest, train, validate);
        let incomplete = incomplete(&noise_before, &excess(rest, validate));
        let left = Left { unexplained: &unexplained, incomplete, answers_late };
        if !refuse_stand_ins(&mut chosen.findings, &left) {
            break (unexplained, answers_late);
        }
        let kept = supported(&chosen.findings);
        stand_ins = members.iter().copied().filter(|effect| !kept.contains(effect)).collect();
        search.refit(&mut chosen)?;
    };
    Ok(Found { chosen, confounded, unexplained, stand_ins, answers_late })
}

/// What the residual of a model depends on, and what of it is above the noise for another cause.
pub(crate) fn what_is_left(rest: &Validated, train: &[&Prepared], validate: &[&Prepared]) -> Structure {
    let mut left = structure(rest, train, validate);
    let noise = known_noise(excess(rest, validate), rest, validate);
    left.unexplained.extend(above_noise(&noise, rest, validate));
    left.unexplained.extend(no_wander(rest, train, validate));
    left
}

/// Ratio of the residual's variance to that of the sensors' noise on each axis; only where no slow part was taken from it.
pub(crate) fn excess(of: &Validated, validate: &[&Prepared]) -> [Option<f64>; 6] {
    let mut ratios = noise::excess(validate, &of.held_out, Some(&of.fit.model));
    if validate.iter().any(|flight| slow::is_taken(flight)) {
        ratios[..2].fill(None);
    }
    ratios
}

/// The ratios, and where the noise is not white those to a tracker's. These are upper bounds of the noise, by which effects are not judged.
fn known_noise(mut ratios: [Option<f64>; 6], of: &Validated, validate: &[&Prepared]) -> [Option<f64>; 6] {
    let is_told = ratios[..3].iter().any(Option::is_some) || validate.iter().any(|f| slow::is_taken(f));
    if !is_told && let Some(bounds) = noise::excess_over_wandering(validate, &of.held_out) {
        ratios.iter_mut().zip(bounds).for_each(|(ratio, bound)| *ratio = Some(bound));
    }
    ratios
}

/// What is left along the horizontal axes in a wind that wanders, if it is not that wind.
fn no_wander(rest: &Validated, train: &[&Prepared], validate: &[&Prepared]) -> Vec<Unexplained> {
    if !validate.iter().any(|flight| flight.has_gusts()) {
        return Vec::new();
    }
    let fitted: Vec<Residuals> = train.iter().map(|flight| residuals(flight, &rest.fit.model)).collect();
    let all: Vec<&Residuals> = fitted.iter().chain(&rest.held_out).collect();
    wander::otherwise(&[train, validate].concat(), &all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::Silent;

    #[test]
    fn without_flights_there_is_no_diagnosis() {
        let refused = diagnose(&Model::thesis(), &[], &[], &Silent);
        assert_eq!(refused.err(), Some(sysid::FitError::NoFlights.into()));
    }
}
