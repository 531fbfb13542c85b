//! More thrust close to the floor: each rotor's thrust times 1 / (1 - k (R / 4h)^2) with its hub's height h
//! (Cheeseman and Bennett 1955 have k = 1 for one rotor; multirotors show 1 to 3 close to the floor. Higher up, the rotors act on each other and
//! as one: the sum of Sanchez-Cuevas, Heredia and Ollero 2017 for a quadrotor of the thesis' size, with K_b = 2, is that of k = 6.3 at 0.2 m and
//! 11.8 at 1.5 m, and flights through all of that range give 15 with an offset). The hubs sit somewhat above or below
//! the tracked point, and the floor is where the tracker's origin is, more or less: h is the height plus an offset.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::sample::AtRotor;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "ground-effect",
    sentence: "Thrust rises near the floor.",
    equation: r"T_i \to T_i \Big/ \Big(1 - k \Big(\frac{R}{4 h_i}\Big)^2\Big)",
    source: Some(
        "I. C. Cheeseman and W. E. Bennett, The effect of the ground on a helicopter rotor in forward flight, ARC R&M 3021, 1955",
    ),
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    through: &["height"],
    coefficients: &[
        Coefficient::new("k_ground", "1", (0.0, 25.0), 1.0),
        Coefficient::new("height_offset", "m", (-0.5, 0.5), 0.02).known_to(0.03),
    ],
    excitation: "hover at several heights, the lowest within two rotor radii of the floor",
    confused_with: &[("translational-lift", "hover low and high: ground effect needs no airspeed")],
    special: Special { is_slow: true, ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    gain: f64,
    height_offset_m: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { gain: c[0], height_offset_m: c[1] }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_thrust(&self) -> bool {
        self.gain != 0.0
    }

    #[inline(always)]
    fn thrust_factor(&self, at: &AtRotor) -> f64 {
        if !self.changes_thrust() {
            return 1.0;
        }
        let radius_m = at.constants.rotor_radius_m;
        // Cheeseman and Bennett give the formula for heights over half a radius; lower, a craft is on its landing gear.
        let height_m = (self.height_offset_m - at.hub_down_m()).max(0.5 * radius_m);
        let ratio = 0.25 * radius_m / height_m;
        1.0 / (1.0 - self.gain * ratio * ratio).max(0.2)
    }
}
