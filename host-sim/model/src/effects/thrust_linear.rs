//! Thrust that is not purely quadratic in the rotor speed: C_T beta (w^2 + w_lin w).

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "thrust-linear",
    sentence: "Thrust has a part in proportion to the rotor speed besides the square.",
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    coefficients: &[Coefficient {
        name: "w_lin",
        unit: "rad/s",
        possible: (-2000.0, 5000.0),
        typical: 40.0,
        prior: None,
    }],
    excitation: "climb and descend hard, so that the rotors run fast and slow",
    confused_with: &[("battery-voltage", "fly from a full battery to an empty one: the thrust curve does not change with it")],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.thrust_linear_rad_s = c[0];
}
