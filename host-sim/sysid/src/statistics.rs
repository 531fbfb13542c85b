//! Robust location, tests of significance, and corrections for testing many times.
//!
//! Residuals of flights are coloured: neighbouring samples are not independent. Tests therefore count blocks of time, as
//! long as the window of the coefficients' covariance, instead of samples.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// Fewest blocks that say anything about chance.
const FEWEST_BLOCKS: usize = 3;

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard deviation about the mean, of all values there are: divided by their number.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let middle = mean(values);
    mean(&values.iter().map(|v| (v - middle).powi(2)).collect::<Vec<_>>()).sqrt()
}

/// Pearson's coefficient of correlation; about zero where one of the two is constant.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let product = a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>() / a.len().max(1) as f64;
    product / (deviation(a) * deviation(b)).max(1e-12)
}

/// Median of some values; of an even number, the mean of the middle two.
pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// p-value of the hypothesis that all true values are zero: Wald's statistic against the F distribution.
///
/// `independent` is the number of independent observations that the covariance is known from. A covariance that is not
/// positive definite proves nothing: 1.
pub fn wald_p_value(values: &DVector<f64>, covariance: DMatrix<f64>, independent: f64) -> f64 {
    let k = values.len() as f64;
    let Some(cholesky) = covariance.cholesky() else { return 1.0 };
    let wald = values.dot(&cholesky.solve(values)) / k;
    let freedom = (independent - k).max(1.0);
    FisherSnedecor::new(k, freedom).map_or(1.0, |f| f.sf(wald))
}

/// Chance of `count` squares, each in units of its variance, that sum to as much; the variances have `freedom` degrees of freedom.
pub fn squares_p_value(squares: f64, count: usize, freedom: f64) -> f64 {
    let count = count as f64;
    FisherSnedecor::new(count, freedom.max(1.0)).map_or(1.0, |f| f.sf(squares / count))
}

/// Deviations beyond which, on either side, an estimate lies with chance `p_value` (Student).
pub fn deviations_of(p_value: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - 0.5 * p_value))
}

/// Turns p-values that Bonferroni's inequality has corrected (each times the number of tests, at most 1) into Holm's
/// (1979): the k-th smallest counts as one of those that are left, and none is smaller than one before it.
pub fn holm(p_values: &mut [f64]) {
    let count = p_values.len();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut largest = 0.0_f64;
    for (rank, &k) in order.iter().enumerate() {
        let adjusted = p_values[k] * (count - rank) as f64 / count as f64;
        // What Bonferroni cut at 1 stays there: its own value is not known.
        let adjusted = if p_values[k] >= 1.0 { 1.0 } else { adjusted };
        largest = largest.max(adjusted);
        p_values[k] = largest.min(1.0);
    }
}

/// Sums over blocks of `length` values, not across the `starts` of uninterrupted stretches. A remainder of less than
/// half a block is left out.
pub fn block_sums(values: &[f64], starts: &[usize], length: usize) -> Vec<f64> {
    let mut blocks = Vec::new();
    for (i, &start) in starts.iter().enumerate() {
        let end = starts.get(i + 1).copied().unwrap_or(values.len());
        blocks.extend(
            values[start..end]
                .chunks(length)
                .filter(|c| 2 * c.len() >= length)
                .map(|c| c.iter().sum::<f64>()),
        );
    }
    blocks
}

/// A gain on held-out flights, block by block. With e left by the better model, which predicts d more than the other, the
/// gain is (e + d)^2 - e^2 = d^2 + 2 e d, and 2 e d is the part that noise has in it.
///
/// The spread of the gain itself is no measure of chance: an effect that shows in one low pass of a flight has all its
/// gain in one block, and a t test over blocks then calls it luck, however large it is.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Blocks {
    /// The gain of each block.
    pub gain: Vec<f64>,
    /// The part of it that noise made.
    pub chance: Vec<f64>,
}

impl Blocks {
    /// Takes in blocks of another axis, in units of its own.
    pub fn extend_by(&mut self, other: &Self, scale: f64) {
        self.gain.extend(other.gain.iter().map(|gain| scale * gain));
        self.chance.extend(other.chance.iter().map(|chance| scale * chance));
    }

    /// p-value of "the gain is no more than noise made it", by Student's t over the blocks.
    pub fn p_value(&self) -> f64 {
        let n = self.gain.len() as f64;
        if self.gain.len() < FEWEST_BLOCKS {
            return 1.0;
        }
        let gain: f64 = self.gain.iter().sum();
        let spread = self.chance.iter().map(|c| c * c).sum::<f64>().sqrt();
        if !(spread > 0.0) {
            return if gain > 0.0 { 0.0 } else { 1.0 };
        }
        StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |d| d.sf(gain / spread))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_that_of_sines() {
        let sine = |phase: f64| -> Vec<f64> {
            (0..1000).map(|k| 3.0 + (f64::from(k) * std::f64::consts::TAU / 100.0 + phase).sin()).collect()
        };
        // Whole periods: the correlation of two sines is the cosine of their phase difference.
        for phase in [0.0, 0.3, 1.2, std::f64::consts::PI] {
            assert!((correlation(&sine(0.0), &sine(phase)) - phase.cos()).abs() < 1e-12, "{phase}");
        }
        assert_eq!(correlation(&[1.0; 5], &[1.0, 2.0, 3.0, 4.0, 5.0]), 0.0, "a constant");
    }

    /// Of tables: F(4, 10) at 5 % is 3.478, t(10) at 5 % on either side together 2.228.
    #[test]
    fn chances_are_those_of_tables() {
        assert!((squares_p_value(4.0 * 3.478, 4, 10.0) - 0.05).abs() < 1e-4);
        assert!((deviations_of(0.05, 10.0) - 2.228).abs() < 1e-3);
    }

    #[test]
    fn medians_of_odd_even_and_no_values() {
        assert_eq!(median(&mut [3.0, -1.0, 7.0]), Some(3.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 100.0]), Some(3.5));
        assert_eq!(median(&mut []), None);
    }

    /// Upper 5 % and 1 % points of tables of the F distribution.
    #[test]
    fn walds_statistic_meets_the_tables_of_f() {
        for (k, freedom, point, p) in [
            (1, 10.0, 4.9646, 0.05),
            (2, 10.0, 7.5594, 0.01),
            (3, 20.0, 3.0984, 0.05),
            (4, 60.0, 3.6490, 0.01),
        ] {
            // k values whose mean square in standard errors is the point.
            let errors = DVector::from_fn(k, |i, _| 0.5 + i as f64);
            let values = f64::sqrt(point) * &errors;
            let covariance = DMatrix::from_diagonal(&errors.component_mul(&errors));
            let found = wald_p_value(&values, covariance, freedom + k as f64);
            assert!((found / p - 1.0).abs() < 1e-3, "F({k}, {freedom}): {found}");
        }
    }

    /// One coefficient: F(1, n) is the square of Student's t with n degrees of freedom, two-sided. 2.2281 is its 2.5 % point
    /// at 10.
    #[test]
    fn one_coefficient_is_students_two_sided_test() {
        let found = wald_p_value(&DVector::from_element(1, 2.2281), DMatrix::identity(1, 1), 11.0);
        assert!((found - 0.05).abs() < 1e-5, "{found}");
    }

    /// Wald's statistic does not depend on the units or the combination of coefficients.
    #[test]
    fn walds_test_is_invariant_under_linear_maps() {
        let values = DVector::from_vec(vec![0.7, -1.1]);
        let covariance = DMatrix::from_row_slice(2, 2, &[0.3, 0.1, 0.1, 0.2]);
        let map = DMatrix::from_row_slice(2, 2, &[1000.0, 2.0, -0.1, 0.5]);
        let before = wald_p_value(&values, covariance.clone(), 25.0);
        let after = wald_p_value(&(&map * &values), &map * covariance * map.transpose(), 25.0);
        assert!((before / after - 1.0).abs() < 1e-9, "{before} {after}");
        assert!(before > 0.0 && before < 0.5);
    }

    #[test]
    fn a_covariance_that_is_none_proves_nothing() {
        let singular = DMatrix::from_element(2, 2, 1.0);
        assert_eq!(wald_p_value(&DVector::from_element(2, 9.0), -singular, 50.0), 1.0);
    }

    /// R's `p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")`: 0.03 0.06 0.06 0.02.
    #[test]
    fn holms_correction_of_four_tests() {
        let mut p = [0.01, 0.04, 0.03, 0.005].map(|p| 4.0 * p);
        holm(&mut p);
        for (found, expected) in p.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-12, "{p:?}");
        }
        let mut cut = [1.0, 0.4, 0.02];
        holm(&mut cut);
        assert_eq!(cut[0], 1.0);
    }

    #[test]
    fn blocks_do_not_cross_gaps_and_short_remainders_are_left_out() {
        let values: Vec<f64> = (0..11).map(f64::from).collect();
        // 0 to 3, 4 (left out) | 5 to 8, 9 and 10 (half a block).
        assert_eq!(block_sums(&values, &[0, 5], 4), [6.0, 26.0, 19.0]);
    }

    /// Noise of +-1 in each of 10 blocks and a gain of t times the root of 10 in all: Student's t with 9 degrees of freedom, of
    /// which 1.8331 is the 5 % point, wherever in the flight the gain is.
    #[test]
    fn a_gain_is_held_against_noise_wherever_it_is() {
        let chance: Vec<f64> = (0..10).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let gain = 1.8331 * 10_f64.sqrt();
        let everywhere = vec![gain / 10.0; 10];
        let mut in_one = vec![0.0; 10];
        in_one[3] = gain;
        for gain in [everywhere, in_one] {
            let p = Blocks { gain, chance: chance.clone() }.p_value();
            assert!((p - 0.05).abs() < 1e-5, "{p}");
        }
    }

    #[test]
    fn too_few_blocks_prove_nothing_and_a_gain_without_noise_is_certain() {
        let blocks = |gain: &[f64]| Blocks { gain: gain.to_vec(), chance: vec![0.0; gain.len()] };
        assert_eq!(blocks(&[1.0, 1.0]).p_value(), 1.0);
        assert_eq!(blocks(&[1.0, 1.0, 1.0]).p_value(), 0.0);
        assert_eq!(blocks(&[1.0, -2.0, 1.0]).p_value(), 1.0);
    }
}
