//! More thrust close to the floor: each rotor's thrust times 1 / (1 - k (R / 4h)^2) with its hub's height h
//! (Cheeseman and Bennett 1955 have k = 1 for one rotor; multirotors show 1 to 3). The hubs sit somewhat above or below
//! the tracked point, and the floor is where the tracker's origin is, more or less: h is the height plus an offset.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "ground-effect",
    sentence: "Thrust rises near the floor.",
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    coefficients: &[
        Coefficient { name: "k_ground", unit: "1", possible: (0.0, 10.0), typical: 1.0, prior: None },
        Coefficient { name: "height_offset", unit: "m", possible: (-0.5, 0.5), typical: 0.02, prior: Some(0.03) },
    ],
    excitation: "hover at several heights, the lowest within two rotor radii of the floor",
    confused_with: &[("translational-lift", "hover low and high: ground effect needs no airspeed")],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.ground_effect_gain = c[0];
    adjust.ground_effect_height_offset_m = c[1];
}
