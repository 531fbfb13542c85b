//! What has changed, concluded from the equations of motion and from the steady balance of the rotors.
//!
//! Whichever determines the answer speaks. Where the rotation is identified, the rows of every sample see more than means do.
//! Where it is not, what they say of moments is worth nothing, and the balance says what can be said; and what they do not
//! notice, the balance may.

use model::{Axis, Effect, GROUPS, Group, Model, NotIdentified, PerGroup};
use report::number::{fixed, p_equation, percent, with_error};

use crate::balance::Answer;
use crate::change::Change;
use crate::change_fit::is_beyond_flown;
use crate::change_remarks::{alike, remarks};
use crate::change_rivals::add_rotors_to;
use crate::change_together::Found;
use crate::criteria::STRUCTURE_SIGNIFICANCE;
use crate::dependence::Dependence;
use crate::figures::rms_of;
use crate::finding::{CoefficientFigures, Diagnosis, EffectFinding, Since, Unexplained, Verdict};
use crate::reason::{Reason, joined};
use crate::unidentified::{recorded, verdicts_of_change};

/// Share of an axis' squared error from which on the conclusion says what is left beside a change that was found, percent.
const LARGE_PERCENT: f64 = 50.0;

/// What the rows of every sample say.
pub(crate) struct OfRows {
    /// The evidence for each change, best first.
    pub(crate) findings: Vec<Found>,
    /// When the change began that they name.
    pub(crate) began: Option<Since>,
    /// The changes that happened, the named one first.
    pub(crate) happened: Vec<Change>,
    /// The model with them.
    pub(crate) with: Model,
    /// What was estimated together with them.
    pub(crate) revealed: Vec<Effect>,
    /// Structure that it leaves.
    pub(crate) left: Vec<Unexplained>,
}

/// The answer of both.
pub(crate) fn conclude(model: &Model, rows: OfRows, balance: Option<Answer>) -> Diagnosis {
    let OfRows { mut findings, began, mut happened, mut with, mut revealed, mut left } = rows;
    let unknown = recorded(model);
    let judged = !unknown.iter().any(|reason| reason.group == Group::Rotation);
    forget_unknown(&mut left, &unknown);
    if !judged {
        refuse_of_rotation(&mut findings);
    }
    let mut shifted = None;
    let (mut visible_loss, mut since) = (None, began);
    if let Some(answer) = balance {
        visible_loss = Some(answer.visible_loss);
        let is_named = answer.findings.iter().any(|(_, finding)| finding.supported);
        if !judged || is_named && !findings.iter().any(|(_, finding)| finding.supported) {
            if !is_named && answer.p_value < STRUCTURE_SIGNIFICANCE {
                shifted = Some((answer.most, answer.p_value));
            }
            replace(&mut findings, answer.findings);
            refuse_moments_of_wind(model, &mut findings);
            since = answer.since;
            with = with_supported(model, &findings);
            happened.clear();
            revealed.clear();
        }
    }
    findings.sort_by_key(|(_, finding)| !finding.supported);
    lead_with_the_tilt(&mut findings);
    if let Some((best, finding)) = findings.first_mut().filter(|(_, finding)| !judged && finding.supported) {
        add_rotors_to(*best, finding);
    }
    let (changed, of_alike) = named_of(&findings, &happened);
    let (best, also) = (changed.first().copied(), &changed[1.min(changed.len())..]);
    let with_changes = best.map(|_| without_refused(model, with, &happened, &findings));
    let unexplained: Vec<Unexplained> =
        shifted.filter(|_| best.is_none()).into_iter().map(shift_left).chain(left).collect();
    let named: Vec<Effect> = changed.iter().map(|(change, _)| change.effect).collect();
    let (verdict, verdicts) = verdicts_of_change(model, (&named, &unexplained), visible_loss.is_some());
    let subject = happened.first().copied().or(best.map(|(change, _)| *change)).filter(|_| !also.is_empty());
    let began = since.as_ref().map_or_else(String::new, |since| beginning(subject, since));
    let rest = if best.is_some() { not_all(&unexplained) } else { String::new() };
    let (verdict, verdicts, unknown) = by_its_own_flights(model, (verdict, verdicts), unknown);
    let torque = of_alike.map(|(change, _)| *change);
    let summary = summary(verdict, (best, also), unexplained.first(), visible_loss)
        + &remarks(model, &changed, of_alike, &revealed)
        + &began
        + &rest
        + &not_understood(model);
    refuse_alike(&mut findings, torque);
    Diagnosis {
        verdict,
        verdicts,
        summary,
        effects: findings.into_iter().map(|(_, finding)| finding).collect(),
        unexplained,
        not_identified: unknown,
        since,
        rotors: None,
        with_changes,
    }
}

/// A torque that has changed as the thrust of its motor is no change of its own.
fn refuse_alike(findings: &mut [Found], torque: Option<Change>) {
    for (_, finding) in findings.iter_mut().filter(|(change, _)| torque == Some(*change)) {
        finding.refuse(Reason::AlikeThrust);
    }
}

/// A tilted rotor comes first where it takes away more on its axes than the best change on its own: it is the cause of small changes of
/// thrust and balance, and no other change is the cause of it.
fn lead_with_the_tilt(findings: &mut [Found]) {
    let supported = findings.iter().take_while(|(_, finding)| finding.supported).count();
    let Some(tilt) = findings[..supported].iter().position(|(change, _)| change.effect == Effect::MotorTilt)
    else {
        return;
    };
    if findings[tilt].1.drop_percent > findings[0].1.drop_percent {
        findings[..=tilt].rotate_right(1);
    }
}

/// The changes that are named, best first, and the torque of a motor that has changed as its thrust has: the two are one change.
fn named_of<'a>(findings: &'a [Found], happened: &[Change]) -> (Vec<&'a Found>, Option<&'a Found>) {
    let best = findings.iter().find(|(_, finding)| finding.supported);
    let also = findings.iter().filter(|(change, f)| {
        f.supported && happened.contains(change) && best.is_none_or(|best| best.0 != *change)
    });
    let all: Vec<&Found> = best.into_iter().chain(also).collect();
    let of_alike = alike(&all);
    let is_named = |found: &&Found| of_alike.is_none_or(|torque| torque.0 != found.0);
    (all.into_iter().filter(is_named).collect(), of_alike)
}

/// The model with what is supported, by the sizes in the findings.
fn with_supported(model: &Model, findings: &[Found]) -> Model {
    let mut with = model.clone();
    for (change, finding) in findings.iter().filter(|(_, finding)| finding.supported) {
        let values: Vec<f64> = finding.coefficients.iter().map(|c| c.value).collect();
        change.add(&mut with, &values);
    }
    with
}

/// The model with what happened, without what of that was refused since.
fn without_refused(model: &Model, with: Model, happened: &[Change], findings: &[Found]) -> Model {
    let is_supported = |change: &Change| findings.iter().any(|(other, f)| other == change && f.supported);
    happened
        .iter()
        .filter(|change| !is_supported(change))
        .fold(with, |with, change| change.undone(&with, model))
}

/// What a model leaves on an axis that it does not know is no structure of the new flights, but for bursts far above that.
fn forget_unknown(left: &mut Vec<Unexplained>, unknown: &[NotIdentified]) {
    left.retain(|u| {
        u.depends_on == Dependence::Bursts || !unknown.iter().any(|reason| reason.is_about(u.axis))
    });
}

/// Refuses what rows of an unknown rotation say.
fn refuse_of_rotation(findings: &mut [Found]) {
    let needs_rotation = |(change, _): &&mut Found| !change.effect.info().axes.iter().all(|a| a.is_force());
    findings.iter_mut().filter(needs_rotation).for_each(|(_, finding)| finding.refuse(Reason::NotJudged));
}

/// A centre of mass or a weak motor that the balance finds in a wind that the forces show, and that is stronger than any the model was flown
/// in: the wind exerts moments of which the model knows nothing.
fn refuse_moments_of_wind(model: &Model, findings: &mut [Found]) {
    let is_strong = |(change, finding): &Found| {
        let squares: f64 = finding.coefficients.iter().map(|c| c.value * c.value).sum();
        change.effect == Effect::SteadyWind && finding.supported && is_beyond_flown(model, squares.sqrt())
    };
    if !findings.iter().any(is_strong) {
        return;
    }
    let turns = [Effect::ComOffset, Effect::MotorEfficiency];
    let is_moment = |(change, finding): &&mut Found| turns.contains(&change.effect) && finding.supported;
    for (_, finding) in findings.iter_mut().filter(is_moment) {
        finding.refuse_as_moment_of_wind();
    }
}

/// Parts of a model whose own flights it leaves unexplained.
fn unexplained_by(model: &Model) -> impl Iterator<Item = Group> {
    let verdicts = model.fit.as_ref().and_then(|fit| fit.verdicts);
    GROUPS.into_iter().filter(move |group| verdicts.is_some_and(|of| of[*group] == Verdict::Unexplained))
}

/// Where a model leaves its own flights unexplained, nothing that stands out is no proof that nothing has changed: what acted on the craft
/// then is not in the model, and nor is what has taken its place.
fn by_its_own_flights(
    model: &Model,
    (verdict, verdicts): (Verdict, PerGroup<Verdict>),
    mut unknown: Vec<NotIdentified>,
) -> (Verdict, PerGroup<Verdict>, Vec<NotIdentified>) {
    let doubted: Vec<Group> =
        unexplained_by(model).filter(|group| verdicts[*group] == Verdict::Adequate).collect();
    let reasons = doubted.iter().map(|group| {
        let reason = format!("the model leaves the {} of its own flights unexplained", group.name());
        let fly =
            "the model's own flights once more, or others like them, until quadlab explain leaves nothing";
        NotIdentified { leaves_findings: true, ..NotIdentified::of_group(*group, reason, fly) }
    });
    unknown.extend(reasons);
    let of_group = |group| if doubted.contains(&group) { Verdict::NotIdentified } else { verdicts[group] };
    let is_doubted = verdict == Verdict::Adequate && !doubted.is_empty();
    let verdict = if is_doubted { Verdict::NotIdentified } else { verdict };
    (verdict, PerGroup::from_fn(of_group), unknown)
}

/// " The model leaves the translation of its own flights unexplained: ..."
fn not_understood(model: &Model) -> String {
    let groups: Vec<&str> = unexplained_by(model).map(Group::name).collect();
    match groups.as_slice() {
        [] => String::new(),
        groups => format!(
            " The model leaves the {} of its own flights unexplained: what acted on the craft then and does not now can look like a change, \
             or hide one.",
            groups.join(" and the ")
        ),
    }
}

/// " This is not all: the residual of r has ..." Where little is left, the table says so.
fn not_all(left: &[Unexplained]) -> String {
    let most = left.iter().max_by(|a, b| a.share_percent.total_cmp(&b.share_percent));
    let most = most.filter(|most| most.share_percent >= LARGE_PERCENT);
    most.map_or_else(String::new, |most| format!(" This is not all: {}.", unaccounted(most)))
}

/// " It began in flight B.csv at 12.0 s (10.9 to 13.2 s).", " It began before flight B.csv, or in its first 1.1 s.", or
/// " mass-change began ..." where that is one of several changes.
fn beginning(subject: Option<Change>, since: &Since) -> String {
    let subject = subject.map_or_else(|| "It".to_owned(), |change| change.to_string());
    if since.before_flight {
        let (flight, by) = (&since.flight, fixed(since.t_high_s, 1));
        return format!(" {subject} began before flight {flight}, or in its first {by} s.");
    }
    let [t, low, high] = [since.t_s, since.t_low_s, since.t_high_s].map(|time_s| fixed(time_s, 1));
    format!(" {subject} began in flight {} at {t} s ({low} to {high} s).", since.flight)
}

/// The balance's evidence in the place of the other, best first.
fn replace(findings: &mut Vec<Found>, by: Vec<Found>) {
    findings.retain(|(change, _)| by.iter().all(|(other, _)| other != change));
    findings.splice(0..0, by);
}

fn shift_left(((axis, share_percent), p_value): ((Axis, f64), f64)) -> Unexplained {
    Unexplained { axis, depends_on: Dependence::Constant, share_percent, p_value }
}

/// The conclusion in sentences.
fn summary(
    verdict: Verdict,
    (best, also): (Option<&Found>, &[&Found]),
    unexplained: Option<&Unexplained>,
    visible_loss: Option<f64>,
) -> String {
    let Some(best_found @ (change, finding)) = best else {
        if verdict == Verdict::NotIdentified {
            return "No change can be found: the model's flights do not determine what it would affect."
                .into();
        }
        return nothing_named(unexplained, visible_loss);
    };
    let (fall, rivals) = match &finding.reason {
        Reason::BalanceShifted { percent: shift, rivals } => {
            let shift = percent(*shift);
            (format!("{shift} % of the shift in the rotors' steady balance is explained,"), rivals.as_slice())
        }
        Reason::Changed { rivals, .. } => (rms_fall(finding), rivals.as_slice()),
        _ => (rms_fall(finding), &[][..]),
    };
    let all: Vec<String> = std::iter::once(best_found)
        .chain(also.iter().copied())
        .map(|(change, finding)| format!("{change} ({})", sizes(finding)))
        .collect();
    let (things, it) = match also.is_empty() {
        true => ("one thing has changed", "it".to_owned()),
        false => ("more than one thing has changed", change.to_string()),
    };
    let rivals = match rivals.is_empty() {
        true => String::new(),
        false => format!(" These flights cannot tell {it} from {}.", joined(rivals, ", ")),
    };
    format!(
        "Since the model was fitted, {things}: {}. With {it}, {fall} on flights that it was not estimated from.{rivals}{}",
        all.join(" and "),
        finding.looks_the_same(),
    )
}

/// "extra_mass = 0.151 ± 0.012 kg"
pub(crate) fn sizes(finding: &EffectFinding) -> String {
    let size = |c: &CoefficientFigures| format!("{} = {}", c.name, with_error(c.value, c.std_error, c.unit));
    finding.coefficients.iter().map(size).collect::<Vec<_>>().join(", ")
}

fn rms_fall(finding: &EffectFinding) -> String {
    let fall = percent(finding.rms_fall_percent());
    format!("the {} falls by {fall} %", rms_of(finding.judged_axes()))
}

/// Nothing is a claim: it says what would have been seen.
fn nothing_named(unexplained: Option<&Unexplained>, visible_loss: Option<f64>) -> String {
    match unexplained {
        Some(Unexplained { axis, depends_on: Dependence::Constant, p_value, .. }) => {
            return format!(
                "The rotors share the load differently than in the model's flights, most of all on {axis} ({}), and no \
                 known change explains it.",
                p_equation(*p_value)
            );
        }
        Some(worst) => {
            return format!(
                "No change stands out, and yet these flights are not what the model says: {}.",
                unaccounted(worst)
            );
        }
        None => {}
    }
    let nothing = "No change stands out from the scatter between the flights that the model was fitted to.";
    match visible_loss.filter(|loss| *loss < 1.0) {
        None => nothing.into(),
        Some(loss) => {
            let loss = percent(100.0 * loss);
            format!(
                "{nothing} A motor that had lost {loss} % of its thrust in all of these flights would have stood out."
            )
        }
    }
}

/// "the residual of r has a constant offset (99 % of its squared error), and no known change explains it"
fn unaccounted(worst: &Unexplained) -> String {
    format!(
        "the residual of {} {} ({} % of its squared error), and no known change explains it",
        worst.axis,
        worst.depends_on.predicate(),
        percent(worst.share_percent)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::truth;

    fn found(effect: Effect, motor: Option<u8>, supported: bool) -> Found {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        (finding.supported, finding.motor) = (supported, motor);
        (Change { effect, motor }, finding)
    }

    fn of_rows(findings: Vec<Found>) -> OfRows {
        let with = truth();
        OfRows { findings, began: None, happened: Vec::new(), with, revealed: Vec::new(), left: Vec::new() }
    }

    #[test]
    fn a_tilted_rotor_leads_what_it_is_the_cause_of() {
        let with_drop = |effect, motor, drop_percent| {
            let (change, mut finding) = found(effect, motor, true);
            finding.drop_percent = drop_percent;
            (change, finding)
        };
        let first = |tilt_drop_percent| {
            let mut rows = of_rows(vec![
                with_drop(Effect::MotorEfficiency, None, 50.0),
                with_drop(Effect::ComOffset, None, 99.0),
                with_drop(Effect::MotorTilt, Some(3), tilt_drop_percent),
            ]);
            rows.happened = rows.findings.iter().map(|(change, _)| *change).collect();
            let diagnosis = conclude(&truth(), rows, None);
            diagnosis.effects.iter().map(|finding| finding.effect).collect::<Vec<_>>()
        };
        assert_eq!(first(90.0), [Effect::MotorTilt, Effect::MotorEfficiency, Effect::ComOffset]);
        assert_eq!(first(20.0), [Effect::MotorEfficiency, Effect::ComOffset, Effect::MotorTilt]);
    }

    fn answer(findings: Vec<Found>, p_value: f64) -> Answer {
        Answer { findings, p_value, most: (Axis::P, 62.0), visible_loss: 0.0643, since: None }
    }

    /// The thesis' model, with these errors on held-out flights.
    fn model(r2_of_p: f64) -> Model {
        let mut model = Model::thesis();
        let mut fit = model::FitRecord::default();
        (fit.held_out[Axis::P].r2, fit.held_out[Axis::Q].r2) = (r2_of_p, 0.7);
        fit.held_out[Axis::P].samples = 100;
        model.fit = Some(fit);
        model
    }

    /// Of a model flown in calm air, in a wind of 5 m/s.
    #[test]
    fn what_the_balance_finds_in_a_strong_wind_may_be_its_moment() {
        let mut model = truth();
        let wind = |effect: Effect| {
            let mut wind = found(effect, None, true);
            let info = &effect.info().coefficients[0];
            wind.1.coefficients = vec![CoefficientFigures::new(info, 5.0, 0.1, &truth())];
            wind
        };
        for (flown_m_s, effect, stays) in [
            (2.0, Effect::SteadyWind, false),
            (6.0, Effect::SteadyWind, true),
            (2.0, Effect::MassChange, true),
        ] {
            let fit = model::FitRecord { flown_speed_m_s: Some(flown_m_s), ..Default::default() };
            model.fit = Some(fit);
            let shifted = found(Effect::ComOffset, None, true);
            let weak = found(Effect::MotorEfficiency, Some(2), true);
            let mut all = vec![shifted, weak, wind(effect)];
            refuse_moments_of_wind(&model, &mut all);
            let supported = all.iter().map(|(_, finding)| finding.supported).collect::<Vec<_>>();
            assert_eq!(supported, [stays, stays, true], "{flown_m_s} {effect}");
        }
    }

    #[test]
    fn a_beginning_is_within_a_flight_or_before_it() {
        let since = |before_flight| Since {
            flight: "B.csv".into(),
            t_s: 12.0,
            before_flight,
            t_low_s: 10.94,
            t_high_s: 13.2,
        };
        assert_eq!(beginning(None, &since(false)), " It began in flight B.csv at 12.0 s (10.9 to 13.2 s).");
        assert_eq!(beginning(None, &since(true)), " It began before flight B.csv, or in its first 13.2 s.");
    }

    #[test]
    fn nothing_that_stands_out_is_said_so_and_what_does_with_its_size_and_rivals() {
        let nothing =
            "No change stands out from the scatter between the flights that the model was fitted to.";
        assert_eq!(summary(Verdict::Adequate, (None, &[]), None, None), nothing);
        assert_eq!(
            summary(Verdict::Adequate, (None, &[]), None, Some(0.0643)),
            format!(
                "{nothing} A motor that had lost 6.4 % of its thrust in all of these flights would have stood out."
            )
        );
        let mut named = found(Effect::MassChange, None, true);
        named.1.drop_percent = 61.27;
        let (name, unit) = ("extra_mass", "kg");
        named.1.coefficients =
            vec![CoefficientFigures { name, value: 0.1512, std_error: 0.0123, unit, possible: (-1.0, 1.0) }];
        let rivals = vec![Change { effect: Effect::MotorEfficiency, motor: Some(2) }];
        named.1.reason = Reason::Changed { axes: Effect::MassChange.info().axes, percent: 61.27, rivals };
        assert_eq!(
            summary(Verdict::MissingEffect, (Some(&named), &[]), None, None),
            "Since the model was fitted, one thing has changed: mass-change (extra_mass = 0.151 ± 0.012 kg). With it, \
             the rms error of w falls by 37.8 % on flights that it was not estimated from. These flights \
             cannot tell it from motor-efficiency of motor 2."
        );
        named.1.tracker_tilt_deg = Some(1.52);
        let said = summary(Verdict::MissingEffect, (Some(&named), &[]), None, None);
        assert!(said.ends_with("a tracker whose vertical is 1.5° off looks the same."), "{said}");
        named.1.tracker_tilt_deg = None;
        named.1.reason = Reason::BalanceShifted { percent: 61.27, rivals: Vec::new() };
        assert!(
            summary(Verdict::MissingEffect, (Some(&named), &[]), None, None).ends_with(
                "61.3 % of the shift in the rotors' steady balance is explained, on flights that it was not estimated from."
            ),
            "{}",
            summary(Verdict::MissingEffect, (Some(&named), &[]), None, None)
        );
    }

    #[test]
    fn where_the_rotation_is_not_identified_only_the_balance_speaks_of_moments() {
        let rows =
            || of_rows(vec![found(Effect::ComOffset, None, true), found(Effect::SteadyWind, None, false)]);
        let weak = || found(Effect::MotorEfficiency, Some(4), true);
        let best = |model: &Model, by: Vec<Found>| conclude(model, rows(), Some(answer(by, 0.5))).best();
        assert_eq!(best(&model(0.6), vec![weak()]), Some(Effect::ComOffset));
        assert_eq!(best(&model(-0.1), vec![weak()]), Some(Effect::MotorEfficiency));
        assert_eq!(best(&model(-0.1), Vec::new()), None);
    }

    #[test]
    fn what_the_rows_do_not_notice_the_balance_may() {
        let rows = vec![found(Effect::MotorEfficiency, Some(4), false)];
        let by = vec![found(Effect::MotorEfficiency, Some(4), true)];
        let diagnosis = conclude(&model(0.6), of_rows(rows), Some(answer(by, 1e-6)));
        assert_eq!(diagnosis.verdict, Verdict::MissingEffect);
        assert_eq!(diagnosis.effects.len(), 1);
    }

    #[test]
    fn a_shift_that_no_change_explains_is_unexplained_and_never_adequate() {
        let diagnosis =
            |p_value: f64| conclude(&model(-0.1), of_rows(Vec::new()), Some(answer(Vec::new(), p_value)));
        assert_eq!(diagnosis(0.4).verdict, Verdict::Adequate);
        let unknown = diagnosis(1e-4);
        assert_eq!(unknown.verdict, Verdict::Unexplained);
        assert_eq!((unknown.unexplained[0].axis, unknown.unexplained[0].share_percent), (Axis::P, 62.0));
        assert!(unknown.summary.contains("most of all on p"), "{}", unknown.summary);
    }
}
