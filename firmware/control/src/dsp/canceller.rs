//! The lag zero-canceller of the roll and pitch loops, `(s/z1 + 1) / (s/p1 + 1)`, thesis (5.9) and
//! Table 5.1.
//!
//! Roll and pitch of the identified craft have a slow zero (0.21 rad/s), which would leave a large
//! steady error. The canceller's pole stands on it and its own zero takes over at 0.6 rad/s. It
//! acts on proportional plus integral part, not on the velocity feedback (thesis (5.24) to (5.28)),
//! and starts at rest like the integrator it follows.

use crate::dsp::filter::{FirstOrder, FirstOrderState};

/// Lag canceller, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Canceller {
    filter: FirstOrder,
}

/// Memory of a [`Canceller`]; the default is rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CancellerState {
    filter: FirstOrderState,
}

impl Canceller {
    /// Changes nothing.
    pub const NONE: Self = Self { filter: FirstOrder::PASS };

    /// Zero and pole in rad/s, period in s.
    pub fn new(zero_rad_s: f64, pole_rad_s: f64, period_s: f64) -> Self {
        Self { filter: FirstOrder::lag(zero_rad_s, pole_rad_s, period_s).rounded() }
    }

    /// One sample.
    #[inline]
    pub fn step(&self, state: &mut CancellerState, x: f32) -> f32 {
        self.filter.step(&mut state.filter, x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behind a plant zero at -0.2149 (here its exact sampled image) only the new zero at -0.6 is
    /// left: the chain is `k (z - exp(-0.6 Ts))`, whose impulse response ends after two samples.
    #[test]
    fn cancels_the_zero_and_leaves_the_new_one() {
        let canceller = Canceller::new(0.6, 0.2149, 0.01);
        let mut state = CancellerState::default();
        let (old_zero, new_zero) = (libm::exp(-0.002149), libm::exp(-0.006));
        let mut previous = 0.0;
        let mut first = 0.0;
        for k in 0..2000 {
            let impulse = if k == 0 { 1.0 } else { 0.0 };
            let x = (impulse - old_zero * previous) as f32;
            previous = impulse;
            let y = f64::from(canceller.step(&mut state, x));
            match k {
                0 => first = y,
                // Rounding of the pole, input and output to f32: a few units of 6e-8.
                1 => assert!((y + first * new_zero).abs() < 3e-7, "{y}"),
                _ => assert!(y.abs() < 3e-7, "{k}: {y} is left of the slow zero"),
            }
        }
    }

    #[test]
    fn absent_changes_nothing() {
        let mut state = CancellerState::default();
        assert_eq!(Canceller::NONE.step(&mut state, 1.25), 1.25);
        assert_eq!(Canceller::NONE.step(&mut state, -3.5), -3.5);
    }
}
