//! The craft is heavier or lighter than the model: every force accelerates it less or more. Moments of inertia stay as
//! they are (a load at the centre changes them little).

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "mass-change",
    sentence: "The craft is heavier or lighter than the model says.",
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::W],
    coefficients: &[Coefficient { name: "extra_mass", unit: "kg", possible: (-50.0, 50.0), typical: 0.05, prior: None }],
    excitation: "hover, climb and descend",
    confused_with: &[("battery-voltage", "fly on: a heavier craft stays heavier, a battery goes on falling")],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.extra_mass_kg = c[0];
}
