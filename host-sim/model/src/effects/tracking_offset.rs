//! The tracked point is not the centre of mass: the tracker sees the lever swing with the body (4.7).

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
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
    special: Special::NOTHING,
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
