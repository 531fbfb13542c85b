//! From evidence to verdicts: of translation, of rotation, and of the whole.
//!
//! For each of the two, the first of these that holds:
//! 1. **missing-effect**: a supported effect takes away error on an axis that is identified once it is in the model.
//! 2. **unexplained**: what is left depends on something, on an axis that is identified.
//! 3. **not-identified**: an axis is not identified ([`crate::unidentified`]).
//! 4. **adequate**.
//!
//! So an effect that lowers the error of an axis, and leaves the model worse than a mean there, is listed and is no verdict; nor
//! is structure in the residual of a model that says nothing of the axis. The verdict of the whole is the first in the same order
//! that either part has: what was found stands, whatever is unknown of the other part, and *adequate* is said only where all
//! of the model is identified.

use model::{Axis, Effect, GROUPS, Group, NotIdentified, PerGroup};
use report::number::{p_equation, percent};

use crate::criteria::MATTERS_PERCENT;
use crate::figures::rms_of;
use crate::finding::{Diagnosis, EffectFinding, Unexplained, Verdict};
use crate::reason::{Reason, joined};
use crate::stand_ins::taken_in_part;

/// Verdicts in the order in which the first that either part has is that of the whole.
const ORDER: [Verdict; 4] =
    [Verdict::MissingEffect, Verdict::Unexplained, Verdict::NotIdentified, Verdict::Adequate];

/// Most reasons that a sentence gives; tables and JSON have all.
const MOST_REASONS: usize = 2;

/// What is said of an effect that lowers the error of axes which are not identified even with it.
pub(crate) const NOT_YET: &str = "the axes it acts on are still not identified: this is not yet a finding";

/// The diagnosis that findings, what is left, and what the flights do not determine lead to.
pub(crate) fn conclude(
    effects: Vec<EffectFinding>,
    unexplained: Vec<Unexplained>,
    not_identified: Vec<NotIdentified>,
) -> Diagnosis {
    let verdicts = PerGroup::from_fn(|group| verdict_of(group, &effects, &unexplained, &not_identified));
    let verdict = first_of(&ORDER, verdicts);
    let summary = summary(verdict, &effects, &unexplained, &not_identified);
    Diagnosis {
        verdict,
        verdicts,
        summary,
        effects,
        unexplained,
        not_identified,
        since: None,
        rotors: None,
        with_changes: None,
    }
}

/// The first verdict in `order` that either part has.
pub(crate) fn first_of(order: &[Verdict; 4], verdicts: PerGroup<Verdict>) -> Verdict {
    let has = |verdict: &Verdict| GROUPS.iter().any(|group| verdicts[*group] == *verdict);
    order.iter().copied().find(has).unwrap_or(Verdict::Adequate)
}

/// The diagnosis without the support of an effect that cannot join the model, or should not, and why. Where no other is
/// supported, the error that it lowers is left without a known cause. What is `not_identified` is that of the model without it.
pub(crate) fn without(
    diagnosis: &Diagnosis,
    effect: Effect,
    why: &Reason,
    not_identified: Vec<NotIdentified>,
) -> Diagnosis {
    let Diagnosis { mut effects, unexplained, .. } = diagnosis.clone();
    for finding in effects.iter_mut().filter(|f| f.effect == effect) {
        finding.refuse(why.clone());
    }
    conclude(effects, unexplained, not_identified)
}

/// Whether the flights determine an axis.
fn is_identified(axis: Axis, not_identified: &[NotIdentified]) -> bool {
    !not_identified.iter().any(|reason| reason.is_about(axis))
}

/// Whether an effect takes away error that matters on an identified axis of a group.
pub(crate) fn counts_in(finding: &EffectFinding, group: Group, not_identified: &[NotIdentified]) -> bool {
    let falls =
        |axis: &Axis| finding.axes.get(axis.name()).is_some_and(|drop| drop.drop_percent >= MATTERS_PERCENT);
    let is_known =
        |axis: Axis| !not_identified.iter().any(|reason| reason.is_about(axis) && !reason.leaves_findings);
    group.axes().any(|axis| falls(&axis) && is_known(axis))
}

fn verdict_of(
    group: Group,
    effects: &[EffectFinding],
    unexplained: &[Unexplained],
    not_identified: &[NotIdentified],
) -> Verdict {
    let counts = |finding: &&EffectFinding| counts_in(finding, group, not_identified);
    if effects.iter().filter(|f| f.supported).any(|f| counts(&f)) {
        return Verdict::MissingEffect;
    }
    let is_left = |u: &Unexplained| Group::of(u.axis) == group && is_identified(u.axis, not_identified);
    if unexplained.iter().any(is_left) || effects.iter().filter(|f| is_unfitted(f)).any(|f| counts(&f)) {
        return Verdict::Unexplained;
    }
    match not_identified.iter().any(|reason| reason.group == group) {
        true => Verdict::NotIdentified,
        false => Verdict::Adequate,
    }
}

/// Whether the flights support an effect that the model cannot be fitted with.
fn is_unfitted(finding: &EffectFinding) -> bool {
    matches!(
        finding.reason,
        Reason::NotFittedTogether(_) | Reason::MakesWorse { .. } | Reason::HarmsAxis { .. }
    )
}

/// The conclusion in sentences.
fn summary(
    verdict: Verdict,
    effects: &[EffectFinding],
    unexplained: &[Unexplained],
    not_identified: &[NotIdentified],
) -> String {
    let counts = |f: &EffectFinding| GROUPS.iter().any(|group| counts_in(f, *group, not_identified));
    let first = match verdict {
        Verdict::MissingEffect => effects.iter().find(|f| f.supported && counts(f)).map(|f| lacking(f, effects)),
        Verdict::Unexplained => {
            let worst = unexplained.iter().find(|u| is_identified(u.axis, not_identified));
            let left = worst.map(|worst| unaccounted(worst, effects));
            left.or_else(|| effects.iter().find(|f| is_unfitted(f)).map(unfitted))
        }
        Verdict::NotIdentified => effects.iter().find(|f| f.supported).map(no_finding),
        Verdict::Adequate => Some(
            "No known effect lowers the error on held-out flights by an amount that matters, and the residual \
             depends on none of the measured quantities."
                .into(),
        ),
    };
    let unknown = what_is_unknown(not_identified);
    match verdict {
        Verdict::NotIdentified => unknown.into_iter().chain(first).collect::<Vec<_>>().join(" "),
        _ => first.into_iter().chain(unknown).collect::<Vec<_>>().join(" "),
    }
}

/// What the flights do not determine, why, and what to fly: a sentence or two for each group.
pub(crate) fn what_is_unknown(not_identified: &[NotIdentified]) -> Option<String> {
    let of_group = |group: &Group| {
        let reasons: Vec<&NotIdentified> = not_identified.iter().filter(|r| r.group == *group).collect();
        let first = reasons.first()?;
        let mut axes: Vec<&str> = Vec::new();
        let mut why: Vec<&str> = Vec::new();
        let mut fly: Vec<&str> = Vec::new();
        for reason in &reasons {
            axes.extend(reason.axis.map(Axis::name).filter(|name| !axes.contains(name)));
            if why.len() < MOST_REASONS {
                why.push(&reason.reason);
                fly.extend(Some(reason.fly.as_str()).filter(|fly_this| !fly.contains(fly_this)));
            }
        }
        let is_all = reasons.iter().any(|reason| reason.axis.is_none());
        let what = match is_all {
            true => format!("The {}", first.group),
            false => format!("The {} ({})", first.group, axes.join(", ")),
        };
        let more = match reasons.len() - why.len() {
            0 => String::new(),
            1 => "; and one more, in the table".to_owned(),
            more => format!("; and {more} more, in the table"),
        };
        let (why, fly) = (why.join("; ") + &more, fly.join("; "));
        Some(format!("{what} is not identified by these flights: {why}. To determine it: {fly}."))
    };
    let all: Vec<String> = GROUPS.iter().filter_map(of_group).collect();
    (!all.is_empty()).then(|| all.join(" "))
}

/// The conclusion where the only effect that lowers the error cannot join the model, or makes it worse.
fn unfitted(finding: &EffectFinding) -> String {
    let effect = finding.effect;
    match finding.reason {
        Reason::MakesWorse { .. } | Reason::HarmsAxis { .. } => format!(
            "{effect} looks promising, but the model with it predicts held-out flights worse: what is missing stays unknown."
        ),
        _ => format!(
            "With {effect}, the held-out error falls, but the model with it cannot be fitted: its cause stays unknown."
        ),
    }
}

/// An effect that lowers the error of axes which are not identified even with it.
fn no_finding(finding: &EffectFinding) -> String {
    format!(
        "With {}, the held-out {} falls by {} %, but {NOT_YET}.",
        finding.effect,
        rms_of(finding.judged_axes()),
        percent(finding.rms_fall_percent())
    )
}

fn lacking(best: &EffectFinding, findings: &[EffectFinding]) -> String {
    let also: Vec<Effect> =
        findings.iter().filter(|f| f.supported && f.effect != best.effect).map(|f| f.effect).collect();
    let also =
        if also.is_empty() { String::new() } else { format!(" Also supported: {}.", joined(&also, ", ")) };
    let [improved, flights] = best.flights_improved;
    format!(
        "The model lacks {}. {} With it, the held-out {} falls by {} % ({improved} of {flights} flights, {}).\
         {also}",
        best.effect,
        best.sentence(),
        rms_of(best.judged_axes()),
        percent(best.rms_fall_percent()),
        p_equation(best.p_value)
    )
}

fn unaccounted(worst: &Unexplained, effects: &[EffectFinding]) -> String {
    let Unexplained { axis, depends_on, share_percent, .. } = worst;
    let left = format!(
        "The residual of {axis} {} ({} % of its held-out squared error)",
        depends_on.predicate(),
        percent(*share_percent)
    );
    let partly = effects.iter().filter_map(|finding| Some((finding.effect, taken_in_part(finding, *axis)?)));
    match partly.max_by(|one, other| one.1.total_cmp(&other.1)) {
        None => format!("{left}, and no known effect accounts for it."),
        Some((effect, taken)) => format!(
            "{left}. {effect} would take {} % of the squared error of {axis}, but leaves too much to be all of it: something else is \
             missing, beside it or in its place.",
            percent(taken)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dependence::Dependence;
    use crate::finding::AxisDrop;

    /// Takes so many percent of the squared error of an axis.
    fn taking(effect: Effect, supported: bool, drops: &[(&'static str, f64)]) -> EffectFinding {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        finding.supported = supported;
        (finding.drop_percent, finding.p_value, finding.flights_improved) = (12.34, 0.0021, [2, 2]);
        for (axis, percent) in drops {
            finding.axes.insert(axis, AxisDrop::new(100.0, 100.0 - percent));
        }
        finding
    }

    fn left(axis: Axis) -> Unexplained {
        let depends_on = Dependence::Quantity("height");
        Unexplained { axis, depends_on, share_percent: 7.25, p_value: 1e-4 }
    }

    fn unknown(axis: Axis) -> NotIdentified {
        NotIdentified::of_axis(axis, format!("{axis} explains nothing"), "climb and descend")
    }

    fn no_rotation() -> NotIdentified {
        NotIdentified::of_group(Group::Rotation, "the model has forces only".into(), "excite each motor")
    }

    fn both(translation: Verdict, rotation: Verdict) -> PerGroup<Verdict> {
        PerGroup { translation, rotation }
    }

    #[test]
    fn adequate_is_said_of_what_is_identified_alone() {
        let all = conclude(Vec::new(), Vec::new(), Vec::new());
        assert_eq!(
            (all.verdict, all.verdicts),
            (Verdict::Adequate, both(Verdict::Adequate, Verdict::Adequate))
        );
        let forces = conclude(Vec::new(), Vec::new(), vec![no_rotation()]);
        assert_eq!(forces.verdict, Verdict::NotIdentified);
        assert_eq!(forces.verdicts, both(Verdict::Adequate, Verdict::NotIdentified));
        assert_eq!(
            forces.summary,
            "The rotation is not identified by these flights: the model has forces only. To determine it: excite each motor."
        );
    }

    #[test]
    fn reasons_that_a_sentence_leaves_out_are_counted() {
        let said = what_is_unknown(&[unknown(Axis::U), unknown(Axis::V), unknown(Axis::W)]).unwrap();
        assert!(said.starts_with("The translation (u, v, w) is not identified"), "{said}");
        assert!(said.contains("; and one more, in the table. To determine it: "), "{said}");
        let said = what_is_unknown(&[unknown(Axis::U), unknown(Axis::V)]).unwrap();
        assert!(!said.contains("more, in the table"), "{said}");
    }

    #[test]
    fn what_was_found_of_one_part_stands_though_the_other_is_unknown() {
        let wind = taking(Effect::SteadyWind, true, &[("u", 50.0)]);
        let found = conclude(vec![wind], Vec::new(), vec![no_rotation()]);
        assert_eq!(found.verdict, Verdict::MissingEffect);
        assert_eq!(found.verdicts, both(Verdict::MissingEffect, Verdict::NotIdentified));
        assert!(found.summary.starts_with("The model lacks steady-wind."), "{}", found.summary);
        assert!(found.summary.contains("The rotation is not identified"), "{}", found.summary);
        let found = conclude(Vec::new(), vec![left(Axis::W)], vec![no_rotation()]);
        assert_eq!(found.verdicts, both(Verdict::Unexplained, Verdict::NotIdentified));
        assert_eq!(found.verdict, Verdict::Unexplained);
    }

    /// It is listed, and explain adds it; but a model worse than a mean is no evidence of a cause.
    #[test]
    fn an_effect_that_leaves_its_axes_unidentified_is_no_verdict() {
        let voltage = |r: f64| taking(Effect::BatteryVoltage, true, &[("w", 60.0), ("r", r)]);
        let doubted = conclude(vec![voltage(1.0)], vec![left(Axis::W)], vec![unknown(Axis::W)]);
        assert_eq!(doubted.verdict, Verdict::NotIdentified);
        assert_eq!(doubted.verdicts, both(Verdict::NotIdentified, Verdict::Adequate));
        assert_eq!(doubted.best(), Some(Effect::BatteryVoltage));
        assert!(doubted.summary.starts_with("The translation (w) is not identified"), "{}", doubted.summary);
        assert!(doubted.summary.ends_with("this is not yet a finding."), "{}", doubted.summary);
        let elsewhere = conclude(vec![voltage(40.0)], Vec::new(), vec![unknown(Axis::W)]);
        assert_eq!(elsewhere.verdicts, both(Verdict::NotIdentified, Verdict::MissingEffect));
        assert_eq!(elsewhere.verdict, Verdict::MissingEffect);
    }

    #[test]
    fn the_best_supported_effect_is_named_with_its_evidence_and_the_others_after_it() {
        let findings = [
            taking(Effect::Tether, false, &[("u", 9.0)]),
            taking(Effect::MassChange, true, &[("w", 12.34)]),
            taking(Effect::SteadyWind, true, &[("u", 9.0)]),
        ];
        let told = |findings: &[EffectFinding]| conclude(findings.to_vec(), Vec::new(), Vec::new()).summary;
        assert_eq!(
            told(&findings),
            format!(
                "The model lacks mass-change. {} With it, the held-out rms error of w falls by 6.4 % (2 of 2 \
                 flights, p = 0.002). Also supported: steady-wind.",
                Effect::MassChange.info().sentence
            )
        );
        assert!(!told(&findings[..2]).contains("Also supported"));
    }

    #[test]
    fn what_is_left_is_told_only_where_nothing_is_supported() {
        let told = |supported, left: Vec<Unexplained>| {
            conclude(vec![taking(Effect::Tether, supported, &[("u", 9.0)])], left, Vec::new()).summary
        };
        assert_eq!(
            told(false, vec![left(Axis::W)]),
            "The residual of w depends on the height (7.2 % of its held-out squared error), and no known effect \
             accounts for it."
        );
        assert!(told(true, vec![left(Axis::W)]).starts_with("The model lacks tether."));
        let partly = |axis| {
            let mut finding = taking(Effect::GroundEffect, false, &[("w", 80.0)]);
            finding.reason = Reason::AboveNoise { axis: Axis::W };
            conclude(vec![finding], vec![left(axis)], Vec::new()).summary
        };
        assert_eq!(
            partly(Axis::W),
            "The residual of w depends on the height (7.2 % of its held-out squared error). ground-effect would take 80.0 % of the \
             squared error of w, but leaves too much to be all of it: something else is missing, beside it or in its place."
        );
        assert!(partly(Axis::P).ends_with("and no known effect accounts for it."));
        assert_eq!(
            told(false, Vec::new()),
            "No known effect lowers the error on held-out flights by an amount that matters, and the \
             residual depends on none of the measured quantities."
        );
    }

    #[test]
    fn an_effect_that_cannot_be_fitted_leaves_the_next_best_or_an_unknown_cause() {
        let settled_not = sysid::FitError::NotConverged { effect: "tether", excitation: "fly around" };
        let why = Reason::NotFittedTogether(settled_not);
        let all = vec![
            taking(Effect::Tether, true, &[("u", 50.0)]),
            taking(Effect::MotorLag, true, &[("p", 50.0)]),
        ];
        let diagnosis = conclude(all, Vec::new(), Vec::new());
        let one = without(&diagnosis, Effect::Tether, &why, Vec::new());
        assert_eq!((one.best(), one.verdict), (Some(Effect::MotorLag), Verdict::MissingEffect));
        assert_eq!(one.verdicts, both(Verdict::Unexplained, Verdict::MissingEffect));
        let none = without(&one, Effect::MotorLag, &why, Vec::new());
        assert_eq!((none.best(), none.verdict), (None, Verdict::Unexplained), "never adequate");
        assert!(none.summary.starts_with("With tether, the held-out error falls"), "{}", none.summary);
        let forces = without(&one, Effect::MotorLag, &why, vec![no_rotation()]);
        assert_eq!(forces.verdicts, both(Verdict::Unexplained, Verdict::NotIdentified));
    }
}
