//! The Euler terms of a rigid body: p' = ... + (Iyy - Izz)/Ixx q r and so on, (2.8).

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn ratio(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "1", possible: (-1.0, 1.0), typical: 0.5, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "inertia-coupling",
    sentence: "Turning about two axes at once turns the third, because the moments of inertia differ.",
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    coefficients: &[ratio("(Iyy-Izz)/Ixx"), ratio("(Izz-Ixx)/Iyy"), ratio("(Ixx-Iyy)/Izz")],
    excitation: "turn about two axes at once",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let w = &s.input.rate_rad_s;
    sink.add(Axis::P, 0, w.y * w.z);
    sink.add(Axis::Q, 1, w.x * w.z);
    sink.add(Axis::R, 2, w.x * w.y);
}
