//! The centre of mass has moved forward or to the side: the rotors' levers change, so hover needs unequal thrust.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;

const fn coefficient(name: &'static str) -> Coefficient {
    // Beyond the rotors, no thrust holds it.
    Coefficient::new(name, "m", (-0.5, 0.5), 0.005).within_arms(1.0)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "com-offset",
    sentence: "The centre of mass has moved away from the centre of the rotors.",
    equation: r"l_i \to l_i - (\Delta x, \Delta y)",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::P, Axis::Q],
    through: &["thrust"],
    coefficients: &[coefficient("forward"), coefficient("right")],
    excitation: "hover at several rotor speeds, climb and descend",
    confused_with: &[(
        "motor-efficiency",
        "climb and descend: a weak rotor also lifts less, and acts on roll and pitch together; a shifted mass does not",
    )],
    special: Special::NOTHING,
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    /// Forward and right.
    offset_m: [f64; 2],
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { offset_m: [c[0], c[1]] }
    }
}

impl Adjusting for Adjustment {
    fn com_offset_m(&self) -> [f64; 2] {
        self.offset_m
    }
}
