//! The Euler terms of a rigid body: p' = ... + (Iyy - Izz)/Ixx q r and so on, (2.8).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

const fn ratio(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-1.0, 1.0), 0.5)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "inertia-coupling",
    sentence: "Rotating about two axes at once gives a moment about the third, because the moments of inertia differ.",
    equation: r"\dot p = \dots + \frac{I_{yy} - I_{zz}}{I_{xx}} q r, \quad \dot q = \dots + \frac{I_{zz} - I_{xx}}{I_{yy}} p r, \quad \dot r = \dots + \frac{I_{xx} - I_{yy}}{I_{zz}} p q",
    source: Some("A. Szabo, thesis, Wright State University 2017, (2.8)"),
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    through: &["qr", "pr", "pq"],
    coefficients: &[ratio("(Iyy-Izz)/Ixx"), ratio("(Izz-Ixx)/Iyy"), ratio("(Ixx-Iyy)/Izz")],
    excitation: "turn about two axes at once",
    confused_with: &[],
    special: Special { of_thesis: true, seen_by_the_sample: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let w = &s.input.rate_rad_s;
    sink.add(Axis::P, 0, w.y * w.z);
    sink.add(Axis::Q, 1, w.x * w.z);
    sink.add(Axis::R, 2, w.x * w.y);
}
