//! Drag of the frame, growing with the square of the airspeed: force = C |V| V with the air-relative velocity V,
//! one coefficient in the rotor plane and one across it. Negative.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "N s^2/m^2", (-20.0, 0.0), 0.2)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "quadratic-drag",
    sentence: "Beyond the linear drag, the air slows the craft with the square of its speed.",
    equation: r"\dot u = \dots + \frac{C_{qd}^{xy}}{m} |V| u, \quad \dot v = \dots + \frac{C_{qd}^{xy}}{m} |V| v, \quad \dot w = \dots + \frac{C_{qd}^{z}}{m} |V| w",
    source: None,
    kind: Kind::Linear,
    question: Question::Both,
    axes: &[Axis::U, Axis::V, Axis::W],
    through: &["u", "v", "w"],
    coefficients: &[coefficient("C_qd_xy"), coefficient("C_qd_z")],
    excitation: "fly straight at three or more speeds, the fastest above 3 m/s",
    confused_with: &[(
        "linear-drag",
        "fly at well-separated speeds: the ratio of drag to speed tells them apart",
    )],
    special: Special { brakes: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let v = &s.air_velocity_m_s;
    let speed_per_mass = v.norm() * s.constants.per_mass;
    sink.add(Axis::U, 0, speed_per_mass * v.x);
    sink.add(Axis::V, 0, speed_per_mass * v.y);
    sink.add(Axis::W, 1, speed_per_mass * v.z);
}
