//! A constant wind, inertial frame, horizontal: every aerodynamic term sees the velocity relative to the moving air.

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::sample::SampleInput;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "m/s", (-30.0, 30.0), 1.0)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "steady-wind",
    sentence: "A steady wind blows: drag depends on the speed through the air, not over the ground.",
    equation: r"\mathbf v \to \mathbf v - R\, \mathbf v_{wind}",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::U, Axis::V],
    through: &["psi"],
    coefficients: &[coefficient("wind_north"), coefficient("wind_east")],
    excitation: "hover and yaw a full turn",
    confused_with: &[(
        "attitude-offset",
        "yaw a full turn in hover: a wind keeps its direction over the ground, a tilted attitude turns with the craft",
    )],
    special: Special { fixed_to_room: true, reveals: &["linear-drag", "quadratic-drag"], ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    wind_ned_m_s: Vector3<f64>,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { wind_ned_m_s: Vector3::new(c[0], c[1], 0.0) }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_air(&self) -> bool {
        self.wind_ned_m_s != Vector3::zeros()
    }

    #[inline(always)]
    fn air_velocity_m_s(&self, velocity_m_s: Vector3<f64>, input: &SampleInput) -> Vector3<f64> {
        if self.changes_air() { velocity_m_s - input.dcm * self.wind_ned_m_s } else { velocity_m_s }
    }
}
