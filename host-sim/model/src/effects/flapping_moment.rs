//! Moments from moving through the air: the advancing blade lifts more, the rotor disk tilts back (blade flapping),
//! and the craft is pitched by forward and rolled by sideward speed: p' = ... + C_dv^p v, q' = ... + C_du^q u
//! (tables 4.8, 4.10: v enters p', u enters q'; not divided by the inertia).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "rad/(s m)", (-500.0, 500.0), 3.0)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "flapping-moment",
    sentence: "Moving through the air tilts the rotor disks: forward speed pitches the craft, sideways speed rolls it.",
    equation: r"\dot p = \dots + C_{dv}^p v, \quad \dot q = \dots + C_{du}^q u",
    source: Some("A. Szabo, thesis, Wright State University 2017, tables 4.8 and 4.10"),
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q],
    through: &["v", "u"],
    coefficients: &[coefficient("C_dv_p"), coefficient("C_du_q")],
    excitation: "fly forward and sideways at several speeds, then stop",
    confused_with: &[(
        "com-offset",
        "hover: a shifted centre of mass stays, a flapping moment vanishes with the speed",
    )],
    special: Special { of_thesis: true, aligned_with: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    sink.add(Axis::P, 0, s.air_velocity_m_s.y);
    sink.add(Axis::Q, 1, s.air_velocity_m_s.x);
}
