//! More thrust with horizontal airspeed: the rotors meet undisturbed air. Each rotor's thrust times 1 + k (u^2 + v^2).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::sample::AtRotor;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "translational-lift",
    sentence: "Thrust rises with the horizontal speed through the air.",
    equation: r"T_i \to T_i (1 + k (u^2 + v^2))",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    through: &["horizontal_speed"],
    coefficients: &[Coefficient::new("k_lift", "s^2/m^2", (0.0, 1.0), 0.01)],
    excitation: "fly level at several speeds, the fastest above 2 m/s",
    confused_with: &[(
        "quadratic-drag",
        "fly level and climb: quadratic drag brakes, translational lift only lifts",
    )],
    special: Special::NOTHING,
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    gain_s2_m2: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { gain_s2_m2: c[0] }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_thrust(&self) -> bool {
        self.gain_s2_m2 != 0.0
    }

    #[inline(always)]
    fn thrust_factor(&self, at: &AtRotor) -> f64 {
        let (u, v) = (at.air_velocity_m_s.x, at.air_velocity_m_s.y);
        1.0 + self.gain_s2_m2 * (u * u + v * v)
    }
}
