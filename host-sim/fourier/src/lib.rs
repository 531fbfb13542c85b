//! Discrete Fourier transforms of any length.
//!
//! The library behind them is generic: each crate that asks it for a transform compiles hundreds of them anew, which was a third of what
//! `sysid` compiles to. Here they are compiled once. They use no vector instructions, so that every machine gives the same bits.

#![forbid(unsafe_code)]

use std::sync::Arc;

pub use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Plans transforms; equal lengths share what is computed for them.
pub struct Planner(FftPlanner<f64>);

impl Default for Planner {
    fn default() -> Self {
        Self::new()
    }
}

impl Planner {
    /// Without any plan yet.
    pub fn new() -> Self {
        Self(FftPlanner::new())
    }

    /// The transform of so many values: sums of `x[n] exp(-2 pi i n k / length)` over n.
    pub fn forward(&mut self, length: usize) -> Transform {
        Transform(self.0.plan_fft_forward(length))
    }

    /// The way back, `length` times as large: nothing is divided by the length.
    pub fn inverse(&mut self, length: usize) -> Transform {
        Transform(self.0.plan_fft_inverse(length))
    }
}

/// A transform of one length.
#[derive(Clone)]
pub struct Transform(Arc<dyn Fft<f64>>);

impl Transform {
    /// Transforms in place.
    ///
    /// # Panics
    /// Where there are not a whole number of lengths of values.
    pub fn process(&self, values: &mut [Complex<f64>]) {
        self.0.process(values);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// Against the sum that defines it, at lengths with small factors, with large ones and with none.
    #[test]
    fn a_transform_is_the_sum_that_defines_it_and_comes_back() {
        let mut planner = Planner::new();
        for length in [1, 2, 12, 37, 64, 94, 101, 150] {
            let values: Vec<Complex<f64>> = (0..length)
                .map(|n| Complex::new((0.7 * n as f64).sin(), (0.1 * (n * n) as f64).cos()))
                .collect();
            let mut found = values.clone();
            planner.forward(length).process(&mut found);
            for (k, found) in found.iter().enumerate() {
                let turn = |n: usize| Complex::cis(-TAU * (n * k % length) as f64 / length as f64);
                let sum: Complex<f64> = values.iter().enumerate().map(|(n, value)| value * turn(n)).sum();
                assert!((found - sum).norm() < 1e-12 * length as f64, "{length}, {k}: {found} {sum}");
            }
            planner.inverse(length).process(&mut found);
            for (found, value) in found.iter().zip(&values) {
                assert!((found / length as f64 - value).norm() < 1e-13, "{length}: {found} {value}");
            }
        }
    }
}
