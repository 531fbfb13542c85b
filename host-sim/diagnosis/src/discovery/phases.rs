//! Residuals of random phases: the colour of what the model leaves without its tie to anything measured.

use fourier::{Complex, Planner};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::discovery::problem::{Problem, White};

/// So many residuals with the spectrum, flight by flight and axis by axis, of that which the model leaves, and random phases.
pub(crate) fn of_random_phases(problem: &Problem<'_>, count: usize, seed: u64) -> Vec<[Vec<f64>; 6]> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut planner = Planner::new();
    (0..count)
        .map(|_| {
            let mut all: White = std::array::from_fn(|axis| {
                let mut values = Vec::with_capacity(problem.rows);
                for range in problem.ranges() {
                    let signal = &problem.residual[axis].as_slice()[range];
                    values.extend(shuffled(signal, &mut planner, &mut rng));
                }
                Some(values)
            });
            problem.take_out(&mut all);
            all.map(Option::unwrap_or_default)
        })
        .collect()
}

fn shuffled(signal: &[f64], planner: &mut Planner, rng: &mut impl Rng) -> Vec<f64> {
    let length = signal.len();
    let mut spectrum: Vec<Complex<f64>> = signal.iter().map(|value| Complex::new(*value, 0.0)).collect();
    planner.forward(length).process(&mut spectrum);
    for k in 1..length.div_ceil(2) {
        let turned = spectrum[k] * Complex::from_polar(1.0, rng.random::<f64>() * std::f64::consts::TAU);
        (spectrum[k], spectrum[length - k]) = (turned, turned.conj());
    }
    planner.inverse(length).process(&mut spectrum);
    spectrum.iter().map(|value| value.re / length as f64).collect()
}

/// Chance that the greatest of as many tries as gave `maxima` reaches `value`: a Gumbel distribution through their mean and spread.
pub(crate) fn chance_of(value: f64, maxima: &[f64]) -> f64 {
    const EULER: f64 = 0.577_215_664_901_532_9;
    let count = maxima.len() as f64;
    let mean = maxima.iter().sum::<f64>() / count;
    let variance = maxima.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let scale = (6.0 * variance).sqrt() / std::f64::consts::PI;
    let mode = mean - EULER * scale;
    -(-(-(value - mode) / scale.max(1e-9)).exp()).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn power(signal: &[f64]) -> Vec<f64> {
        let mut spectrum: Vec<Complex<f64>> = signal.iter().map(|v| Complex::new(*v, 0.0)).collect();
        Planner::new().forward(signal.len()).process(&mut spectrum);
        spectrum.iter().map(|c| c.norm_sqr()).collect()
    }

    #[test]
    fn random_phases_keep_the_spectrum_and_nothing_else() {
        let mut rng = Pcg64::seed_from_u64(4);
        for length in [64, 101] {
            let signal: Vec<f64> =
                (0..length).map(|k| (0.3 * f64::from(k)).sin() + rng.random::<f64>()).collect();
            let other = shuffled(&signal, &mut Planner::new(), &mut rng);
            let pairs = || power(&signal).into_iter().zip(power(&other));
            assert!(pairs().all(|(a, b)| (a - b).abs() < 1e-9 * a.max(1.0)));
            assert!(signal.iter().zip(&other).any(|(a, b)| (a - b).abs() > 0.1));
        }
    }

    /// Of a Gumbel distribution of mode 2 and scale 3, 1 - exp(-exp(-1)) lies above 5. Its quantiles stand for draws.
    #[test]
    fn chances_beyond_the_maxima_follow_gumbels_tail() {
        let quantile = |part: f64| 2.0 - 3.0 * (-part.ln()).ln();
        let maxima: Vec<f64> = (0..2000).map(|k| quantile((f64::from(k) + 0.5) / 2000.0)).collect();
        let expected = 1.0 - (-(-1.0_f64).exp()).exp();
        assert!((chance_of(5.0, &maxima) - expected).abs() < 0.005);
        assert!(chance_of(100.0, &maxima) < 1e-12 && chance_of(-100.0, &maxima) > 0.999);
    }
}
