//! The tracked point is not the centre of mass: the tracker sees the lever swing with the body (4.7).

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "m", possible: (-1.0, 1.0), typical: 0.05, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "tracking-offset",
    sentence: "The tracked point is not the centre of mass.",
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::U, Axis::V, Axis::W],
    coefficients: &[coefficient("lever_x"), coefficient("lever_y"), coefficient("lever_z")],
    excitation: "pitch, roll and yaw in short bursts about hover",
    confused_with: &[(
        "rate-coupling",
        "pitch and roll in short bursts: a tracked point off the centre of mass shows with the angular acceleration, \
         rate coupling with the rate",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.tracked_point_m.x = c[0];
    adjust.tracked_point_m.y = c[1];
    adjust.tracked_point_m.z = c[2];
}
