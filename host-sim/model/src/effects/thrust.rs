//! Rotor thrust, along -z of the body: w' = ... - (C_T beta / m) sum w_i^2, (2.6) and (4.3).
//!
//! One C_T for all four rotors: the thesis found four to over-parameterise the model (section 4.1.1).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sign, Sink, Special};
use crate::sample::Sample;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "thrust",
    sentence: "Each rotor's thrust grows with the square of its speed.",
    equation: r"\dot w = \dots - \frac{C_T \beta}{m} \sum_i \omega_i^2",
    source: Some("A. Szabo, thesis, Wright State University 2017, (2.6) and (4.3)"),
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::W],
    through: &["thrust"],
    coefficients: &[Coefficient::new("C_T", "1", (1e-4, 1.0), 0.02)
        .in_commands("1/(s^2 cmd^2)")
        .signed(Sign::Positive)],
    excitation: "climb and descend",
    confused_with: &[],
    special: Special { of_thesis: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let t = &s.rotor_thrust_rad2_s2;
    sink.add(Axis::W, 0, -s.constants.beta_kg_m * s.constants.per_mass * (t[0] + t[1] + t[2] + t[3]));
}
