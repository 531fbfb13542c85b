//! The tracked point is not the centre of mass: the tracker sees the lever swing with the body (4.7).

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Requirement, Special};
use crate::effects::adjusting::Adjusting;

const fn coefficient(name: &'static str) -> Coefficient {
    // A marker further out than two arms is on no craft.
    Coefficient::new(name, "m", (-1.0, 1.0), 0.05).within_arms(2.0)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "tracking-offset",
    sentence: "The tracked point is not the centre of mass.",
    equation: r"\mathbf x_{tracked} = \mathbf x + R^T \mathbf l",
    source: Some("A. Szabo, thesis, Wright State University 2017, (4.7)"),
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::U, Axis::V, Axis::W],
    through: &["pitch_acceleration", "roll_acceleration", "pitch_acceleration"],
    coefficients: &[coefficient("lever_x"), coefficient("lever_y"), coefficient("lever_z")],
    excitation: "pitch, roll and yaw in short bursts about hover",
    confused_with: &[(
        "rate-coupling",
        "pitch and roll in short bursts: a tracked point off the centre of mass follows the angular acceleration, rate \
         coupling follows the rate",
    )],
    special: Special { requirement: Some(IS_MEASURABLE), ..Special::NOTHING },
};

/// Nearest distance of the tracked point from the centre of mass that is told, mm: as well as anybody balances a craft on an edge. Thrust that
/// depends on the squares of body rates looks like half a millimetre.
const TOLD_MM: f64 = 1.0;

const IS_MEASURABLE: Requirement = Requirement {
    question: "can be measured: distance of the tracked point from the centre of mass",
    unit: "mm",
    figures: |estimates| {
        let square_m2: f64 = estimates.iter().map(|lever| lever.value * lever.value).sum();
        (1e3 * square_m2.sqrt(), TOLD_MM)
    },
    objection: "the tracked point is within 1 mm of the centre of mass, which is known no better",
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    tracked_point_m: Vector3<f64>,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { tracked_point_m: Vector3::new(c[0], c[1], c[2]) }
    }
}

impl Adjusting for Adjustment {
    fn tracked_point_m(&self) -> Vector3<f64> {
        self.tracked_point_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Estimate;

    #[test]
    fn a_distance_counts_whichever_way_it_lies() {
        let lever = |mm: f64| Estimate { value: 1e-3 * mm, std_error: None };
        let (found_mm, needed_mm) = (IS_MEASURABLE.figures)(&[lever(0.6), lever(0.0), lever(-0.8)]);
        assert!((found_mm - 1.0).abs() < 1e-12);
        assert_eq!(needed_mm, TOLD_MM);
    }
}
