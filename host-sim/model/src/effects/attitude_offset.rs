//! The tracked attitude is tilted against the body: gravity leaks into the forward and sideward rows.

use nalgebra::{Matrix3, Vector3};

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::frames;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "rad", (-0.5, 0.5), 0.02)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "attitude-offset",
    sentence: "The tracked attitude is tilted relative to the body, so level hover appears tilted.",
    equation: r"R_{tracked} = \exp([\boldsymbol\epsilon]_\times)\, R",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::U, Axis::V],
    through: &["psi"],
    coefficients: &[coefficient("tilt_roll"), coefficient("tilt_pitch")],
    excitation: "hover and yaw a full turn",
    confused_with: &[(
        "steady-wind",
        "yaw a full turn in hover: a wind keeps its direction over the ground, a tilted attitude turns with the craft",
    )],
    special: Special::NOTHING,
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    /// About x and y: measured = true followed by the tilt.
    tilt_rad: [f64; 2],
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { tilt_rad: [c[0], c[1]] }
    }
}

impl Adjusting for Adjustment {
    fn tilt(&self) -> Option<Matrix3<f64>> {
        let [x, y] = self.tilt_rad;
        (x != 0.0 || y != 0.0).then(|| frames::dcm_from_rotation_vector(Vector3::new(x, y, 0.0)))
    }
}
