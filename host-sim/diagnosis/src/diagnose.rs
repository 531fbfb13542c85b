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
//! held-out standard (`residual_tests.rs`): that is the difference between "adequate" and "unexplained".

use model::Model;
use report::number::{p_equation, percent};
use sysid::prepare::Prepared;

use crate::criteria::Left;
use crate::figures::rms_of;
use crate::finding::{Diagnosis, EffectFinding, Unexplained, Verdict, supported, unfitted};
use crate::noise;
use crate::observer::{Observer, Progress};
use crate::options::Options;
use crate::ranking::{confounded, ranked};
use crate::reason::{Reason, joined};
use crate::residual_tests::{Structure, structure};
use crate::search::Search;
use crate::search_error::SearchError;
use crate::stand_ins::{above_noise, incomplete, refuse_stand_ins};

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
    let candidates = options.candidates_by(model, &[train, validate].concat());
    let search = Search::new(model, candidates, train, validate, observer)?;
    let mut chosen = search.choose()?;
    let confounded = confounded(&search, &chosen)?;
    observer.progress(Progress { activity: "testing what is left", steps: None });
    let noise_before = noise::excess(validate, &search.base.held_out);
    let unexplained = loop {
        let rest = chosen.validated.as_ref().unwrap_or(&search.base);
        let Structure { mut unexplained, answers_late } = structure(rest, train, validate);
        let noise_after = noise::excess(validate, &rest.held_out);
        unexplained.extend(above_noise(&noise_after, rest, validate));
        let incomplete = incomplete(&noise_before, &noise_after);
        let left = Left { unexplained: &unexplained, incomplete, answers_late };
        if !refuse_stand_ins(&mut chosen.findings, &left) {
            break unexplained;
        }
        search.refit(&mut chosen)?;
    };
    let effects = ranked(&search, chosen.findings, &confounded)?;
    let is_complete = unexplained.is_empty() && !effects.iter().any(is_unfitted);
    let verdict = match (effects.iter().any(|f| f.supported), is_complete) {
        (true, _) => Verdict::MissingEffect,
        (false, true) => Verdict::Adequate,
        (false, false) => Verdict::Unexplained,
    };
    let summary = summary(&effects, &unexplained);
    Ok(Diagnosis { verdict, summary, effects, unexplained })
}

/// The conclusion in sentences.
fn summary(findings: &[EffectFinding], unexplained: &[Unexplained]) -> String {
    if let Some(best) = findings.iter().find(|f| f.supported) {
        return lacking(best, findings);
    }
    if let Some(worst) = unexplained.first() {
        return unaccounted(worst);
    }
    match findings.iter().find(|finding| is_unfitted(finding)) {
        Some(finding) => unfitted(finding.effect),
        None => "No known effect lowers the error on held-out flights by an amount that matters, and the \
                 residual depends on none of the measured quantities."
            .into(),
    }
}

/// Whether the flights support an effect that the model cannot be fitted with.
fn is_unfitted(finding: &EffectFinding) -> bool {
    matches!(finding.reason, Reason::NotFittedTogether(_))
}

fn lacking(best: &EffectFinding, findings: &[EffectFinding]) -> String {
    let also = &supported(findings)[1..];
    let also =
        if also.is_empty() { String::new() } else { format!(" Also supported: {}.", joined(also, ", ")) };
    let [improved, flights] = best.flights_improved;
    format!(
        "The model lacks {}. {} With it, the held-out {} falls by {} % ({improved} of {flights} flights, {}).\
         {also}",
        best.effect,
        best.effect.info().sentence,
        rms_of(best.effect.info().axes),
        percent(best.rms_fall_percent()),
        p_equation(best.p_value)
    )
}

fn unaccounted(worst: &Unexplained) -> String {
    format!(
        "The residual of {} {} ({} % of its held-out squared error), and no known effect accounts for it.",
        worst.axis,
        worst.depends_on.predicate(),
        percent(worst.share_percent)
    )
}

#[cfg(test)]
mod tests {
    use model::{Axis, Effect};

    use super::*;
    use crate::observer::Silent;
    use crate::reason::Dependence;

    fn finding(effect: Effect, supported: bool) -> EffectFinding {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        finding.supported = supported;
        (finding.drop_percent, finding.p_value, finding.flights_improved) = (12.34, 0.0021, [2, 2]);
        finding
    }

    #[test]
    fn the_best_supported_effect_is_named_with_its_evidence_and_the_others_after_it() {
        let findings = [
            finding(Effect::Tether, false),
            finding(Effect::MassChange, true),
            finding(Effect::SteadyWind, true),
        ];
        assert_eq!(
            summary(&findings, &[]),
            format!(
                "The model lacks mass-change. {} With it, the held-out rms error of w falls by 6.4 % (2 of 2 \
                 flights, p = 0.002). Also supported: steady-wind.",
                Effect::MassChange.info().sentence
            )
        );
        assert!(!summary(&findings[..2], &[]).contains("Also supported"));
    }

    #[test]
    fn what_is_left_is_told_only_where_nothing_is_supported() {
        let left = Unexplained {
            axis: Axis::W,
            depends_on: Dependence::Quantity("height"),
            share_percent: 7.25,
            p_value: 1e-4,
        };
        let unsupported = [finding(Effect::Tether, false)];
        assert_eq!(
            summary(&unsupported, std::slice::from_ref(&left)),
            "The residual of w depends on the height (7.2 % of its held-out squared error), and no known effect \
             accounts for it."
        );
        assert!(summary(&[finding(Effect::Tether, true)], &[left]).starts_with("The model lacks tether."));
        assert_eq!(
            summary(&unsupported, &[]),
            "No known effect lowers the error on held-out flights by an amount that matters, and the \
             residual depends on none of the measured quantities."
        );
    }

    #[test]
    fn without_flights_there_is_no_diagnosis() {
        let refused = diagnose(&Model::thesis(), &[], &[], &Silent);
        assert_eq!(refused.err(), Some(sysid::FitError::NoFlights.into()));
    }
}
