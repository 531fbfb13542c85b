//! A product of inertia Ixz couples roll and yaw: with the tensor [[Ixx 0 -Ixz] [0 Iyy 0] [-Ixz 0 Izz]],
//! p' = ... + Ixz/Ixx (r' + p q), q' = ... + Ixz/Iyy (r^2 - p^2), r' = ... + Ixz/Izz (p' - q r).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

const fn ratio(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-0.5, 0.5), 0.02)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "product-of-inertia",
    sentence: "The mass is not symmetrical front to back and top to bottom: yawing rolls the craft and rolling yaws it.",
    equation: r"\dot p = \dots + \frac{I_{xz}}{I_{xx}} (\dot r + p q), \quad \dot q = \dots + \frac{I_{xz}}{I_{yy}} (r^2 - p^2), \quad \dot r = \dots + \frac{I_{xz}}{I_{zz}} (\dot p - q r)",
    source: None,
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    through: &["yaw_acceleration", "r", "roll_acceleration"],
    coefficients: &[ratio("Ixz/Ixx"), ratio("Ixz/Iyy"), ratio("Ixz/Izz")],
    excitation: "roll and yaw hard at the same time",
    confused_with: &[],
    special: Special { passes: PASSES, seen_by_the_sample: true, ..Special::NOTHING },
};

/// Passes in which the angular accelerations are solved for: each gains a factor Ixz / I, at least a digit.
const PASSES: usize = 12;

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let (w, a) = (&s.input.rate_rad_s, &s.input.angular_acceleration_rad_s2);
    sink.add(Axis::P, 0, a.z + w.x * w.y);
    sink.add(Axis::Q, 1, w.z * w.z - w.x * w.x);
    sink.add(Axis::R, 2, a.x - w.y * w.z);
}
