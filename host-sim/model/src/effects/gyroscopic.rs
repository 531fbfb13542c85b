//! Angular momentum of the rotors: p' = ... + (I_r/Ixx) q S, q' = ... + (I_r/Iyy) p S with the signed rotor sum S.
//!
//! Physics gives the pitch row a minus (2.7); the thesis identifies it with a plus and a negative coefficient
//! (reference section 5). The plus is kept here, so a physical coefficient is positive in p and negative in q.

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn ratio(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "1", possible: (-0.5, 0.5), typical: 0.003, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "gyroscopic",
    sentence: "The spinning rotors resist being tilted and turn the tilt sideways.",
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q],
    coefficients: &[ratio("Ir/Ixx"), ratio("Ir/Iyy")],
    excitation: "roll and pitch while yawing hard, so that the rotor speeds differ",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let sum = s.signed_rotor_sum_rad_s();
    sink.add(Axis::P, 0, s.input.rate_rad_s.y * sum);
    sink.add(Axis::Q, 1, s.input.rate_rad_s.x * sum);
}
