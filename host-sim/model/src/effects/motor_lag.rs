//! Rotors follow their command with another time constant than the vehicle file says.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::effects::timing::CAN_BE_TIMED;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "motor-lag",
    sentence: "The rotors follow their command slower or faster than assumed.",
    equation: r"\Big(\frac{1}{\omega_{lag}} + \tau\Big) \dot\omega_i = \omega_i^{cmd} - \omega_i",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::W, Axis::P, Axis::Q, Axis::R],
    through: &[
        "rotor_acceleration",
        "roll_rotor_acceleration",
        "pitch_rotor_acceleration",
        "yaw_rotor_acceleration",
    ],
    coefficients: &[
        Coefficient::new("time_constant_change", "s", (-0.2, 0.5), 0.01).stepped_by(DERIVATIVE_STEP_S)
    ],
    excitation: "excite every motor by itself at several hertz",
    confused_with: &[(
        "input-delay",
        "excite the motors at frequencies far apart: a lag attenuates the high ones, a dead time only delays them",
    )],
    special: Special {
        of_actuators: true,
        aligned_with: true,
        // A lag that was never known has not changed: what shows was missing all along.
        can_come_about: |vehicle| vehicle.motors.lag.is_some(),
        requirement: Some(CAN_BE_TIMED),
        ..Special::NOTHING
    },
};

/// Time constants under a tenth of a millisecond count as none, so no smaller step shows.
const DERIVATIVE_STEP_S: f64 = 2e-4;

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    time_constant_s: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { time_constant_s: c[0] }
    }
}

impl Adjusting for Adjustment {
    fn time_constant_s(&self) -> f64 {
        self.time_constant_s
    }
}
