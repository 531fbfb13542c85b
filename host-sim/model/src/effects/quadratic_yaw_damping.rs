//! Yaw torque of the air growing with the square of the rate: r' = ... + C |r| r. Negative.

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "quadratic-yaw-damping",
    sentence: "Beyond the linear damping, the air brakes yawing with the square of the rate.",
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::R],
    coefficients: &[Coefficient { name: "C_qr/Izz", unit: "1/rad", possible: (-50.0, 0.0), typical: 0.3, prior: None }],
    excitation: "yaw at three or more rates, the fastest above 2 rad/s",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let r = s.input.rate_rad_s.z;
    sink.add(Axis::R, 0, r.abs() * r);
}
