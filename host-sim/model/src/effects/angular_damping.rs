//! Torque in proportion to the body rate: p' = ... + (C_dp/Ixx) p, (4.3). The thesis identified positive values
//! ("negative damping") in p and q; they are used as identified. In yaw, where a controller acts least, it is damping.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sign, Sink, Special};
use crate::sample::Sample;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1/s", (-100.0, 10.0), 1.0)
}

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "angular-damping",
    sentence: "The air damps the rotation of the craft in proportion to its rates.",
    equation: r"\dot p = \dots + \frac{C_{dp}}{I_{xx}} p, \quad \dot q = \dots + \frac{C_{dq}}{I_{yy}} q, \quad \dot r = \dots + \frac{C_{dr}}{I_{zz}} r",
    source: Some("A. Szabo, thesis, Wright State University 2017, (4.3)"),
    kind: Kind::Basic,
    question: Question::Structure,
    axes: &[Axis::P, Axis::Q, Axis::R],
    through: &["p", "q", "r"],
    coefficients: &[coefficient("C_dp/Ixx"), coefficient("C_dq/Iyy"), coefficient("C_dr/Izz").signed(Sign::Negative)],
    excitation: "roll, pitch and yaw at several rates",
    confused_with: &[],
    special: Special { of_thesis: true, brakes: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    sink.add(Axis::P, 0, s.input.rate_rad_s.x);
    sink.add(Axis::Q, 1, s.input.rate_rad_s.y);
    sink.add(Axis::R, 2, s.input.rate_rad_s.z);
}
