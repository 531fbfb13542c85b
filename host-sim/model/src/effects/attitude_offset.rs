//! The tracked attitude is tilted against the body: gravity leaks into the forward and sideward rows.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "rad", possible: (-0.5, 0.5), typical: 0.02, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "attitude-offset",
    sentence: "The tracked attitude is tilted against the body, so hover looks like leaning.",
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::U, Axis::V],
    coefficients: &[coefficient("tilt_roll"), coefficient("tilt_pitch")],
    excitation: "hover and turn once around in yaw",
    confused_with: &[(
        "steady-wind",
        "yaw round in hover: wind keeps its direction over the ground, a tilted tracker turns with the craft",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.attitude_tilt_rad = [c[0], c[1]];
}
