//! One or more rotors give less (or more) thrust than the model says: a chipped blade, a worn bearing, a bent shaft. Its reaction
//! torque stays.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::sample::AtRotor;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-1.0, 1.0), 0.1)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "motor-efficiency",
    sentence: "One or more rotors give less thrust than the model says.",
    equation: r"T_i \to T_i (1 - \lambda_i)",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::W, Axis::P, Axis::Q],
    through: &["thrust"],
    coefficients: &[
        coefficient("thrust_loss_1"),
        coefficient("thrust_loss_2"),
        coefficient("thrust_loss_3"),
        coefficient("thrust_loss_4"),
    ],
    excitation: "hover, climb and descend, yaw both ways",
    confused_with: &[(
        "com-offset",
        "climb and descend: a weak rotor also lifts less, and acts on roll and pitch together; a shifted mass does not",
    )],
    special: Special { per_rotor: 1, ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    thrust_loss: [f64; 4],
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { thrust_loss: [c[0], c[1], c[2], c[3]] }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_thrust(&self) -> bool {
        self.thrust_loss != [0.0; 4]
    }

    #[inline(always)]
    fn thrust_factor(&self, at: &AtRotor) -> f64 {
        1.0 - self.thrust_loss[at.rotor]
    }
}
