//! The outer loop, thesis 5.4: from a position command to roll and pitch commands.
//!
//! Per axis a rate-limited reference (0.5 m/s), `a = kp e + ki integral(e) - kd v` with v from `10
//! s/(s+10)` of the measured position; a is an angle in rad. Then, with the measured yaw psi,
//! `phi_c = -sin(psi) a_x + cos(psi) a_y` and `theta_c = -(cos(psi) a_x + sin(psi) a_y)`: a
//! positive roll pushes along +y, a positive pitch along -x (thesis (5.17), (5.18)).
//!
//! The reference starts at the measured position when the loop is closed, and integrators and
//! velocity start at zero.

use crate::allocation::mixer::Directions;
use crate::config::gains::PositionLoop as Gains;
use crate::dsp::filter::{FirstOrder, FirstOrderState, GainRule};
use crate::dsp::prefilter::RateLimiter;
use crate::dsp::trig;
use crate::law::pid::{Pid, PidState, PidTerms};
use crate::law::terms::OuterTerms;

/// The law of one horizontal axis, for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    limiter: RateLimiter,
    velocity: FirstOrder,
    pid: Pid,
}

/// Memory of one horizontal axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct AxisState {
    reference_m: f32,
    velocity: FirstOrderState,
    pid: PidState,
}

/// One axis' reference, error, velocity and loop terms.
struct AxisOutput {
    reference_m: f32,
    error_m: f32,
    velocity_m_s: f32,
    terms: PidTerms,
}

impl Axis {
    fn new(gains: &Gains, rule: GainRule, period_s: f64, anti_windup: bool) -> Self {
        Self {
            limiter: RateLimiter::new(gains.rate_limit_m_s, period_s),
            velocity: FirstOrder::derivative(gains.velocity_filter_rad_s, period_s, rule).rounded(),
            pid: Pid::new(gains.kp, gains.ki, gains.kd, gains.output_limit_rad, period_s, anti_windup),
        }
    }

    fn start(&self, position_m: f32) -> AxisState {
        AxisState {
            reference_m: position_m,
            velocity: self.velocity.steady(position_m),
            pid: PidState::default(),
        }
    }

    #[inline]
    fn step(
        &self,
        state: &mut AxisState,
        command_m: f32,
        position_m: f32,
        refused: Directions,
    ) -> AxisOutput {
        let reference_m = self.limiter.step(&mut state.reference_m, command_m);
        let velocity_m_s = self.velocity.step(&mut state.velocity, position_m);
        let error_m = reference_m - position_m;
        // What lies behind this loop is the attitude loop, not a limit: only the own limit stops
        // the integral, or that the craft stands on something.
        let terms = self.pid.step(&mut state.pid, error_m, velocity_m_s, refused);
        AxisOutput { reference_m, error_m, velocity_m_s, terms }
    }
}

/// The outer loop for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionLaw {
    x: Axis,
    y: Axis,
}

/// Memory of a [`PositionLaw`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PositionState {
    x: AxisState,
    y: AxisState,
}

impl PositionLaw {
    /// Builds the law; period in s.
    pub fn new(x: &Gains, y: &Gains, rule: GainRule, period_s: f64, anti_windup: bool) -> Self {
        Self { x: Axis::new(x, rule, period_s, anti_windup), y: Axis::new(y, rule, period_s, anti_windup) }
    }

    /// The memory with which the loop is closed at a measured position (m).
    pub fn start(&self, [x_m, y_m]: [f32; 2]) -> PositionState {
        PositionState { x: self.x.start(x_m), y: self.y.start(y_m) }
    }

    /// One period: command and position in m, yaw in rad, and what is refused along both axes, in
    /// both directions or none. Gives roll and pitch commands in rad, and the terms.
    #[inline]
    pub fn step(
        &self,
        state: &mut PositionState,
        [command_x, command_y]: [f32; 2],
        [x_m, y_m]: [f32; 2],
        yaw_rad: f32,
        refused: Directions,
    ) -> ([f32; 2], OuterTerms) {
        let x = self.x.step(&mut state.x, command_x, x_m, refused);
        let y = self.y.step(&mut state.y, command_y, y_m, refused);
        let (sine, cosine) = trig::sin_cos(yaw_rad);
        let (ax, ay) = (x.terms.output, y.terms.output);
        let roll = cosine * ay - sine * ax;
        let pitch = -(cosine * ax + sine * ay);
        let terms = OuterTerms {
            reference_m: [x.reference_m, y.reference_m],
            error_m: [x.error_m, y.error_m],
            velocity_m_s: [x.velocity_m_s, y.velocity_m_s],
            x: x.terms,
            y: y.terms,
        };
        ([roll, pitch], terms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::{Config, Law};
    use core::f32::consts::FRAC_PI_2;

    const FREE: Directions = Directions::NONE;

    fn law() -> PositionLaw {
        let Law::ModelBased(law) = Config::thesis().law else { unreachable!() };
        PositionLaw::new(&law.loops.x, &law.loops.y, GainRule::Matlab, 0.01, true)
    }

    /// Forward (+x) needs the nose down (theta < 0), right (+y) needs a roll to the right; at yaw
    /// 90 degrees the nose points along +y, so +x is to the left.
    #[test]
    fn directions() {
        let after_half_a_second = |command, yaw| {
            let law = law();
            let mut state = law.start([0.0; 2]);
            let mut out = [0.0; 2];
            for _ in 0..50 {
                out = law.step(&mut state, command, [0.0; 2], yaw, FREE).0;
            }
            out
        };
        // 0.25 m of reference: a = 0.3 * 0.25 + 0.02 * 0.25 * 0.51 / 2 = 0.076275; rounding of 50
        // f32 steps.
        let a = 0.076_275;
        let near = |got: [f32; 2], want: [f32; 2]| {
            assert!((got[0] - want[0]).abs() < 1e-6 && (got[1] - want[1]).abs() < 1e-6, "{got:?} {want:?}");
        };
        near(after_half_a_second([1.0, 0.0], 0.0), [0.0, -a]);
        near(after_half_a_second([0.0, 1.0], 0.0), [a, 0.0]);
        near(after_half_a_second([1.0, 0.0], FRAC_PI_2), [-a, 0.0]);
        near(after_half_a_second([0.0, 1.0], FRAC_PI_2), [0.0, -a]);
    }

    #[test]
    fn closing_the_loop_away_from_the_origin_asks_for_nothing() {
        let law = law();
        let mut state = law.start([1.5, -0.5]);
        let (angles, terms) = law.step(&mut state, [1.5, -0.5], [1.5, -0.5], 0.3, FREE);
        // The velocity filter's memory is -9.5 * 1.5, its direct part +9.5 * 1.5: equal in f32.
        assert_eq!((angles, terms.velocity_m_s), ([0.0; 2].map(|x: f32| x), [0.0; 2]));
    }

    #[test]
    fn moving_towards_the_reference_is_braked() {
        let law = law();
        let mut state = law.start([0.0; 2]);
        let mut out = [0.0; 2];
        for k in 0..200 {
            out = law.step(&mut state, [0.0; 2], [k as f32 * 0.01, 0.0], 0.0, FREE).0;
        }
        assert!(out[1] > 0.3 * 1.9, "nose up against forward motion away from the reference: {out:?}");
    }
}
