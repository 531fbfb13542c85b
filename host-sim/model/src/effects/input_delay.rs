//! Dead time between command and rotor: transmission, computing, the speed controller's own cycle.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::effects::timing::CAN_BE_TIMED;

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "input-delay",
    sentence: "Commands reach the rotors late.",
    equation: r"\omega_i^{cmd}(t) \to \omega_i^{cmd}(t - t_0)",
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
    coefficients: &[Coefficient::new("dead_time", "s", (0.0, 0.5), 0.01)],
    excitation: "excite every motor by itself at several hertz",
    confused_with: &[(
        "motor-lag",
        "excite the motors at frequencies far apart: a lag attenuates the high ones, a dead time only delays them",
    )],
    special: Special { of_actuators: true, requirement: Some(CAN_BE_TIMED), ..Special::NOTHING },
};

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    dead_time_s: f64,
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { dead_time_s: c[0] }
    }
}

impl Adjusting for Adjustment {
    fn dead_time_s(&self) -> f64 {
        self.dead_time_s
    }
}
