//! Dead time between command and rotor: transmission, computing, the speed controller's own cycle.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "input-delay",
    sentence: "Commands reach the rotors late.",
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::W, Axis::P, Axis::Q, Axis::R],
    coefficients: &[Coefficient { name: "dead_time", unit: "s", possible: (0.0, 0.5), typical: 0.01, prior: None }],
    excitation: "excite every motor by itself at several hertz",
    confused_with: &[(
        "motor-lag",
        "excite the motors at frequencies far apart: a lag weakens the fast ones, a dead time only shifts them",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.input_delay_s = c[0];
}
