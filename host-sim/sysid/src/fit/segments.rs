//! Segments of a signal for Welch's method: they overlap by half, each about its mean and in a window of Hann's.

use std::f64::consts::TAU;

use fourier::{Complex, Planner, Transform};

/// Cuts and transforms segments of one length.
pub struct Segments {
    window: Vec<f64>,
    transform: Transform,
}

impl Segments {
    /// Segments of so many samples, at least two.
    pub fn new(length: usize) -> Self {
        let window = (0..length).map(|k| 0.5 - 0.5 * (TAU * k as f64 / length as f64).cos()).collect();
        Self { window, transform: Planner::new().forward(length) }
    }

    /// Sum of the squares of the window.
    pub fn power(&self) -> f64 {
        self.window.iter().map(|w| w * w).sum()
    }

    /// The transform of each segment; none of a signal that is shorter.
    pub fn of<'a>(&'a self, signal: &'a [f64]) -> impl Iterator<Item = Vec<Complex<f64>>> {
        let length = self.window.len();
        signal.windows(length).step_by(length / 2).map(|segment| self.transformed(segment))
    }

    fn transformed(&self, segment: &[f64]) -> Vec<Complex<f64>> {
        let mean = segment.iter().sum::<f64>() / segment.len() as f64;
        let mut bins: Vec<Complex<f64>> = segment
            .iter()
            .zip(&self.window)
            .map(|(value, window)| Complex::from((value - mean) * window))
            .collect();
        self.transform.process(&mut bins);
        bins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_of_a_whole_number_of_periods_is_in_three_bins() {
        let sine: Vec<f64> = (0..40).map(|k| 7.0 + (TAU * 4.0 * f64::from(k) / 16.0).sin()).collect();
        let segments = Segments::new(16);
        assert!((segments.power() - 6.0).abs() < 1e-12);
        let all: Vec<_> = segments.of(&sine).collect();
        assert_eq!(all.len(), 4);
        for bins in &all {
            let found = |k: usize| bins[k].norm();
            assert!((found(4) - 4.0).abs() < 1e-9 && (found(3) - 2.0).abs() < 1e-9 && found(1) < 1e-9);
        }
        assert_eq!(segments.of(&sine[..15]).count(), 0);
    }
}
