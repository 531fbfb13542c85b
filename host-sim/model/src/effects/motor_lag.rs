//! Rotors follow their command with another time constant than the vehicle file says.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "motor-lag",
    sentence: "The rotors follow their command slower or faster than assumed.",
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::W, Axis::P, Axis::Q, Axis::R],
    coefficients: &[Coefficient {
        name: "time_constant_change",
        unit: "s",
        possible: (-0.2, 0.5),
        typical: 0.01,
        prior: None,
    }],
    excitation: "excite every motor by itself at several hertz",
    confused_with: &[(
        "input-delay",
        "excite the motors at frequencies far apart: a lag weakens the fast ones, a dead time only shifts them",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.motor_time_constant_s = c[0];
}
