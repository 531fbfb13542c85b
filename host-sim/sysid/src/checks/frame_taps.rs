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

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(of: impl Fn(f64) -> f64) -> [Vec<f64>; 3] {
        std::array::from_fn(|i| (0..200).map(|k| (i + 1) as f64 * of(0.01 * f64::from(k))).collect())
    }

    /// Two windows of 0.7 s, one after the other, reach 0.7 s to either side.
    #[test]
    fn a_parabola_has_its_derivatives_along_each_axis() {
        let taps = Taps::new(0.01);
        assert_eq!(taps.half(), 70);
        let way = signal(|t| 0.5 - 2.0 * t + 3.0 * t * t);
        for k in [70, 100, 129] {
            let t = 0.01 * k as f64;
            let (first, second) = (taps.at(&taps.first, &way, k), taps.at(&taps.second, &way, k));
            for i in 0..3 {
                let scale = (i + 1) as f64;
                assert!((second[i] - 6.0 * scale).abs() < 1e-9, "{second}");
                assert!((first[i] - (6.0 * t - 2.0) * scale).abs() < 1e-9, "{first}");
            }
        }
        let constant = taps.at(&taps.smooth, &signal(|_| 0.7), 100);
        assert!((constant - Vector3::new(0.7, 1.4, 2.1)).norm() < 1e-12, "{constant}");
    }

    /// What a wave loses in one it loses in all, beside the trapezoid between samples, whose factor is
    /// (w T / 2) / tan(w T / 2).
    #[test]
    fn all_three_pass_the_same_part_of_a_wave() {
        let taps = Taps::new(0.01);
        for w in [1.0, 4.0, 8.0, 15.0_f64] {
            let gain = |taps: &[f64], phase: fn(f64) -> f64| -> f64 {
                taps.iter().enumerate().map(|(k, tap)| tap * phase(w * 0.01 * (k as f64 - 70.0))).sum()
            };
            let trapezoid = 0.005 * w / (0.005 * w).tan();
            let passed = gain(&taps.smooth, f64::cos);
            let (first, second) = (gain(&taps.first, f64::sin), gain(&taps.second, f64::cos));
            assert!((first * trapezoid - w * passed).abs() < 1e-10, "{w}: {first}");
            assert!((second * trapezoid * trapezoid + w * w * passed).abs() < 1e-9, "{w}: {second}");
        }
    }
}
