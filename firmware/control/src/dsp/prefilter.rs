//! What is done to a command before an error is made of it: first-order low-pass and rate limit
//! (thesis 5.1, "Prefilters").
//!
//! Both start where they are told to, not at zero, and both are bounded: a bounded command gives a
//! bounded reference.

use crate::dsp::filter::{FirstOrder, FirstOrderState};
use crate::dsp::trig::wrap_angle;

/// First-order low-pass on a command, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prefilter {
    filter: FirstOrder,
}

/// Memory of a [`Prefilter`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PrefilterState {
    filter: FirstOrderState,
}

impl Prefilter {
    /// `a / (s + a)` with the corner in rad/s, or the command itself if there is none; period in s.
    pub fn new(corner_rad_s: Option<f64>, period_s: f64) -> Self {
        let filter =
            corner_rad_s.map_or(FirstOrder::PASS, |corner| FirstOrder::low_pass(corner, period_s).rounded());
        Self { filter }
    }

    /// The memory of a command that has always been `command`.
    pub fn steady(&self, command: f32) -> PrefilterState {
        PrefilterState { filter: self.filter.steady(command) }
    }

    /// The next reference.
    #[inline]
    pub fn step(&self, state: &mut PrefilterState, command: f32) -> f32 {
        self.filter.step(&mut state.filter, command)
    }

    /// The next reference of an angle in rad. The reference turns the short way round, and stays
    /// near (-pi, pi].
    #[inline]
    pub fn step_angle(&self, state: &mut PrefilterState, command_rad: f32) -> f32 {
        if self.filter.b0 != 0.0 {
            return self.step(state, command_rad); // no filter: no way to be long or short
        }
        let reference = state.filter.next_output();
        let to_go = command_rad - reference;
        let short = wrap_angle(to_go);
        if short != to_go {
            // The same past seen from the command's branch: moved by whole turns, so that less than
            // half a turn is left.
            state.filter.add(self.filter.steady(to_go - short));
        }
        self.step(state, command_rad)
    }
}

/// Lets a reference move at most so far in one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateLimiter {
    step: f32,
}

impl RateLimiter {
    /// Greatest rate in units per second, period in s.
    pub fn new(rate_per_s: f64, period_s: f64) -> Self {
        Self { step: (rate_per_s * period_s) as f32 }
    }

    /// Moves the reference towards the command. A command that is not a number leaves it where it
    /// is.
    #[inline]
    pub fn step(&self, reference: &mut f32, command: f32) -> f32 {
        let to_go = command - *reference;
        if to_go.abs() <= self.step {
            *reference += to_go;
        } else if to_go > 0.0 {
            *reference += self.step;
        } else if to_go < 0.0 {
            *reference -= self.step;
        }
        *reference
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::PI;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::cases::cases(10_000))]

        /// Any bits: the reference moves by no more than the limit (and one rounding of its own),
        /// and stays a number.
        #[test]
        fn rate_limit_holds_for_any_command(start in -10.0_f32..10.0, bits in proptest::collection::vec(any::<u32>(), 1..50)) {
            let limiter = RateLimiter::new(0.5, 0.01);
            let mut reference = start;
            for command in bits.into_iter().map(f32::from_bits) {
                let before = reference;
                let after = limiter.step(&mut reference, command);
                prop_assert!(after.is_finite());
                prop_assert!((after - before).abs() <= 0.005 + 1e-6, "{before} -> {after} for {command}");
            }
        }

        #[test]
        fn rate_limit_arrives_and_stays(start in -2.0_f32..2.0, command in -2.0_f32..2.0) {
            let limiter = RateLimiter::new(0.5, 0.01);
            let mut reference = start;
            for _ in 0..810 { limiter.step(&mut reference, command); }
            // The last move is command - reference, rounded twice.
            prop_assert!((reference - command).abs() <= 3e-7, "{reference} {command}");
        }
    }

    #[test]
    fn one_metre_takes_two_seconds() {
        let limiter = RateLimiter::new(0.5, 0.01);
        let mut reference = 0.0;
        let ticks = (1..).find(|_| limiter.step(&mut reference, 1.0) >= 1.0 - 1e-5).unwrap();
        assert_eq!(ticks, 200);
    }

    #[test]
    fn low_pass_starts_steady_and_follows_the_closed_form() {
        let prefilter = Prefilter::new(Some(5.0), 0.01);
        let mut state = prefilter.steady(1.0);
        for k in 0..300 {
            let want = 2.0 - libm::exp(-0.05 * f64::from(k));
            let got = prefilter.step(&mut state, 2.0);
            // Rounding of f32 near 2, piled up over 1 - pole = 0.049.
            assert!((f64::from(got) - want).abs() < 5e-6, "{k}: {got} {want}");
        }
    }

    #[test]
    fn without_a_corner_the_command_passes() {
        let prefilter = Prefilter::new(None, 0.01);
        let mut state = prefilter.steady(0.0);
        assert_eq!(prefilter.step(&mut state, 0.7), 0.7);
        assert_eq!(prefilter.step_angle(&mut state, -3.0), -3.0);
    }

    #[test]
    fn yaw_goes_the_short_way_round() {
        let prefilter = Prefilter::new(Some(4.0), 0.01);
        let mut state = prefilter.steady(3.0);
        for _ in 0..1000 {
            let reference = prefilter.step_angle(&mut state, -3.0);
            assert!(wrap_angle(reference - PI).abs() < 0.15, "passes through pi, not through 0: {reference}");
        }
        assert!((prefilter.step_angle(&mut state, -3.0) + 3.0).abs() < 1e-5);
    }

    #[test]
    fn turning_on_and_on_stays_bounded() {
        let prefilter = Prefilter::new(Some(4.0), 0.01);
        let mut state = prefilter.steady(0.0);
        for k in 0..if cfg!(miri) { 5_000 } else { 100_000 } {
            let reference = prefilter.step_angle(&mut state, wrap_angle(k as f32 * 0.01));
            assert!(reference.abs() < 2.0 * PI);
        }
    }
}
