//! A cable or spring that pulls towards a fixed point: force = k (anchor - position), inertial frame. Linear in the
//! stiffness k and in k times the anchor.

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Requirement, Sink, Special};
use crate::sample::Sample;

const fn pull(name: &'static str) -> Coefficient {
    Coefficient::new(name, "N", (-1000.0, 1000.0), 1.0)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "tether",
    sentence: "A cable pulls the craft towards a fixed point.",
    equation: r"\mathbf F = k (\mathbf x_0 - \mathbf x)",
    source: None,
    kind: Kind::Linear,
    question: Question::Both,
    axes: &[Axis::U, Axis::V, Axis::W],
    through: &["north", "east", "down"],
    coefficients: &[
        Coefficient::new("stiffness", "N/m", (0.0, 1000.0), 1.0),
        pull("stiffness*north"),
        pull("stiffness*east"),
        pull("stiffness*down"),
    ],
    excitation: "hover at the corners of the flying space, low and high",
    confused_with: &[(
        "steady-wind",
        "hover in opposite corners: a wind pushes the same way everywhere, a cable does not",
    )],
    special: Special { is_anchored: true, requirement: Some(PULLS_BACK), ..Special::NOTHING },
};

/// A stiffness under this many standard errors is none: it is one of many coefficients that are looked at, and in flights of a
/// small quadcopter without a cable (nanobench) a push that is the same everywhere took one of 3.5.
const SLACK_ERRORS: f64 = 5.0;

/// A cable without stiffness is a push that is the same everywhere: what a trim that differs between flights looks like.
const PULLS_BACK: Requirement = Requirement {
    question: "pulls back: stiffness of the cable",
    unit: "std. errors",
    figures: |estimates| {
        let (value, std_error) =
            estimates.first().map_or((0.0, 0.0), |k| (k.value, k.std_error.unwrap_or(0.0)));
        (value / std_error.max(f64::MIN_POSITIVE), SLACK_ERRORS)
    },
    objection: "a force that is the same everywhere, not a cable",
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let mut force = |coefficient: usize, inertial: Vector3<f64>| {
        let body = s.input.dcm * inertial * s.constants.per_mass;
        sink.add(Axis::U, coefficient, body.x);
        sink.add(Axis::V, coefficient, body.y);
        sink.add(Axis::W, coefficient, body.z);
    };
    force(0, -s.input.position_ned_m);
    force(1, Vector3::x());
    force(2, Vector3::y());
    force(3, Vector3::z());
}
