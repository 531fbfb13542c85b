//! Wind that grows with the height over z = 0, inertial frame, horizontal: near the ground the air is slowed. A straight line is
//! the first order of the profile of the surface layer, over the few metres of a flight.

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::sample::SampleInput;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1/s", (-5.0, 5.0), 0.5)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "wind-shear",
    sentence: "The wind grows with height: drag depends on the speed through air that moves faster higher up.",
    equation: r"\mathbf v \to \mathbf v - R\, h\, \frac{d \mathbf v_{wind}}{dh}",
    source: Some(
        "B. Etkin, Dynamics of Atmospheric Flight, Wiley 1972, chapter 13; MIL-F-8785C, 1980, section 3.7",
    ),
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::U, Axis::V],
    through: &["height"],
    coefficients: &[coefficient("shear_north"), coefficient("shear_east")],
    excitation: "hover at heights far apart, at two headings",
    confused_with: &[("steady-wind", "hover at very different heights: a steady wind is the same at each")],
    special: Special { fixed_to_room: true, ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    /// Wind for each metre of height, inertial NED, 1/s.
    shear_ned_per_s: Vector3<f64>,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { shear_ned_per_s: Vector3::new(c[0], c[1], 0.0) }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_air(&self) -> bool {
        self.shear_ned_per_s != Vector3::zeros()
    }

    #[inline(always)]
    fn air_velocity_m_s(&self, velocity_m_s: Vector3<f64>, input: &SampleInput) -> Vector3<f64> {
        if !self.changes_air() {
            return velocity_m_s;
        }
        let height_m = -input.position_ned_m.z;
        velocity_m_s - input.dcm * (height_m * self.shear_ned_per_s)
    }
}
