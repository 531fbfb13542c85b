//! Torque in proportion to the body rate: p' = ... + (C_dp/Ixx) p, (4.3). The thesis identified positive values
//! ("negative damping") in p and q; they are used as identified.

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "1/s", possible: (-100.0, 10.0), typical: 1.0, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "angular-damping",
    sentence: "The air brakes the craft's turning in proportion to its rate.",
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    coefficients: &[coefficient("C_dp/Ixx"), coefficient("C_dq/Iyy"), coefficient("C_dr/Izz")],
    excitation: "roll, pitch and yaw at several rates",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    sink.add(Axis::P, 0, s.input.rate_rad_s.x);
    sink.add(Axis::Q, 1, s.input.rate_rad_s.y);
    sink.add(Axis::R, 2, s.input.rate_rad_s.z);
}
