//! PID with velocity feedback, thesis (5.7): `kp e + ki integral(e) - kd rate`.
//!
//! The rate is that of the measurement, not of the error, so a jump of the command does not kick
//! the output. The integral is `I += e Ts`, then used (backward Euler; "a simple and resettable
//! digital integrator", thesis 5.3.1); it holds error times time, without its gain.
//!
//! Anti-windup is conditional integration. The loop's own limit and whatever comes after it (the
//! motors) say in which direction they refused the last output; the integral does not go further in
//! that direction, but it may always come back. The sum's sign follows the error's because gains
//! are not negative. With nothing refused the law is exactly linear.

use crate::allocation::mixer::Directions;
use crate::config::gains::InnerLoop;

/// The parts of one loop's output, in the loop's output unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PidTerms {
    /// Proportional part.
    pub p: f32,
    /// Integral part.
    pub i: f32,
    /// Velocity feedback, sign included.
    pub d: f32,
    /// The loop's output: lag canceller applied to `p + i` where there is one, plus `d`, limited.
    pub output: f32,
}

/// Gains and limit of one loop for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pid {
    kp: f32,
    ki: f32,
    kd: f32,
    period_s: f32,
    /// Greatest magnitude of the output; infinite if there is no limit.
    limit: f32,
    anti_windup: bool,
}

/// Memory of a [`Pid`]; the default is rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PidState {
    /// Integral of the error, in rad s or m s.
    integral: f32,
    /// What the own limit refused in the last step.
    refused: Directions,
}

impl Pid {
    /// Gains are output units per rad (or m), rad s and rad/s; `limit` is in output units; period
    /// in s.
    pub fn new(kp: f64, ki: f64, kd: f64, limit: Option<f64>, period_s: f64, anti_windup: bool) -> Self {
        Self {
            kp: kp as f32,
            ki: ki as f32,
            kd: kd as f32,
            period_s: period_s as f32,
            limit: limit.map_or(f32::INFINITY, |l| l as f32),
            anti_windup,
        }
    }

    /// The gains of an inner loop.
    pub fn of_inner_loop(gains: &InnerLoop, period_s: f64, anti_windup: bool) -> Self {
        Self::new(gains.kp, gains.ki, gains.kd, gains.output_limit, period_s, anti_windup)
    }

    /// What the integral adds to the output now, in output units.
    pub(crate) fn integral_part(&self, state: &PidState) -> f32 {
        self.ki * state.integral
    }

    /// Does the error ask for more of what was refused?
    #[cold]
    #[inline(never)]
    fn is_blocked(&self, refused: Directions, error: f32) -> bool {
        self.anti_windup && (refused.high() && error > 0.0 || refused.low() && error < 0.0)
    }

    /// One step with nothing between the sum and the output. `refused` is what lay behind the
    /// loop's last output.
    #[inline]
    pub fn step(&self, state: &mut PidState, error: f32, rate: f32, refused: Directions) -> PidTerms {
        self.step_through(state, error, rate, refused, |proportional_plus_integral| {
            proportional_plus_integral
        })
    }

    /// One step with a filter between `p + i` and the velocity feedback (the lag canceller).
    #[inline]
    pub fn step_through(
        &self,
        state: &mut PidState,
        error: f32,
        rate: f32,
        refused: Directions,
        filter: impl FnOnce(f32) -> f32,
    ) -> PidTerms {
        let refused = refused.or(state.refused);
        if refused == Directions::NONE || !self.is_blocked(refused, error) {
            state.integral += error * self.period_s;
        }
        let (p, i, d) = (self.kp * error, self.ki * state.integral, -(self.kd * rate));
        let wanted = filter(p + i) + d;
        if wanted.abs() <= self.limit {
            state.refused = Directions::NONE;
            return PidTerms { p, i, d, output: wanted };
        }
        // Not `clamp`, which panics if a limit is not a number. A NaN stays one, for the end of the
        // tick to see.
        state.refused = Directions::new(wanted > 0.0, wanted < 0.0);
        let output = if wanted > 0.0 {
            self.limit
        } else if wanted < 0.0 {
            -self.limit
        } else {
            wanted
        };
        PidTerms { p, i, d, output }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FREE: Directions = Directions::NONE;
    const HIGH: Directions = Directions::HIGH;
    const LOW: Directions = Directions::LOW;

    /// One second of unit error integrates to ki at any rate: catches every hidden period.
    #[test]
    fn the_period_is_built_in() {
        for rate_hz in [50_u16, 100, 250, 1000] {
            let pid = Pid::new(0.0, 3.0, 0.0, None, 1.0 / f64::from(rate_hz), true);
            let mut state = PidState::default();
            let i = (0..rate_hz).map(|_| pid.step(&mut state, 1.0, 0.0, FREE).i).last().unwrap();
            // A thousand roundings of numbers below 1, times 3.
            assert!((i - 3.0).abs() < 1e-4, "{rate_hz} Hz: {i}");
        }
    }

    #[test]
    fn backward_euler_uses_the_new_integral() {
        let pid = Pid::new(2.0, 10.0, 0.5, None, 0.01, true);
        let terms = pid.step(&mut PidState::default(), 1.0, 4.0, FREE);
        assert_eq!((terms.p, terms.d), (2.0, -2.0));
        assert!((terms.i - 0.1).abs() < 1e-8);
        assert!((terms.output - 0.1).abs() < 1e-6);
    }

    #[test]
    fn refusal_stops_winding_up_but_never_unwinding() {
        let pid = Pid::new(1.0, 1.0, 0.0, None, 0.01, true);
        for (refused, sign) in [(HIGH, 1.0), (LOW, -1.0)] {
            let mut state = PidState { integral: 0.5 * sign, refused: FREE };
            assert_eq!(pid.step(&mut state, sign, 0.0, refused).i, 0.5 * sign, "blocked");
            let back = pid.step(&mut state, -sign, 0.0, refused).i;
            assert!((back - 0.49 * sign).abs() < 1e-6, "unwinds: {back}");
        }
        // Without anti-windup the refusal changes nothing: the flag is what blocks.
        let plain = Pid::new(1.0, 1.0, 0.0, None, 0.01, false);
        let mut state = PidState { integral: 0.5, refused: FREE };
        assert!(plain.step(&mut state, 1.0, 0.0, HIGH).i > 0.5);
    }

    #[test]
    fn own_limit_clamps_and_stops_the_integral() {
        let pid = Pid::new(1.0, 1.0, 0.0, Some(0.5), 0.01, true);
        let mut state = PidState::default();
        for _ in 0..10_000 {
            let terms = pid.step(&mut state, 1.0, 0.0, FREE);
            assert_eq!(terms.output, 0.5);
        }
        // Only the first step, before the limit had spoken, integrated.
        assert!((state.integral - 0.01).abs() < 1e-8);
        // After a hundred seconds of saturation the output leaves the limit with the error's sign,
        // at once.
        assert!(pid.step(&mut state, -0.1, 0.0, FREE).output < 0.0);
    }

    proptest! {
        /// Superposition: with nothing refused the law is linear, whatever the anti-windup flag
        /// says.
        #[test]
        fn without_limits_it_is_linear(errors in proptest::collection::vec((-1.0_f32..1.0, -5.0_f32..5.0), 1..100)) {
            let with = Pid::new(100.0, 100.0, 10.0, None, 0.01, true);
            let without = Pid::new(100.0, 100.0, 10.0, None, 0.01, false);
            let (mut a, mut b) = (PidState::default(), PidState::default());
            let mut sum = 0.0_f64;
            for (error, rate) in errors {
                let got = with.step(&mut a, error, rate, FREE);
                prop_assert_eq!(got, without.step(&mut b, error, rate, FREE));
                sum += f64::from(error) * 0.01;
                let want = 100.0 * f64::from(error) + 100.0 * sum - 10.0 * f64::from(rate);
                // A hundred f32 roundings of a sum below 1, times 100, and three of the terms.
                prop_assert!((f64::from(got.output) - want).abs() < 1e-3, "{} {}", got.output, want);
            }
        }
    }
}
