//! Moments of the rotors (2.7), one coefficient a rotor and axis, divided by the moment of inertia as in (4.3):
//! p' = ... + sqrt(2) l beta [C1 -C2 -C3 C4] w^2, q' = ... + sqrt(2) l beta [C1 C2 -C3 -C4] w^2, with all C_i positive,
//! r' = ... + beta R_R [C1 C2 C3 C4] w^2 with the sign of each rotor's spin in its coefficient.
//!
//! The arm sqrt(2) l is the thesis' (geometry gives l / sqrt(2)); the factor 2 is in the coefficients, so they are
//! not physical numbers (reference section 5).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sign, Sink, Special};
use crate::sample::Sample;

/// Unit where commands stand in for rotor speeds.
const IN_COMMANDS: &str = "1/(kg m^2 s^2 cmd^2)";

const fn thrust_moment(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1/(kg m^2)", (0.0, 1e6), 0.6).in_commands(IN_COMMANDS).signed(Sign::Positive)
}

const fn reaction(name: &'static str, rotor: usize) -> Coefficient {
    Coefficient::new(name, "1/(kg m^2)", (-1e6, 1e6), 0.3).in_commands(IN_COMMANDS).signed(Sign::OfSpin(rotor))
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "rotor-moments",
    sentence: "Rotors off the centre roll and pitch the craft by their thrust and yaw it by their reaction torque.",
    equation: r"\dot p = \dots + \sqrt2\, l \beta \sum_i \pm \frac{C_i^p}{I_{xx}} \omega_i^2, \quad \dot q = \dots + \sqrt2\, l \beta \sum_i \pm \frac{C_i^q}{I_{yy}} \omega_i^2, \quad \dot r = \dots + \beta R_R \sum_i \frac{C_i^r}{I_{zz}} \omega_i^2",
    source: Some("A. Szabo, thesis, Wright State University 2017, (2.7)"),
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    through: &["roll_moment", "pitch_moment", "yaw_moment"],
    coefficients: &[
        thrust_moment("C1_p/Ixx"),
        thrust_moment("C2_p/Ixx"),
        thrust_moment("C3_p/Ixx"),
        thrust_moment("C4_p/Ixx"),
        thrust_moment("C1_q/Iyy"),
        thrust_moment("C2_q/Iyy"),
        thrust_moment("C3_q/Iyy"),
        thrust_moment("C4_q/Iyy"),
        reaction("C1_r/Izz", 0),
        reaction("C2_r/Izz", 1),
        reaction("C3_r/Izz", 2),
        reaction("C4_r/Izz", 3),
    ],
    excitation: "excite each motor by itself (quadlab excite writes such a flight)",
    confused_with: &[],
    special: Special { of_thesis: true, must_be_determined: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let (roll, pitch) = (&s.constants.roll_arm_kg_m2, &s.constants.pitch_arm_kg_m2);
    let yaw = &s.constants.yaw_arm_kg_m2;
    for rotor in 0..4 {
        sink.add(Axis::P, rotor, roll[rotor] * s.rotor_thrust_rad2_s2[rotor]);
        sink.add(Axis::Q, 4 + rotor, pitch[rotor] * s.rotor_thrust_rad2_s2[rotor]);
        sink.add(Axis::R, 8 + rotor, yaw[rotor] * s.rotor_speed_squared_rad2_s2[rotor]);
    }
}
