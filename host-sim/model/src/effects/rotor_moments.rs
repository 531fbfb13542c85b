//! Moments of the rotors (2.7), one coefficient a rotor and axis, divided by the moment of inertia as in (4.3):
//! p' = ... + sqrt(2) l beta [C1 -C2 -C3 C4] w^2, q' = ... + sqrt(2) l beta [C1 C2 -C3 -C4] w^2, with all C_i positive,
//! r' = ... + beta R_R [C1 C2 C3 C4] w^2 with the sign of each rotor's spin in its coefficient.
//!
//! The arm sqrt(2) l is the thesis' (geometry gives l / sqrt(2)); the factor 2 is in the coefficients, so they are
//! not physical numbers (reference section 5).

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn thrust_moment(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "1/(kg m^2)", possible: (0.0, 1e6), typical: 0.6, prior: None }
}

const fn reaction(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "1/(kg m^2)", possible: (-1e6, 1e6), typical: 0.3, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "rotor-moments",
    sentence: "Rotors off the centre roll and pitch the craft by their thrust and yaw it by their reaction torque.",
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    coefficients: &[
        thrust_moment("C1_p/Ixx"),
        thrust_moment("C2_p/Ixx"),
        thrust_moment("C3_p/Ixx"),
        thrust_moment("C4_p/Ixx"),
        thrust_moment("C1_q/Iyy"),
        thrust_moment("C2_q/Iyy"),
        thrust_moment("C3_q/Iyy"),
        thrust_moment("C4_q/Iyy"),
        reaction("C1_r/Izz"),
        reaction("C2_r/Izz"),
        reaction("C3_r/Izz"),
        reaction("C4_r/Izz"),
    ],
    excitation: "excite every motor by itself (quadlab's excitation flight)",
    confused_with: &[],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let (roll, pitch) = (&s.constants.roll_arm_kg_m2, &s.constants.pitch_arm_kg_m2);
    let radius = s.constants.beta_kg_m * s.constants.rotor_radius_m;
    for rotor in 0..4 {
        sink.add(Axis::P, rotor, roll[rotor] * s.rotor_thrust_rad2_s2[rotor]);
        sink.add(Axis::Q, 4 + rotor, pitch[rotor] * s.rotor_thrust_rad2_s2[rotor]);
        sink.add(Axis::R, 8 + rotor, radius * s.rotor_speed_squared_rad2_s2[rotor]);
    }
}
