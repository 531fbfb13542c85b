//! Roll, pitch and yaw loops, thesis 5.3: prefilter, PID with body-rate feedback, lag canceller
//! (roll and pitch).
//!
//! `tau = Lag(kp e + ki integral(e)) - kd rate`, error = prefiltered command - measured angle, rate
//! = p, q or r. Output in rad/s^2 (command units in the hand-tuned law). Positive output turns
//! towards positive angle. Yaw's error and reference go the short way round; roll and pitch are
//! taken as they come, for a craft that has rolled over is not flown by this law.

use crate::allocation::mixer::Directions;
use crate::config::gains::InnerLoop;
use crate::dsp::canceller::{Canceller, CancellerState};
use crate::dsp::prefilter::{Prefilter, PrefilterState};
use crate::dsp::trig::wrap_angle;
use crate::law::pid::{Pid, PidState, PidTerms};

/// The law of one angle, for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleLoop {
    prefilter: Prefilter,
    pid: Pid,
    canceller: Canceller,
}

/// Memory of an [`AngleLoop`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AngleLoopState {
    prefilter: PrefilterState,
    pid: PidState,
    canceller: CancellerState,
}

/// What one inner loop made of its command.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoopOutput {
    /// Prefiltered command, rad or m.
    pub reference: f32,
    /// Reference minus measurement, rad or m.
    pub error: f32,
    /// Parts and output.
    pub terms: PidTerms,
}

impl AngleLoop {
    /// Builds the law; period in s.
    pub fn new(gains: &InnerLoop, period_s: f64, anti_windup: bool) -> Self {
        Self {
            prefilter: Prefilter::new(gains.prefilter_rad_s, period_s),
            pid: Pid::of_inner_loop(gains, period_s, anti_windup),
            canceller: gains.canceller.map_or(Canceller::NONE, |canceller| {
                Canceller::new(canceller.zero_rad_s, canceller.pole_rad_s, period_s)
            }),
        }
    }

    /// Integrator and canceller at rest, the command (rad) as if it had always been there.
    pub fn start(&self, command_rad: f32) -> AngleLoopState {
        AngleLoopState { prefilter: self.prefilter.steady(command_rad), ..AngleLoopState::default() }
    }

    /// One period of roll or pitch: command and angle in rad, body rate in rad/s.
    #[inline]
    pub fn step_tilt(
        &self,
        state: &mut AngleLoopState,
        command_rad: f32,
        angle_rad: f32,
        rate_rad_s: f32,
        refused: Directions,
    ) -> LoopOutput {
        let reference = self.prefilter.step(&mut state.prefilter, command_rad);
        self.close(state, reference, reference - angle_rad, rate_rad_s, refused)
    }

    /// One period of yaw: command and angle in rad on any branch, body rate in rad/s.
    #[inline]
    pub fn step_yaw(
        &self,
        state: &mut AngleLoopState,
        command_rad: f32,
        angle_rad: f32,
        rate_rad_s: f32,
        refused: Directions,
    ) -> LoopOutput {
        let reference = self.prefilter.step_angle(&mut state.prefilter, command_rad);
        self.close(state, reference, wrap_angle(reference - angle_rad), rate_rad_s, refused)
    }

    #[inline]
    fn close(
        &self,
        state: &mut AngleLoopState,
        reference: f32,
        error: f32,
        rate_rad_s: f32,
        refused: Directions,
    ) -> LoopOutput {
        let AngleLoopState { pid, canceller, .. } = state;
        let terms =
            self.pid.step_through(pid, error, rate_rad_s, refused, |sum| self.canceller.step(canceller, sum));
        LoopOutput { reference, error, terms }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::{Config, Law};
    use core::f32::consts::PI;

    const FREE: Directions = Directions::NONE;

    fn gains() -> (InnerLoop, InnerLoop) {
        let Law::ModelBased(law) = Config::thesis().law else { unreachable!() };
        (law.loops.roll, law.loops.yaw)
    }

    /// The first output to an error of 1 is the canceller's direct gain times kp + ki Ts, minus the
    /// rate's share.
    #[test]
    fn canceller_acts_on_the_sum_but_not_on_the_rate() {
        let roll = AngleLoop::new(&gains().0, 0.01, true);
        let mut state = roll.start(1.0);
        let out = roll.step_tilt(&mut state, 1.0, 0.0, 2.0, FREE);
        let want = 0.35885651173821 * (100.0 + 100.0 * 0.01) - 10.0 * 2.0;
        // The prefilter's constant gain is 1 to 6e-7 (rounded coefficients), and 36 times that is
        // 2.2e-5.
        assert!((f64::from(out.terms.output) - want).abs() < 4e-5, "{out:?} {want}");
        assert!((out.error - 1.0).abs() < 1e-6);
    }

    #[test]
    fn yaw_error_is_the_short_way() {
        let yaw = AngleLoop::new(&gains().1, 0.01, true);
        let mut state = yaw.start(PI - 0.1);
        let out = yaw.step_yaw(&mut state, PI - 0.1, -PI + 0.1, 0.0, FREE);
        assert!((out.error + 0.2).abs() < 1e-5, "turns left by 0.2, not right by 6.1: {out:?}");
        assert!(out.terms.output < 0.0);
    }

    #[test]
    fn a_command_from_the_start_is_no_jump() {
        let roll = AngleLoop::new(&gains().0, 0.01, true);
        let mut state = roll.start(0.3);
        let out = roll.step_tilt(&mut state, 0.3, 0.3, 0.0, FREE);
        assert!(out.error.abs() < 1e-6 && out.terms.output.abs() < 1e-4, "{out:?}");
    }
}
