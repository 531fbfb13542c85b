//! Filters for second derivatives of tracked signals, and for what stands beside them in an
//! equation.

use nalgebra::Vector3;

use crate::filter::{RegressionFilter, compose, sum_of_products};

/// Window of the filters for accelerations, s: a tracker differentiated twice needs a long one.
const WINDOW_S: f64 = 0.7;

/// Filters for the second derivative, for the first through the same window, and for what is as it
/// is.
pub(super) struct Taps {
    pub(super) second: Vec<f64>,
    pub(super) first: Vec<f64>,
    pub(super) smooth: Vec<f64>,
}

impl Taps {
    pub(super) fn new(period_s: f64) -> Self {
        let filter = RegressionFilter::with_window(period_s, WINDOW_S);
        Self {
            second: compose(&filter.derivative, &filter.derivative),
            first: compose(&filter.derivative, &filter.matched),
            smooth: compose(&filter.matched, &filter.matched),
        }
    }

    pub(super) fn half(&self) -> usize {
        self.second.len() / 2
    }

    pub(super) fn at(&self, taps: &[f64], signal: &[Vec<f64>; 3], k: usize) -> Vector3<f64> {
        Vector3::from(signal.each_ref().map(|s| sum_of_products(&s[k - self.half()..], taps)))
    }
}
