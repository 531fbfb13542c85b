//! Yaw torque of the rotors' own acceleration: spinning a rotor up turns the craft the other way. With the sign of the
//! spin as for the reaction torque: r' = ... + (J_r / Izz) sum spin_i w_i'.

use crate::{Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "rotor-inertia",
    sentence: "Spinning the rotors up and down turns the craft in yaw by their inertia.",
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::R],
    coefficients: &[Coefficient { name: "Jr/Izz", unit: "1", possible: (0.0, 0.2), typical: 0.002, prior: None }],
    excitation: "excite every motor by itself at several hertz",
    confused_with: &[(
        "motor-lag",
        "excite the motors at several hertz: rotor inertia acts in yaw alone, a lag in roll and pitch too",
    )],
};

#[inline]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let (spin, a) = (&s.constants.spin, &s.input.rotor_acceleration_rad_s2);
    sink.add(Axis::R, 0, spin[0] * a[0] + spin[1] * a[1] + spin[2] * a[2] + spin[3] * a[3]);
}
