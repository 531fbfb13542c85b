//! A cable or spring that pulls towards a fixed point: force = k (anchor - position), inertial frame. Linear in the
//! stiffness k and in k times the anchor.

use nalgebra::Vector3;

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

const fn pull(name: &'static str) -> Coefficient {
    Coefficient { name, unit: "N", possible: (-1000.0, 1000.0), typical: 1.0, prior: None }
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "tether",
    sentence: "A cable pulls the craft towards a fixed point.",
    kind: Kind::Linear,
    question: Question::Both,
    axes: &[Axis::U, Axis::V, Axis::W],
    coefficients: &[
        Coefficient { name: "stiffness", unit: "N/m", possible: (0.0, 1000.0), typical: 1.0, prior: None },
        pull("stiffness*north"),
        pull("stiffness*east"),
        pull("stiffness*down"),
    ],
    excitation: "hover at the corners of the flying space, low and high",
    confused_with: &[("steady-wind", "hover in opposite corners: a wind pushes the same way everywhere, a cable does not")],
};

#[inline]
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
