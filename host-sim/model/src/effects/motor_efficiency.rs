//! One rotor gives less (or more) thrust than the model says: a chipped blade, a worn bearing, a bent shaft. Its reaction
//! torque stays.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "1", possible: (-1.0, 1.0), typical: 0.1, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "motor-efficiency",
    sentence: "One rotor gives less thrust than the model says.",
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::W, Axis::P, Axis::Q],
    coefficients: &[
        coefficient("thrust_loss_1"),
        coefficient("thrust_loss_2"),
        coefficient("thrust_loss_3"),
        coefficient("thrust_loss_4"),
    ],
    excitation: "hover, climb and descend, yaw both ways",
    confused_with: &[(
        "com-offset",
        "climb and descend: a weak rotor also lifts less and pulls in roll and pitch together, a shifted mass does not",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.thrust_loss = [c[0], c[1], c[2], c[3]];
}
