//! Force from body rate: u' = ... + C_dq^u q / m, v' = ... + C_dp^v p / m (tables 4.2, 4.4).

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "N s/rad", possible: (-50.0, 50.0), typical: 0.15, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "rate-coupling",
    sentence: "Pitching pushes the craft forward or back, rolling pushes it sideways.",
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V],
    coefficients: &[coefficient("C_dq_u"), coefficient("C_dp_v")],
    excitation: "pitch and roll quickly about hover",
    confused_with: &[(
        "tracking-offset",
        "pitch and roll in short bursts: a tracked point off the centre of mass shows with the angular acceleration, \
         rate coupling with the rate",
    )],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let per_mass = s.constants.per_mass;
    sink.add(Axis::U, 0, s.input.rate_rad_s.y * per_mass);
    sink.add(Axis::V, 1, s.input.rate_rad_s.x * per_mass);
}
