//! What makes a finding: every rule with its threshold, in one place. A diagnosis, `--why` and a search for changes read it.
//!
//! An effect is **supported** when all of [`RULES`] hold that apply to it. With everything in place that is supported, what is
//! left must be what the right effects would leave ([`stand_in`]).

use model::{Axis, Effect, Estimate, Model, Requirement};
use sysid::fit::linearise::step_scale;
use sysid::fit::pieces;

use crate::change::Change;
use crate::finding::{CoefficientFigures, EffectFinding, Unexplained};
use crate::leaning::{Leaning, PUSH_ERRORS, YAW_PERCENT};
use crate::reason::Reason;

/// Largest corrected p-value of a finding's coefficients. With some twenty candidates corrected for, one model in a hundred is
/// given an effect that it does not have by this rule alone.
pub(crate) const SIGNIFICANCE: f64 = 0.01;
/// Largest corrected p-value of a change that takes away most of the error. A scatter known from a handful of flights makes
/// even a large change uncertain; a small one must be certain.
const LARGE_SIGNIFICANCE: f64 = 0.05;
/// Part of the error, percent, from which on a change takes away most of it.
const LARGE_PERCENT: f64 = 50.0;
/// Largest p-value of the held-out gain. It confirms what is significant already, on other flights.
pub(crate) const HELD_OUT_SIGNIFICANCE: f64 = 0.05;
/// Smallest held-out drop, percent of an axis' squared error, that matters: its root is under a hundredth of the error.
pub(crate) const MATTERS_PERCENT: f64 = 1.5;
/// Least part of the held-out flights that must improve, percent: more than half. A single flight must improve.
const FLIGHTS_PERCENT: f64 = 50.1;
/// Rise of the held-out squared error of an axis, percent, from which on it counts against an effect, where it is beyond chance.
pub(crate) const RISE_PERCENT: f64 = 5.0;
/// Most that an effect may lose by such rises, percent of what it gains by the falls, both as logarithms. A battery that sags takes nearly all
/// of the error in thrust away, whatever becomes of the pitch (4 %); a cable that makes half of the error to the side its own and adds a
/// fifth forward and down is fitted to something else (60 %).
const HARM_PERCENT: f64 = 33.0;
/// Fewest swings of a load over one stretch of a flight: the free beginning of one or two follows any slow drift of a tracker or a trim.
const SWINGS: f64 = 3.0;
/// Part of an effect that rows at low frequency must show at least: what is physics is all there, within its errors.
const AT_LOW_FREQUENCY: f64 = 0.5;
/// p-value under which rows at low frequency contradict all rows.
const CONTRADICTION: f64 = 0.01;
/// How far under the floor a cable may end, m: the floor of a log need not be exactly at zero.
const DEEPEST_M: f64 = 1.0;
/// A coefficient is impossible that lies this many standard errors outside its range: what 95 % intervals allow.
const IMPOSSIBLE_ERRORS: f64 = 2.0;
/// The same beside a possible coefficient of the effect that is firm, and from how many standard errors off zero on it is: a craft with
/// quadratic drag along its arms and none along its axis is as likely as not to have a little of the wrong sign there.
const IMPOSSIBLE_ERRORS_BESIDE: f64 = 4.0;
const FIRM_ERRORS: f64 = 10.0;

/// Residual variance over that of the sensors' noise from which on something is missing. Complete models scatter from
/// 0.8 to 1.25 on two flights of 24 s.
pub(crate) const ABOVE_NOISE: f64 = 1.6;
/// Part of the excess over the noise that the right effects may leave. In simulated flights they leave none; a formula that
/// is only nearly right leaves a hundredth, a stand-in for something else a twentieth or more.
pub(crate) const LEFT_BY_THE_RIGHT: f64 = 0.03;
/// Part of the squared error of an axis, percent, that must fall with what is found once stand-ins have been refused: the flights are asked
/// a second time, when it is known that something looks like what is missing. A battery that sags takes nine tenths of thrust's.
const AFTER_STAND_INS_PERCENT: f64 = 75.0;
/// Most that winds of the flights' own may leave of the horizontal forces, of what an effect leaves that was found in one wind: they
/// have two numbers for each flight, and follow small differences of trim as well. In calm air they leave three quarters
/// of what a tilted attitude leaves, or more; before a fan wall, a tenth of what a cable leaves that was found in its place.
pub(crate) const LEFT_BY_OWN_WINDS: f64 = 0.5;
/// The same where nothing was found, of what the model leaves: winds of a few tenths of a metre a second, which trims differ by in calm air,
/// may leave less than half of it; before a fan wall they leave a hundredth.
pub(crate) const LEFT_BY_OWN_WINDS_ALONE: f64 = 0.1;

/// An effect answers for what is left of an axis of which it takes away this part of its largest drop: half, so that one of two
/// axes that it moves alike does not excuse the other, and one on which it hardly acts does not speak against it.
const OWN_AXIS: f64 = 0.5;

/// Smallest share of an axis' held-out squared error that counts as structure, percent.
pub(crate) const STRUCTURE_PERCENT: f64 = 3.0;
/// Largest corrected p-value of structure.
pub(crate) const STRUCTURE_SIGNIFICANCE: f64 = 0.01;
/// Smallest share that the past explains. Its eight free coefficients follow what a model of the rotors' first-order lag
/// leaves, too: complete models of flights of another simulator show up to 4 % in yaw.
pub(crate) const PAST_PERCENT: f64 = 10.0;
/// Share of those of thrust, in the mean, that refutes an effect of the rotors. Right ones in logs with jittering times leave
/// up to 5 %.
pub(crate) const LATE_PERCENT: f64 = 6.0;

/// Logarithm of the likelihood ratio under which two sets do equally well: odds of 20 to 1.
pub(crate) const TIE: f64 = 3.0;
/// A rival with this part of the best change's gain is examined for confusion with it.
pub(crate) const RIVAL: f64 = 0.7;
/// One with this part of it is confounded with it whatever more they explain together: a weight under a motor is both a
/// shifted centre of mass and, nearly, a motor that gives less thrust.
pub const AS_GOOD: f64 = 0.9;
/// Part of its gain that a change loses in rank for each coefficient: of two that explain as much, the simpler comes first.
const FOR_A_COEFFICIENT: f64 = 0.02;

/// What changes are ranked by, from their gain and the number of their coefficients.
pub fn rank_of_change(gain: f64, coefficients: usize) -> f64 {
    gain * (1.0 - FOR_A_COEFFICIENT * coefficients as f64)
}

/// What the flights are asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Asked {
    /// What does the model lack?
    Missing,
    /// What has changed since the model was good?
    Changed,
}

/// What the rules look at.
#[derive(Debug, Clone)]
pub(crate) struct Evidence<'a> {
    pub(crate) asked: Asked,
    pub(crate) finding: &'a EffectFinding,
    /// Standard errors of its coefficients, without what flights differ by anyway.
    pub(crate) std_errors: Vec<f64>,
    /// Of a rotor that leans.
    pub(crate) leaning: Option<Leaning>,
    /// Without a motor map, rotor "speeds" are commands and ranges in rad/s mean nothing.
    pub(crate) has_rotor_map: bool,
}

impl<'a> Evidence<'a> {
    /// For an effect that `model` may lack.
    pub(crate) fn missing(finding: &'a EffectFinding, model: &Model) -> Self {
        Self {
            asked: Asked::Missing,
            finding,
            std_errors: finding.coefficients.iter().map(|c| c.std_error).collect(),
            leaning: None,
            has_rotor_map: model.vehicle.has_rotor_map(),
        }
    }

    fn effect(&self) -> Effect {
        self.finding.effect
    }

    /// Each coefficient with its definition and its standard error.
    fn coefficients(&self) -> impl Iterator<Item = (&CoefficientFigures, &'static model::Coefficient, f64)> {
        let free = Change { effect: self.effect(), motor: self.finding.motor }.coefficients();
        let info = self.effect().info();
        let all = self.finding.coefficients.iter().zip(&self.std_errors).zip(free);
        all.map(|((figures, error), k)| (figures, &info.coefficients[k], *error))
    }

    /// What the effect's own rule looks at.
    fn estimates(&self) -> Vec<Estimate> {
        let estimate = |c: &CoefficientFigures| Estimate { value: c.value, std_error: Some(c.std_error) };
        self.finding.coefficients.iter().map(estimate).collect()
    }
}

/// One rule of support.
#[derive(Debug)]
pub(crate) struct Rule {
    /// For people: what is asked.
    pub(crate) question: &'static str,
    /// Unit of value and threshold, empty for a probability.
    pub(crate) unit: &'static str,
    /// Whether the value must be at most (rather than at least) the threshold.
    pub(crate) at_most: bool,
    /// Value and threshold; nothing where the rule does not apply.
    figures: fn(&Evidence<'_>) -> Option<(f64, f64)>,
    /// Why an effect is not supported that breaks the rule: from the evidence, the value and the threshold.
    objection: fn(&Evidence<'_>, f64, f64) -> Reason,
}

/// A rule applied to evidence.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Applied {
    /// For people: what is asked.
    pub(crate) question: &'static str,
    /// Unit of value and threshold, empty for a probability.
    pub(crate) unit: &'static str,
    /// Whether the value must be at most (rather than at least) the threshold.
    pub(crate) at_most: bool,
    /// The rule; none for the effect's own.
    rule: Option<&'static Rule>,
    pub(crate) value: f64,
    pub(crate) threshold: f64,
    pub(crate) met: bool,
}

/// Every rule, in the order in which reasons are given.
pub(crate) const RULES: &[Rule] = &[
    Rule {
        question: "differs from zero: p-value of its coefficients, corrected for the number of candidates",
        unit: "",
        at_most: true,
        figures: |e| Some((e.finding.p_value, significance(e))),
        objection: |e, p_value, _| match e.asked {
            Asked::Missing => not_excited(e).unwrap_or(Reason::LikeChance),
            Asked::Changed => Reason::WithinScatter { p_value },
        },
    },
    Rule {
        question: "matters: largest drop of the held-out squared error of an axis",
        unit: "%",
        at_most: false,
        figures: |e| Some((e.finding.largest_drop_percent(), matters_percent(e.effect()))),
        objection: |_, largest_percent, matters_percent| Reason::TooSmall {
            largest_percent,
            matters_percent,
        },
    },
    Rule {
        question: "holds on new flights: p-value of the drop on held-out flights",
        unit: "",
        at_most: true,
        figures: |e| e.finding.held_out_p_value.map(|p| (p, HELD_OUT_SIGNIFICANCE)),
        objection: |e, p_value, _| not_borne_out(e, Some(p_value)),
    },
    Rule {
        question: "holds on most flights: share of the held-out flights that improve",
        unit: "%",
        at_most: false,
        figures: |e| {
            let [improved, flights] = e.finding.flights_improved;
            Some((100.0 * improved as f64 / flights.max(1) as f64, FLIGHTS_PERCENT))
        },
        objection: |e, _, _| not_borne_out(e, None),
    },
    Rule {
        question: "does little harm: loss on axes whose held-out error rises beyond chance, as a share of the gain on the others",
        unit: "%",
        at_most: true,
        figures: |e| match e.asked {
            Asked::Missing => Some((e.finding.harm_percent, HARM_PERCENT)),
            Asked::Changed => None,
        },
        objection: |e, _, _| harm(e.finding).unwrap_or(Reason::LikeChance),
    },
    Rule {
        question: "swings and does not drift: swings of the load in the longest stretch of a flight",
        unit: "swings",
        at_most: false,
        figures: |e| e.finding.swing.map(|swing| (swing.count, SWINGS)),
        objection: |e, swings, _| Reason::TooFewSwings { swings, excitation: e.effect().info().excitation },
    },
    Rule {
        question: "moves the craft as it swings: drop of the held-out squared error of u and v at frequencies up to its swing",
        unit: "%",
        at_most: false,
        figures: |e| Some((e.finding.swing?.drop_percent?, MATTERS_PERCENT)),
        objection: |e, drop_percent, _| Reason::QuickerThanItsSwing {
            up_to_hz: e.finding.swing.map_or(0.0, |swing| swing.up_to_hz),
            drop_percent,
        },
    },
    Rule {
        question: "persists at low frequency, where less than half of it shows: p-value of equal coefficients",
        unit: "",
        at_most: false,
        figures: |e| {
            let low = e.finding.at_low_frequency.filter(|low| low.part < AT_LOW_FREQUENCY)?;
            Some((low.same_p_value, CONTRADICTION))
        },
        objection: |e, p_value, _| Reason::NotAtLowFrequency {
            part_percent: e.finding.at_low_frequency.map_or(0.0, |low| 100.0 * low.part),
            p_value,
        },
    },
    Rule {
        question: "is possible: how far the worst coefficient lies outside its range",
        unit: "std. errors",
        at_most: true,
        figures: |e| {
            let has_range = e.has_rotor_map || !e.effect().info().is_in_rotor_speed();
            let distances = e.coefficients().map(|(c, _, error)| beyond(c, error));
            has_range.then(|| (distances.fold(0.0, f64::max), most_beyond(e)))
        },
        objection: |e, _, most| impossible(e, most),
    },
    Rule {
        question: "pushes sideways: the larger of its pushes forward and to the right",
        unit: "std. errors",
        at_most: false,
        figures: |e| e.leaning.map(|leaning| (leaning.push_errors, PUSH_ERRORS)),
        objection: |_, _, _| Reason::YawAlone,
    },
    Rule {
        question: "is one rotor's: difference of its yaw from its lever times its sideways push, as a share of what is allowed",
        unit: "%",
        at_most: true,
        figures: |e| e.leaning.map(|leaning| (leaning.difference_percent, 100.0)),
        objection: |_, _, _| Reason::YawWithoutPush,
    },
    Rule {
        question: "yaws the craft, where the model leaves the translation of its own flights unexplained: yaw as a share of a reaction torque",
        unit: "%",
        at_most: false,
        figures: |e| e.leaning.filter(|of| of.push_is_doubted).map(|of| (of.yaw_percent, YAW_PERCENT)),
        objection: |_, _, _| Reason::PushWithoutYaw,
    },
    Rule {
        question: "ends within reach: distance of the cable's end from the flights, less two standard errors",
        unit: "m",
        at_most: true,
        figures: |e| e.finding.anchor.map(|anchor| (anchor.distance_m, anchor.reach_m)),
        objection: |e, _, _| no_anchor(e),
    },
    Rule {
        question: "ends above ground: depth of the cable's end under the floor, less two standard errors",
        unit: "m",
        at_most: true,
        figures: |e| e.finding.anchor.map(|anchor| (anchor.depth_m, DEEPEST_M)),
        objection: |e, _, _| no_anchor(e),
    },
];

/// Every rule that applies, with what was found and what is needed.
pub(crate) fn applied(evidence: &Evidence<'_>) -> Vec<Applied> {
    let apply = |rule: &'static Rule| {
        let (value, threshold) = (rule.figures)(evidence)?;
        let met = if rule.at_most { value <= threshold } else { value >= threshold };
        let Rule { question, unit, at_most, .. } = *rule;
        Some(Applied { question, unit, at_most, rule: Some(rule), value, threshold, met })
    };
    RULES.iter().filter_map(apply).chain(own_rule(evidence)).collect()
}

/// What the effect's own file asks of its estimates.
fn own_rule(evidence: &Evidence<'_>) -> Option<Applied> {
    let Requirement { question, unit, figures, .. } = evidence.effect().info().special.requirement?;
    if evidence.finding.coefficients.is_empty() {
        return None;
    }
    let (value, threshold) = figures(&evidence.estimates());
    Some(Applied { question, unit, at_most: false, rule: None, value, threshold, met: value >= threshold })
}

/// Whether the evidence suffices, and why or why not.
pub(crate) fn weigh(evidence: &Evidence<'_>) -> (bool, Reason) {
    if let Some(broken) = applied(evidence).into_iter().find(|applied| !applied.met) {
        let reason = match broken.rule {
            Some(rule) => (rule.objection)(evidence, broken.value, broken.threshold),
            None => Reason::OwnRule { effect: evidence.effect(), first: evidence.estimates()[0] },
        };
        return (false, reason);
    }
    let percent = evidence.finding.drop_percent;
    let [improved, flights] = evidence.finding.flights_improved;
    let axes = evidence.finding.judged_axes();
    let reason = match evidence.asked {
        Asked::Missing => Reason::ErrorFalls { axes, percent, improved, flights },
        Asked::Changed => Reason::Changed { axes, percent, rivals: Vec::new() },
    };
    (true, reason)
}

fn significance(evidence: &Evidence<'_>) -> f64 {
    let is_large = evidence.finding.drop_percent > LARGE_PERCENT;
    if evidence.asked == Asked::Changed && is_large { LARGE_SIGNIFICANCE } else { SIGNIFICANCE }
}

/// Smallest held-out drop of an effect that matters, percent: what the free beginnings of a load's swing take away by chance
/// is none of its doing.
fn matters_percent(effect: Effect) -> f64 {
    MATTERS_PERCENT + if effect.info().special.hangs_load { pieces::BY_CHANCE_PERCENT } else { 0.0 }
}

/// Why an effect makes a model worse on an axis by more than it makes it better on others; nothing where it does not.
pub(crate) fn harm(finding: &EffectFinding) -> Option<Reason> {
    let (axis, percent) = finding.rise.filter(|_| finding.harm_percent > HARM_PERCENT)?;
    Some(Reason::HarmsAxis { axis, percent })
}

/// "Not seen" is not "not there": when an effect of ordinary size would hide in the error of its estimate, say so and
/// what to fly.
fn not_excited(evidence: &Evidence<'_>) -> Option<Reason> {
    let hidden = |(k, (c, info, _)): (usize, (&CoefficientFigures, &model::Coefficient, f64))| {
        let ordinary = step_scale(evidence.has_rotor_map, evidence.effect(), k);
        info.prior.is_none() && 2.0 * c.std_error > ordinary
    };
    let excitation = evidence.effect().info().excitation;
    evidence.coefficients().enumerate().any(hidden).then_some(Reason::HiddenByItsError { excitation })
}

fn not_borne_out(evidence: &Evidence<'_>, p_value: Option<f64>) -> Reason {
    let [improved, flights] = evidence.finding.flights_improved;
    Reason::NotBorneOut { improved, flights, p_value }
}

/// Distance of a coefficient beyond its range, in standard errors.
fn beyond(figures: &CoefficientFigures, std_error: f64) -> f64 {
    let (low, high) = figures.possible;
    (low - figures.value).max(figures.value - high).max(0.0) / std_error.max(f64::MIN_POSITIVE)
}

/// How far a coefficient may lie outside its range, in standard errors.
fn most_beyond(evidence: &Evidence<'_>) -> f64 {
    let is_firm = |(figures, _, error): (&CoefficientFigures, &model::Coefficient, f64)| {
        beyond(figures, error) == 0.0 && figures.value.abs() > FIRM_ERRORS * error
    };
    if evidence.coefficients().any(is_firm) { IMPOSSIBLE_ERRORS_BESIDE } else { IMPOSSIBLE_ERRORS }
}

fn no_anchor(evidence: &Evidence<'_>) -> Reason {
    let place = evidence.finding.anchor.map(|anchor| anchor.place_ned_m);
    place.map_or(Reason::LikeChance, |place_ned_m| Reason::NoAnchor { place_ned_m })
}

/// The first coefficient that is impossible.
fn impossible(evidence: &Evidence<'_>, most: f64) -> Reason {
    let mut all = evidence.coefficients();
    let Some((c, _, _)) = all.find(|(c, _, error)| beyond(c, *error) > most) else {
        return Reason::LikeChance;
    };
    let CoefficientFigures { name, value, unit, possible, .. } = *c;
    Reason::Impossible { coefficient: name, value, unit, possible }
}

/// What a model with all supported effects leaves.
#[derive(Debug)]
pub(crate) struct Left<'a> {
    /// Structure in its residual.
    pub(crate) unexplained: &'a [Unexplained],
    /// Axes on which more of the residual's excess over the noise is left than right effects would leave.
    pub(crate) incomplete: [bool; 6],
    /// Whether an axis, or those of thrust together, answer to the last half second.
    pub(crate) answers_late: bool,
}

/// Why a supported effect is a stand-in for something else: naming it would be confidently wrong. One that
/// - says how rotors answer to commands, where what is left answers later still: air and parts that follow look like a slow or
///   an early rotor;
/// - acts most on an axis where all that was found together leaves a good part of the residual above the sensors' noise: the
///   right effects leave the noise and nothing else;
/// - leaves more structure on its own axes than it takes away there: those on which it takes away at least [`OWN_AXIS`] of
///   what it takes away most. A battery that sags takes away nearly all of the error in thrust, and is none the less the
///   battery because the roll drifts.
pub(crate) fn stand_in(finding: &EffectFinding, left: &Left<'_>) -> Option<Reason> {
    if left.answers_late && finding.effect.info().special.of_actuators {
        return Some(Reason::AnswersLate);
    }
    if let Some(axis) = finding.main_axis().filter(|axis| left.incomplete[axis.index()]) {
        return Some(Reason::AboveNoise { axis });
    }
    let takes_percent = finding.axes.values().map(|a| a.drop_percent).fold(0.0, f64::max);
    let is_own = |axis: Axis| {
        finding.axes.get(axis.name()).is_some_and(|a| a.drop_percent >= OWN_AXIS * takes_percent)
    };
    let on_its_axes = left.unexplained.iter().filter(|u| is_own(u.axis));
    let most = on_its_axes.max_by(|a, b| a.share_percent.total_cmp(&b.share_percent))?;
    (most.share_percent > takes_percent).then_some(Reason::LeavesMore {
        takes_percent,
        left_percent: most.share_percent,
        axis: most.axis,
        depends_on: most.depends_on,
    })
}

/// Whether what was found once stand-ins had been refused takes so much that it is no stand-in itself.
pub(crate) fn takes_most(findings: &[EffectFinding]) -> bool {
    let drops = findings.iter().filter(|f| f.supported).flat_map(|f| f.axes.values());
    drops.map(|drop| drop.drop_percent).fold(0.0, f64::max) >= AFTER_STAND_INS_PERCENT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dependence::Dependence;
    use crate::finding::AxisDrop;

    /// A heavier craft with every rule just met.
    fn heavier() -> EffectFinding {
        let info = &Effect::MassChange.info().coefficients[0];
        let mut finding = EffectFinding::unsupported(Effect::MassChange, 2, Reason::LikeChance);
        finding.p_value = SIGNIFICANCE;
        finding.held_out_p_value = Some(HELD_OUT_SIGNIFICANCE);
        finding.flights_improved = [2, 2];
        finding.drop_percent = 10.0;
        finding.axes.insert("w", AxisDrop { sse_before: 100.0, sse_after: 98.5, drop_percent: 1.5 });
        finding.coefficients = vec![CoefficientFigures {
            name: info.name,
            value: 0.1,
            std_error: 0.01,
            unit: info.unit,
            possible: info.possible,
        }];
        finding
    }

    fn weighed(finding: &EffectFinding, asked: Asked) -> (bool, Reason) {
        let std_errors = finding.coefficients.iter().map(|c| c.std_error).collect();
        weigh(&Evidence { asked, finding, std_errors, leaning: None, has_rotor_map: true })
    }

    /// The reason for which a finding is refused after a change.
    fn refused(change: impl Fn(&mut EffectFinding)) -> Reason {
        let mut finding = heavier();
        change(&mut finding);
        let (supported, reason) = weighed(&finding, Asked::Missing);
        assert!(!supported, "{reason}");
        reason
    }

    #[test]
    fn evidence_that_just_meets_every_rule_suffices() {
        let (supported, reason) = weighed(&heavier(), Asked::Missing);
        assert!(supported, "{reason}");
        let axes = Effect::MassChange.info().axes;
        assert_eq!(reason, Reason::ErrorFalls { axes, percent: 10.0, improved: 2, flights: 2 });
        let changed = weighed(&heavier(), Asked::Changed);
        assert_eq!(changed, (true, Reason::Changed { axes, percent: 10.0, rivals: Vec::new() }));
    }

    #[test]
    fn each_rule_by_itself_refuses() {
        assert_eq!(refused(|f| f.p_value = 0.0101), Reason::LikeChance);
        assert_eq!(
            refused(|f| f.axes.values_mut().for_each(|a| a.drop_percent = 1.49)),
            Reason::TooSmall { largest_percent: 1.49, matters_percent: 1.5 }
        );
        assert_eq!(
            refused(|f| f.held_out_p_value = Some(0.051)),
            Reason::NotBorneOut { improved: 2, flights: 2, p_value: Some(0.051) }
        );
        assert_eq!(
            refused(|f| f.flights_improved = [1, 2]),
            Reason::NotBorneOut { improved: 1, flights: 2, p_value: None }
        );
        assert!(matches!(refused(|f| f.axes.clear()), Reason::TooSmall { .. }));
        assert!(matches!(refused(|f| f.p_value = f64::NAN), Reason::LikeChance));
    }

    /// From -50 to 50 kg are possible.
    #[test]
    fn a_coefficient_may_lie_two_errors_outside_the_possible() {
        let at = |value: f64| {
            let mut finding = heavier();
            (finding.coefficients[0].value, finding.coefficients[0].std_error) = (value, 0.5);
            weighed(&finding, Asked::Missing).0
        };
        assert!(at(51.0) && at(-51.0) && !at(51.01) && !at(-51.01));
        let impossible = refused(|f| f.coefficients[0].value = 60.0);
        assert!(matches!(impossible, Reason::Impossible { value: 60.0, possible: (-50.0, 50.0), .. }));
    }

    /// Quadratic drag: no more than zero is possible.
    #[test]
    fn beside_a_firm_coefficient_it_may_be_four() {
        let at = |[along_arms, along_axis]: [f64; 2]| {
            let effect = Effect::QuadraticDrag;
            let figures = |(c, value): (&'static model::Coefficient, f64)| CoefficientFigures {
                name: c.name,
                value,
                std_error: 0.001,
                unit: c.unit,
                possible: c.possible,
            };
            let coefficients = effect.info().coefficients.iter().zip([along_arms, along_axis]);
            let finding =
                EffectFinding { effect, coefficients: coefficients.map(figures).collect(), ..heavier() };
            weighed(&finding, Asked::Missing).0
        };
        assert!(at([-0.0101, 0.004]) && !at([-0.0099, 0.004]) && !at([-0.0101, 0.0041]));
        assert!(at([-0.0099, 0.002]) && !at([0.02, 0.003]), "what is impossible itself is not firm");
    }

    #[test]
    fn one_of_ordinary_size_that_would_hide_in_its_error_says_what_to_fly() {
        let hidden = refused(|f| {
            f.p_value = 0.5;
            // Ordinary are 0.05 kg.
            f.coefficients[0].std_error = 0.026;
        });
        assert_eq!(hidden, Reason::HiddenByItsError { excitation: "hover, climb and descend" });
        let seen = refused(|f| {
            f.p_value = 0.5;
            f.coefficients[0].std_error = 0.024;
        });
        assert_eq!(seen, Reason::LikeChance);
    }

    #[test]
    fn a_change_that_takes_away_most_of_the_error_may_be_less_certain() {
        let mut finding = heavier();
        finding.p_value = 0.04;
        assert_eq!(weighed(&finding, Asked::Changed).1, Reason::WithinScatter { p_value: 0.04 });
        finding.drop_percent = 50.1;
        assert!(weighed(&finding, Asked::Changed).0);
        assert!(!weighed(&finding, Asked::Missing).0);
    }

    /// A twentieth of the error falls by the free beginnings of a swing alone.
    #[test]
    fn a_load_must_take_away_more_than_its_beginnings_do_by_chance() {
        assert!((matters_percent(Effect::SlungLoad) - 6.5).abs() < 1e-9);
        assert_eq!(matters_percent(Effect::MassChange), 1.5);
    }

    #[test]
    fn a_stand_in_is_told_by_what_it_leaves() {
        let mut finding = heavier();
        let nothing = Left { unexplained: &[], incomplete: [false; 6], answers_late: false };
        assert_eq!(stand_in(&finding, &nothing), None);
        // It acts on w.
        let incomplete = |axis: Axis| {
            let mut incomplete = [false; 6];
            incomplete[axis.index()] = true;
            Left { unexplained: &[], incomplete, answers_late: true }
        };
        assert_eq!(stand_in(&finding, &incomplete(Axis::W)), Some(Reason::AboveNoise { axis: Axis::W }));
        assert_eq!(stand_in(&finding, &incomplete(Axis::U)), None);
        let left = |axis, share_percent| {
            let depends_on = Dependence::Quantity("height");
            [Unexplained { axis, depends_on, share_percent, p_value: 0.0 }]
        };
        let more = left(Axis::W, 1.6);
        let leaves_more = stand_in(&finding, &Left { unexplained: &more, ..nothing });
        assert!(matches!(leaves_more, Some(Reason::LeavesMore { axis: Axis::W, .. })), "{leaves_more:?}");
        for unexplained in [left(Axis::W, 1.5), left(Axis::U, 50.0)] {
            let left = Left { unexplained: &unexplained, incomplete: [false; 6], answers_late: true };
            assert_eq!(stand_in(&finding, &left), None);
        }
        // It takes 1.5 % of w; of p, less than half of that is none of its business, and from there on it is.
        let more = left(Axis::P, 50.0);
        for (percent, is_own) in [(0.74, false), (0.76, true)] {
            finding.axes.insert("p", AxisDrop { sse_before: 100.0, sse_after: 0.0, drop_percent: percent });
            let refused = stand_in(&finding, &Left { unexplained: &more, ..nothing });
            assert_eq!(refused.is_some(), is_own, "{percent} %");
        }
        finding.effect = Effect::MotorLag;
        let late = Left { unexplained: &[], incomplete: [false; 6], answers_late: true };
        assert_eq!(stand_in(&finding, &late), Some(Reason::AnswersLate));
    }

    #[test]
    fn after_stand_ins_an_effect_must_take_most_of_an_axis() {
        let mut finding = heavier();
        finding.supported = true;
        for (percent, expected) in [(74.9, false), (75.0, true)] {
            finding.axes.insert("w", AxisDrop::new(100.0, 100.0 - percent));
            assert_eq!(takes_most(std::slice::from_ref(&finding)), expected, "{percent}");
        }
        finding.refuse(Reason::LikeChance);
        assert!(!takes_most(&[finding]) && !takes_most(&[]));
    }
}
