//! Thrust that is not purely quadratic in the rotor speed: C_T beta (w^2 + w_lin w).

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "thrust-linear",
    sentence: "Thrust has a part proportional to the rotor speed besides the part with its square.",
    equation: r"T_i = C_T \beta (\omega_i^2 + \omega_{lin} \omega_i)",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    through: &["rotor_speed"],
    coefficients: &[Coefficient::new("w_lin", "rad/s", (-2000.0, 5000.0), 40.0)
        .in_rotor_speed()
        .in_commands("cmd")],
    excitation: "climb and descend hard, so that the rotors run fast and slow",
    confused_with: &[(
        "battery-voltage",
        "fly from a full battery to an empty one: the thrust curve does not change with it",
    )],
    special: Special { of_actuators: true, ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    linear_rad_s: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { linear_rad_s: c[0] }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_thrust(&self) -> bool {
        self.linear_rad_s != 0.0
    }

    #[inline(always)]
    fn thrust_rad2_s2(&self, square_rad2_s2: f64, speed_rad_s: f64) -> f64 {
        square_rad2_s2 + self.linear_rad_s * speed_rad_s
    }
}
