//! Rotor thrust, along -z of the body: w' = ... - (C_T beta / m) sum w_i^2, (2.6) and (4.3).
//!
//! One C_T for all four rotors: the thesis found four to over-parameterise the model (section 4.1.1).

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "thrust",
    sentence: "Each rotor pulls upward with the square of its speed.",
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::W],
    coefficients: &[Coefficient { name: "C_T", unit: "1", possible: (1e-4, 1.0), typical: 0.02, prior: None }],
    excitation: "climb and descend",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let t = &s.rotor_thrust_rad2_s2;
    sink.add(Axis::W, 0, -s.constants.beta_kg_m * s.constants.per_mass * (t[0] + t[1] + t[2] + t[3]));
}
