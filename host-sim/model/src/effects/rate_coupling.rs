//! Force from body rate: u' = ... + C_dq^u q / m, v' = ... + C_dp^v p / m (tables 4.2, 4.4).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "N s/rad", (-50.0, 50.0), 0.15)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "rate-coupling",
    sentence: "Pitching pushes the craft forward or back, rolling pushes it sideways.",
    equation: r"\dot u = \dots + \frac{C_{dq}^u}{m} q, \quad \dot v = \dots + \frac{C_{dp}^v}{m} p",
    source: Some("A. Szabo, thesis, Wright State University 2017, tables 4.2 and 4.4"),
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V],
    through: &["q", "p"],
    coefficients: &[coefficient("C_dq_u"), coefficient("C_dp_v")],
    excitation: "pitch and roll quickly about hover",
    confused_with: &[(
        "tracking-offset",
        "pitch and roll in short bursts: a tracked point off the centre of mass follows the angular acceleration, rate \
         coupling follows the rate",
    )],
    special: Special { of_thesis: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let per_mass = s.constants.per_mass;
    sink.add(Axis::U, 0, s.input.rate_rad_s.y * per_mass);
    sink.add(Axis::V, 1, s.input.rate_rad_s.x * per_mass);
}
