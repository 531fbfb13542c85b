//! Moments from moving through the air: the advancing blade lifts more, the rotor disk tilts back (blade flapping),
//! and the craft is pitched by forward and rolled by sideward speed: p' = ... + C_dv^p v, q' = ... + C_du^q u
//! (tables 4.8, 4.10: v enters p', u enters q'; not divided by the inertia).

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "rad/(s m)", possible: (-500.0, 500.0), typical: 3.0, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "flapping-moment",
    sentence: "Moving through the air tilts the rotor disks: forward speed pitches the craft, sideward speed rolls it.",
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q],
    coefficients: &[coefficient("C_dv_p"), coefficient("C_du_q")],
    excitation: "fly forward and sideways at several speeds, then stop",
    confused_with: &[("com-offset", "hover: a shifted centre of mass stays, a flapping moment vanishes with the speed")],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    sink.add(Axis::P, 0, s.air_velocity_m_s.y);
    sink.add(Axis::Q, 1, s.air_velocity_m_s.x);
}
