//! Rotor speed follows the battery voltage in a way the motor map leaves out: speed = map + k (V - V_ref - shift), (4.10).
//! V_ref is the mean voltage of the training flights, kept in the model file; V_ref + shift is where the map is right.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "battery-voltage",
    sentence: "Thrust depends on the battery voltage in a way that the motor map leaves out.",
    equation: r"\omega_i = \mathrm{map} + k (V - V_{ref} - V_0)",
    source: Some("A. Szabo, thesis, Wright State University 2017, (4.10)"),
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::W, Axis::P, Axis::Q, Axis::R],
    through: &["vbat"],
    coefficients: &[
        Coefficient::new("speed_per_volt", "rad/s/V", (-2000.0, 2000.0), 40.0)
            .in_rotor_speed()
            .in_commands("cmd/V"),
        // A map is measured somewhere between a full and an empty battery: a volt or two from the mean.
        Coefficient::new("voltage_shift", "V", (-50.0, 50.0), 1.0).known_to(1.5),
    ],
    excitation: "fly from a full battery to an empty one",
    confused_with: &[(
        "mass-change",
        "keep flying: a heavier craft stays as heavy, the battery voltage keeps falling",
    )],
    special: Special::NOTHING,
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    speed_per_volt: f64,
    /// Where the map is right, V.
    right_at_v: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], reference_v: f64) -> Self {
        Self { speed_per_volt: c[0], right_at_v: reference_v + c[1] }
    }
}

impl Adjusting for Adjustment {
    fn speed_per_volt(&self) -> f64 {
        self.speed_per_volt
    }

    #[inline(always)]
    fn speed_change_rad_s(&self, battery_v: f64) -> f64 {
        self.speed_per_volt * (battery_v - self.right_at_v)
    }
}
