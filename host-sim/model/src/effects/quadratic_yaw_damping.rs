//! Yaw torque of the air growing with the square of the rate: r' = ... + C |r| r. Negative.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "quadratic-yaw-damping",
    sentence: "Beyond the linear damping, the air damps yaw with the square of the rate.",
    equation: r"\dot r = \dots + \frac{C_{qr}}{I_{zz}} |r| r",
    source: None,
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::R],
    through: &["r"],
    coefficients: &[Coefficient::new("C_qr/Izz", "1/rad", (-50.0, 0.0), 0.3)],
    excitation: "yaw at three or more rates, the fastest above 2 rad/s",
    confused_with: &[],
    special: Special { brakes: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let r = s.input.rate_rad_s.z;
    sink.add(Axis::R, 0, r.abs() * r);
}
