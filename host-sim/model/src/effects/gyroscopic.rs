//! Angular momentum of the rotors: p' = ... + (I_r/Ixx) q S, q' = ... + (I_r/Iyy) p S with the signed rotor sum S.
//!
//! Physics gives the pitch row a minus (2.7); the thesis identifies it with a plus and a negative coefficient
//! (reference section 5). The plus is kept here, so a physical coefficient is positive in p and negative in q.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

const fn ratio(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-0.5, 0.5), 0.003).in_commands("1/(s cmd)")
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "gyroscopic",
    sentence: "The spinning rotors resist tilting: a roll rate gives a pitch moment, and a pitch rate a roll moment.",
    equation: r"\dot p = \dots + \frac{I_r}{I_{xx}} q S, \quad \dot q = \dots + \frac{I_r}{I_{yy}} p S, \quad S = \omega_1 - \omega_2 + \omega_3 - \omega_4",
    source: Some("A. Szabo, thesis, Wright State University 2017, (2.7)"),
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q],
    through: &["q", "p"],
    coefficients: &[ratio("Ir/Ixx"), ratio("Ir/Iyy")],
    excitation: "roll and pitch while yawing hard, so that the rotor speeds differ",
    confused_with: &[],
    special: Special { of_thesis: true, seen_by_the_sample: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let sum = s.signed_rotor_sum_rad_s();
    sink.add(Axis::P, 0, s.input.rate_rad_s.y * sum);
    sink.add(Axis::Q, 1, s.input.rate_rad_s.x * sum);
}
