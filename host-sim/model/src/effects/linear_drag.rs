//! Drag in proportion to the velocity relative to the air: u' = ... + C_du u / m, (4.3). C_du, C_dv, C_dw negative.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sign, Sink, Special};
use crate::sample::Sample;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "N s/m", (-20.0, 0.0), 0.25).signed(Sign::Negative)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "linear-drag",
    sentence: "The air slows the craft in proportion to its speed.",
    equation: r"\dot u = \dots + \frac{C_{du}}{m} u, \quad \dot v = \dots + \frac{C_{dv}}{m} v, \quad \dot w = \dots + \frac{C_{dw}}{m} w",
    source: Some("A. Szabo, thesis, Wright State University 2017, (4.3)"),
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V, Axis::W],
    through: &["u", "v", "w"],
    coefficients: &[coefficient("C_du"), coefficient("C_dv"), coefficient("C_dw")],
    excitation: "fly forward, sideways, up and down at several speeds",
    confused_with: &[],
    special: Special { of_thesis: true, brakes: true, must_be_determined: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let per_mass = s.constants.per_mass;
    sink.add(Axis::U, 0, s.air_velocity_m_s.x * per_mass);
    sink.add(Axis::V, 1, s.air_velocity_m_s.y * per_mass);
    sink.add(Axis::W, 2, s.air_velocity_m_s.z * per_mass);
}
