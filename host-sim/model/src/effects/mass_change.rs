//! The craft is heavier or lighter than the model: every force accelerates it less or more. Moments of inertia stay as
//! they are (a load at the centre changes them little).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "mass-change",
    sentence: "The craft is heavier or lighter than the model says.",
    equation: r"m \to m + \Delta m",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::W],
    through: &["thrust"],
    coefficients: &[Coefficient::new("extra_mass", "kg", (-50.0, 50.0), 0.05)],
    excitation: "hover, climb and descend",
    confused_with: &[(
        "battery-voltage",
        "keep flying: a heavier craft stays as heavy, the battery voltage keeps falling",
    )],
    special: Special::NOTHING,
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    extra_mass_kg: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { extra_mass_kg: c[0] }
    }
}

impl Adjusting for Adjustment {
    fn extra_mass_kg(&self) -> f64 {
        self.extra_mass_kg
    }
}
