//! Drag in proportion to the velocity relative to the air: u' = ... + C_du u / m, (4.3). C_du, C_dv, C_dw negative.

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "N s/m", possible: (-20.0, 0.0), typical: 0.25, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "linear-drag",
    sentence: "The air brakes the craft in proportion to its speed.",
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V, Axis::W],
    coefficients: &[coefficient("C_du"), coefficient("C_dv"), coefficient("C_dw")],
    excitation: "fly forward, sideways, up and down at several speeds",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let per_mass = s.constants.per_mass;
    sink.add(Axis::U, 0, s.air_velocity_m_s.x * per_mass);
    sink.add(Axis::V, 1, s.air_velocity_m_s.y * per_mass);
    sink.add(Axis::W, 2, s.air_velocity_m_s.z * per_mass);
}
