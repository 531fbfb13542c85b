//! The centre of mass has moved forward or to the side: the rotors' levers change, so hover needs unequal thrust.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "m", possible: (-0.5, 0.5), typical: 0.005, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "com-offset",
    sentence: "The centre of mass has moved away from the centre of the rotors.",
    kind: Kind::Adjusting,
    question: Question::Change,
    axes: &[Axis::P, Axis::Q],
    coefficients: &[coefficient("forward"), coefficient("right")],
    excitation: "hover at several rotor speeds, climb and descend",
    confused_with: &[(
        "motor-efficiency",
        "climb and descend: a weak rotor also lifts less and pulls in roll and pitch together, a shifted mass does not",
    )],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.com_offset_m = [c[0], c[1]];
}
