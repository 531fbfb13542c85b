//! More thrust with horizontal airspeed: the rotors meet undisturbed air. Each rotor's thrust times 1 + k (u^2 + v^2).

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "translational-lift",
    sentence: "Thrust rises with the horizontal speed through the air.",
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    coefficients: &[Coefficient {
        name: "k_lift",
        unit: "s^2/m^2",
        possible: (0.0, 1.0),
        typical: 0.01,
        prior: None,
    }],
    excitation: "fly level at several speeds, the fastest above 2 m/s",
    confused_with: &[("quadratic-drag", "fly level and climb: quadratic drag brakes, translational lift only lifts")],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.translational_lift_s2_m2 = c[0];
}
