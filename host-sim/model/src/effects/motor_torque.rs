//! The reaction torque of one or more rotors is not what the model says: a damaged propeller has another drag, and loses torque and thrust
//! by different parts. The thrust of a tilted motor turns the craft about the same axis.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-1.0, 5.0), 0.05)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "motor-torque",
    sentence: "The reaction torque of one or more rotors is larger or smaller than the model says.",
    equation: r"\dot r = \dots + \beta R_R \sum_i \frac{C_i^r}{I_{zz}} (1 + \mu_i)\, \omega_i^2",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::R],
    through: &["yaw_moment"],
    coefficients: &[
        coefficient("torque_change_1"),
        coefficient("torque_change_2"),
        coefficient("torque_change_3"),
        coefficient("torque_change_4"),
    ],
    excitation: "excite each motor by itself (quadlab excite writes such a flight)",
    confused_with: &[(
        "motor-tilt",
        "fly with a motion capture: a tilted motor also pushes the craft sideways; an accelerometer whose offset is not known does not show it",
    )],
    special: Special { per_rotor: 1, ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    torque_change: [f64; 4],
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { torque_change: [c[0], c[1], c[2], c[3]] }
    }
}

impl Adjusting for Adjustment {
    fn torque_change(&self) -> [f64; 4] {
        self.torque_change
    }
}
