//! Yaw torque of the rotors' own acceleration: spinning a rotor up turns the craft the other way. With the sign of the
//! spin as for the reaction torque: r' = ... + (J_r / Izz) sum spin_i w_i'.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Sink, Special};
use crate::sample::Sample;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "rotor-inertia",
    sentence: "Speeding up or slowing down the rotors yaws the craft by their inertia.",
    equation: r"\dot r = \dots + \frac{J_r}{I_{zz}} \sum_i s_i \dot\omega_i",
    source: None,
    kind: Kind::Linear,
    question: Question::Structure,
    axes: &[Axis::R],
    through: &["yaw_rotor_acceleration"],
    coefficients: &[Coefficient::new("Jr/Izz", "1", (0.0, 0.2), 0.002).in_commands("1/(s cmd)")],
    excitation: "excite every motor by itself at several hertz",
    confused_with: &[(
        "motor-lag",
        "excite the motors at several hertz: rotor inertia acts in yaw alone, a lag in roll and pitch too",
    )],
    special: Special { aligned_with: true, seen_by_the_sample: true, ..Special::NOTHING },
};

#[inline(always)]
pub(super) fn columns(s: &Sample, sink: &mut impl Sink) {
    let (spin, a) = (&s.constants.spin, &s.input.rotor_acceleration_rad_s2);
    sink.add(Axis::R, 0, spin[0] * a[0] + spin[1] * a[1] + spin[2] * a[2] + spin[3] * a[3]);
}
