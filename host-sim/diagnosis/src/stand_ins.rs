//! What the supported effects leave, and which of them are therefore stand-ins for something that nobody looked for.

use model::{Axis, Effect, Model};
use schemars::JsonSchema;
use serde::Serialize;
use sysid::prepare::Prepared;

use crate::criteria::{ABOVE_NOISE, LEFT_BY_THE_RIGHT, Left, stand_in};
use crate::finding::{Diagnosis, EffectFinding, Unexplained};
use crate::held_out::Validated;
use crate::noise;
use crate::reason::Reason;

/// Fall of the squared error of one axis, percent, from which on an effect that was refused may well be there.
const MUCH_PERCENT: f64 = 50.0;

/// An effect that takes much of the error, and was refused because of what it leaves: it stands for something unknown, or is there beside
/// it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct StandIn {
    /// Which.
    pub effect: Effect,
    /// The axis that it takes most of.
    pub axis: Axis,
    /// Fall of the held-out squared error of that axis, percent.
    pub drop_percent: f64,
    /// Why it was refused.
    pub reason: Reason,
}

/// What an effect that was refused because of what it leaves takes of the squared error of an axis, percent, where that is much.
pub(crate) fn taken_in_part(finding: &EffectFinding, axis: Axis) -> Option<f64> {
    let taken = finding.axes.get(axis.name())?.drop_percent;
    (finding.reason.is_stand_in() && taken >= MUCH_PERCENT).then_some(taken)
}

impl Diagnosis {
    /// The effects that take much of the error, and were refused because of what they leave.
    pub fn stand_ins(&self) -> Vec<StandIn> {
        let of = |finding: &EffectFinding| {
            let axis = finding.main_axis()?;
            let drop_percent = taken_in_part(finding, axis)?;
            Some(StandIn { effect: finding.effect, axis, drop_percent, reason: finding.reason.clone() })
        };
        self.effects.iter().filter_map(of).collect()
    }

    /// A model with the load that takes much of the error and was refused because of what it leaves, if there is such a one.
    pub(crate) fn with_refused_load(&self, model: &Model) -> Option<Model> {
        let is_load = |finding: &&EffectFinding| {
            let taken = finding.main_axis().and_then(|axis| taken_in_part(finding, axis));
            taken.is_some() && finding.effect.info().special.hangs_load
        };
        let load = self.effects.iter().find(is_load)?;
        let values: Vec<f64> = load.coefficients.iter().map(|c| c.value).collect();
        let mut model = model.clone();
        model.set(load.effect, &values);
        Some(model)
    }
}

/// Takes back the support of every stand-in. Returns whether there was any.
pub(crate) fn refuse_stand_ins(findings: &mut [EffectFinding], left: &Left<'_>) -> bool {
    let mut any = false;
    for finding in findings.iter_mut().filter(|f| f.supported) {
        if let Some(reason) = stand_in(finding, left) {
            finding.refuse(reason);
            any = true;
        }
    }
    any
}

/// Axes whose residual is well above the sensors' noise without depending on a measured quantity: with what frequency.
pub(crate) fn above_noise(
    ratios: &[Option<f64>; 6],
    rest: &Validated,
    validate: &[&Prepared],
) -> Vec<Unexplained> {
    model::AXES
        .into_iter()
        .filter_map(|axis| {
            let ratio = ratios[axis.index()].filter(|ratio| *ratio > ABOVE_NOISE)?;
            let depends_on = noise::strongest_frequency(validate, &rest.held_out, axis.index());
            Some(Unexplained { axis, depends_on, share_percent: 100.0 * (1.0 - 1.0 / ratio), p_value: 0.0 })
        })
        .collect()
}

/// Axes on which the effects found leave more of the residual's excess over the noise than right ones would.
pub(crate) fn incomplete(before: &[Option<f64>; 6], after: &[Option<f64>; 6]) -> [bool; 6] {
    std::array::from_fn(|axis| match (before[axis], after[axis]) {
        (Some(before), Some(after)) => {
            after > ABOVE_NOISE && (after - 1.0) > LEFT_BY_THE_RIGHT * (before - 1.0)
        }
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conclusion::conclude;
    use crate::dependence::Dependence;
    use crate::finding::{AxisDrop, CoefficientFigures};
    use crate::testing::truth;

    fn taking(effect: Effect, drops: &[(&'static str, f64)]) -> EffectFinding {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        finding.supported = true;
        for (axis, percent) in drops {
            finding.axes.insert(axis, AxisDrop::new(100.0, 100.0 - percent));
        }
        finding
    }

    fn height_in_w(share_percent: f64) -> Vec<Unexplained> {
        let depends_on = Dependence::Quantity("height");
        vec![Unexplained { axis: Axis::W, depends_on, share_percent, p_value: 0.0 }]
    }

    #[test]
    fn an_effect_that_leaves_more_than_it_takes_is_refused_and_the_others_are_not() {
        let mut findings =
            [taking(Effect::SteadyWind, &[("u", 9.0)]), taking(Effect::TranslationalLift, &[("w", 9.0)])];
        let unexplained = height_in_w(9.5);
        let left = Left { unexplained: &unexplained, incomplete: [false; 6], answers_late: false };
        assert!(refuse_stand_ins(&mut findings, &left));
        assert!(findings[0].supported && !findings[1].supported);
        assert!(matches!(findings[1].reason, Reason::LeavesMore { axis: Axis::W, .. }));
        let fewer = height_in_w(8.5);
        let left = Left { unexplained: &fewer, incomplete: [false; 6], answers_late: false };
        assert!(!refuse_stand_ins(&mut findings[..1], &left));
    }

    #[test]
    fn an_axis_that_stays_above_the_noise_refuses_what_acts_most_on_it() {
        let excess = |w: f64| [None, Some(1.0), Some(w), None, None, None];
        // Of an excess of 100, right effects may leave 3.
        assert!(incomplete(&excess(101.0), &excess(4.1))[Axis::W.index()]);
        assert!(!incomplete(&excess(101.0), &excess(3.9))[Axis::W.index()]);
        assert!(!incomplete(&excess(1.7), &excess(1.55))[Axis::W.index()], "within the noise");
        let incomplete = incomplete(&excess(5.0), &excess(4.0));
        let left = Left { unexplained: &[], incomplete, answers_late: false };
        let mut findings = [
            taking(Effect::SteadyWind, &[("u", 50.0), ("w", 20.0)]),
            taking(Effect::GroundEffect, &[("w", 50.0)]),
        ];
        assert!(refuse_stand_ins(&mut findings, &left));
        assert!(findings[0].supported);
        assert_eq!(findings[1].reason, Reason::AboveNoise { axis: Axis::W });
    }

    #[test]
    fn what_takes_most_of_an_axis_is_told_though_it_was_refused() {
        let of = |effect: Effect, percent: f64, reason: Reason| {
            let mut finding = taking(effect, &[("u", 10.0), ("w", percent)]);
            finding.refuse(reason);
            finding
        };
        let above = Reason::AboveNoise { axis: Axis::W };
        let findings = vec![
            of(Effect::GroundEffect, 94.0, above.clone()),
            of(Effect::BatteryVoltage, 49.0, above.clone()),
            of(Effect::TranslationalLift, 90.0, Reason::LikeChance),
        ];
        let told = conclude(findings, Vec::new(), Vec::new()).stand_ins();
        let expected =
            StandIn { effect: Effect::GroundEffect, axis: Axis::W, drop_percent: 94.0, reason: above };
        assert_eq!(told, [expected]);
    }

    #[test]
    fn a_load_that_was_refused_for_what_it_leaves_hangs_on_the_model_and_another_one_does_not() {
        let model = truth();
        let refused = |percent: f64, reason: Reason| {
            let mut finding = taking(Effect::SlungLoad, &[("u", percent)]);
            let coefficient = |(name, value)| CoefficientFigures {
                name,
                value,
                std_error: 0.01,
                unit: "",
                possible: (0.0, 10.0),
            };
            let values = [("load_mass", 0.1), ("cable_length", 0.5), ("damping_ratio", 0.02)];
            finding.coefficients = values.map(coefficient).to_vec();
            finding.refuse(reason);
            conclude(vec![finding], Vec::new(), Vec::new()).with_refused_load(&model)
        };
        let loaded = refused(72.0, Reason::AboveNoise { axis: Axis::U }).unwrap();
        assert_eq!(loaded.term(Effect::SlungLoad).unwrap().values(), [0.1, 0.5, 0.02]);
        assert_eq!(refused(72.0, Reason::LikeChance), None);
        assert_eq!(refused(42.0, Reason::AboveNoise { axis: Axis::U }), None);
    }

    #[test]
    fn a_late_answer_refuses_effects_of_the_actuators_alone() {
        let mut findings = [taking(Effect::MotorLag, &[("w", 50.0)]), taking(Effect::Tether, &[("u", 50.0)])];
        let left = Left { unexplained: &[], incomplete: [false; 6], answers_late: true };
        assert!(refuse_stand_ins(&mut findings, &left));
        assert_eq!(findings[0].reason, Reason::AnswersLate);
        assert!(findings[1].supported);
    }
}
