//! The thrust of one or more rotors does not point along -z of the body: a bent arm, a loose or crooked motor mount. It pushes the craft
//! sideways, and by its lever it yaws the craft.
//!
//! A rotor at (x, y) whose thrust C_T beta w^2 leans by small angles a forward and b to the right gives u' = C_T a (beta / m) w^2,
//! v' = C_T b (beta / m) w^2 and r' = C_T (x b - y a) (beta / Izz) w^2. What is identified are C_T a, C_T b and, because the model knows no
//! Izz, C_T (x b - y a) / (R_R Izz), which has the unit of the coefficients of (2.7); the diagnosis holds the three against each other. Left out:
//! that the rotor lifts less by the cosine, and that its torque leans with it.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;
use crate::vehicle::Vehicle;

const fn push(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-0.3, 0.3), 0.001).in_commands("1/(s^2 cmd^2)")
}

const fn turn(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1/(kg m^2)", (-1e6, 1e6), 0.1).in_commands("1/(kg m^2 s^2 cmd^2)")
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "motor-tilt",
    sentence: "The thrust of one or more rotors leans: it pushes the craft sideways and yaws it.",
    equation: r"\dot u = \dots + \frac{\beta}{m} \sum_i C_T a_i\, \omega_i^2, \quad \dot v = \dots + \frac{\beta}{m} \sum_i C_T b_i\, \omega_i^2, \quad \dot r = \dots + \beta R_R \sum_i \frac{C_i^t}{I_{zz}} \omega_i^2",
    source: None,
    kind: Kind::Linear,
    question: Question::Change,
    axes: &[Axis::U, Axis::V, Axis::R],
    through: &["rotor_speed", "rotor_speed", "yaw_moment"],
    coefficients: &[
        push("C_T_forward_1"),
        push("C_T_right_1"),
        turn("C1_t/Izz"),
        push("C_T_forward_2"),
        push("C_T_right_2"),
        turn("C2_t/Izz"),
        push("C_T_forward_3"),
        push("C_T_right_3"),
        turn("C3_t/Izz"),
        push("C_T_forward_4"),
        push("C_T_right_4"),
        turn("C4_t/Izz"),
    ],
    excitation: "excite each motor by itself (quadlab excite writes such a flight), with a motion capture",
    confused_with: &[
        (
            "attitude-offset",
            "yaw to and fro: a tilted tracker does not yaw the craft; where the motor leans along its arm, climb and descend hard: its push follows the thrust of one rotor",
        ),
        ("steady-wind", "hover at several headings: a wind keeps its direction in the room, a tilted motor keeps that of the craft"),
        ("motor-torque", "look for a sideways push: a damaged propeller has none"),
    ],
    special: Special { per_rotor: PER_ROTOR, can_come_about: Vehicle::has_rotor_map, ..Special::NOTHING },
};

/// Forward, right, and about z.
const PER_ROTOR: usize = 3;

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let (beta, per_mass) = (s.constants.beta_kg_m, s.constants.per_mass);
    for rotor in 0..4 {
        let thrust = beta * s.rotor_thrust_rad2_s2[rotor];
        sink.add(Axis::U, PER_ROTOR * rotor, per_mass * thrust);
        sink.add(Axis::V, PER_ROTOR * rotor + 1, per_mass * thrust);
        sink.add(Axis::R, PER_ROTOR * rotor + 2, s.constants.rotor_radius_m * thrust);
    }
}
