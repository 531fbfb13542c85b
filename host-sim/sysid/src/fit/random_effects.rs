//! Observations in groups that differ by a constant of their own: value = X b + group + noise, both random.
//!
//! The variances are those of restricted maximum likelihood (Patterson and Thompson 1971), penalised so that no scatter between
//! groups is taken for zero because a handful of them happen to agree (after Chung, Rabe-Hesketh, Dorie, Gelman and Liu 2013: the
//! density of a gamma distribution, here with shape 3/2, that two groups are enough for). The coefficients are those of
//! generalised least squares. One group's observations share its constant, so however many there are, they tell no more of the
//! mean of all groups than the scatter between groups allows.

use nalgebra::{DMatrix, DVector};

/// A group's observations: value and the row of X that goes with it.
pub(crate) type Group = Vec<(f64, Vec<f64>)>;

/// What was estimated.
#[derive(Debug, Clone)]
pub(crate) struct RandomEffects {
    /// Coefficients.
    pub(crate) value: DVector<f64>,
    /// Their covariance.
    pub(crate) covariance: DMatrix<f64>,
    /// Standard deviation between groups.
    pub(crate) between: f64,
    /// Standard deviation within a group.
    pub(crate) within: f64,
}

/// Ratios of the variances that are tried, and how often the best one's neighbourhood is cut in half. The likelihood is flat
/// about its maximum: a tenth of the ratio changes nothing that matters.
const RATIOS: usize = 61;
const LARGEST_DECADE: f64 = 8.0;
const DECADES: f64 = 12.0;
const HALVINGS: usize = 6;

/// Nothing where there are not more observations than coefficients, or fewer than two groups.
pub(crate) fn estimate(groups: &[Group]) -> Option<RandomEffects> {
    let coefficients = groups.first()?.first()?.1.len();
    let count: usize = groups.iter().map(Vec::len).sum();
    if groups.len() < 2 || count <= coefficients + groups.len() {
        return None;
    }
    let mut best = solve(groups, coefficients, 10_f64.powf(LARGEST_DECADE))?;
    let mut exponent = LARGEST_DECADE;
    let mut consider = |candidate: f64, exponent: &mut f64| {
        let Some(solved) = solve(groups, coefficients, 10_f64.powf(candidate)) else { return };
        if solved.deviance < best.deviance {
            (best, *exponent) = (solved, candidate);
        }
    };
    let mut step = DECADES / (RATIOS - 1) as f64;
    for k in 0..RATIOS {
        consider(LARGEST_DECADE - step * k as f64, &mut exponent);
    }
    for _ in 0..HALVINGS {
        step *= 0.5;
        let middle = exponent;
        consider(middle - step, &mut exponent);
        consider(middle + step, &mut exponent);
    }
    Some(best.result)
}

struct Solved {
    /// Minus twice the penalised restricted log-likelihood, but for a constant.
    deviance: f64,
    result: RandomEffects,
}

/// Generalised least squares where the variance between groups is `ratio` times that within. Nothing for a singular X.
fn solve(groups: &[Group], coefficients: usize, ratio: f64) -> Option<Solved> {
    let mut normal = DMatrix::zeros(coefficients, coefficients);
    let mut right = DVector::zeros(coefficients);
    let (mut squares, mut log_determinant, mut count) = (0.0, 0.0, 0.0);
    for group in groups {
        let n = group.len() as f64;
        // The inverse of 1 + ratio 1 1' takes this part of the group's mean away (Sherman and Morrison).
        let part = ratio / (1.0 + n * ratio);
        log_determinant += (1.0 + n * ratio).ln();
        count += n;
        let (mut sum_x, mut sum_y) = (DVector::zeros(coefficients), 0.0);
        for (y, x) in group {
            let x = DVector::from_column_slice(x);
            normal += &x * x.transpose();
            right += &x * *y;
            squares += y * y;
            sum_x += x;
            sum_y += y;
        }
        normal -= part * (&sum_x * sum_x.transpose());
        right -= part * sum_y * sum_x;
        squares -= part * sum_y * sum_y;
    }
    let cholesky = normal.cholesky()?;
    let value = cholesky.solve(&right);
    let freedom = count - coefficients as f64;
    let left = (squares - value.dot(&right)).max(0.0);
    let variance = left / freedom;
    let log_normal = 2.0 * cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let likelihood = freedom * variance.max(f64::MIN_POSITIVE).ln() + log_determinant + log_normal;
    // The penalty is minus the logarithm of the deviation between groups, in those within.
    let deviance = likelihood - 0.5 * ratio.ln();
    let result = RandomEffects {
        covariance: cholesky.inverse() * variance,
        value,
        between: (ratio * variance).sqrt(),
        within: variance.sqrt(),
    };
    Some(Solved { deviance, result })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    fn constant(values: &[&[f64]]) -> Vec<Group> {
        values.iter().map(|group| group.iter().map(|y| (*y, vec![1.0])).collect()).collect()
    }

    /// Of many balanced groups the estimates are those of the analysis of variance (Searle, Casella and McCulloch 1992): the mean
    /// square within, and that between less it, over the groups' size. The penalty is one observation among many.
    #[test]
    fn many_balanced_groups_give_the_estimates_of_the_analysis_of_variance() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(11);
        let mut uniform = || rng.random::<f64>() - 0.5;
        let groups: Vec<Group> = (0..200)
            .map(|_| {
                let own = 3.0 * uniform();
                (0..5).map(|_| (7.0 + own + uniform(), vec![1.0])).collect()
            })
            .collect();
        let found = estimate(&groups).unwrap();
        let mean_of = |group: &Group| group.iter().map(|(y, _)| y).sum::<f64>() / 5.0;
        let mean = groups.iter().map(mean_of).sum::<f64>() / 200.0;
        let squares = |group: &Group| group.iter().map(|(y, _)| (y - mean_of(group)).powi(2)).sum::<f64>();
        let within = groups.iter().map(squares).sum::<f64>() / 800.0;
        let among = groups.iter().map(|group| 5.0 * (mean_of(group) - mean).powi(2)).sum::<f64>() / 199.0;
        assert!((found.value[0] - mean).abs() < 1e-9);
        assert!((found.within.powi(2) / within - 1.0).abs() < 0.02, "{} {within}", found.within);
        let between = (among - within) / 5.0;
        assert!((found.between.powi(2) / between - 1.0).abs() < 0.03, "{} {between}", found.between);
        assert!((found.covariance[(0, 0)] / (among / 5.0 / 200.0) - 1.0).abs() < 0.03);
    }

    /// A handful of groups that happen to agree: an interval for the next one must cover it all the same.
    #[test]
    fn a_new_group_lies_in_its_interval_as_often_as_it_should() {
        for groups in [3_usize, 5, 8] {
            let freedom = groups as f64 - 1.0;
            let deviations = crate::statistics::deviations_of(0.05, freedom);
            let covered = (0..400).filter(|seed| {
                let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(*seed);
                // Twelve uniforms make a near enough normal deviate.
                let mut gauss = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                let mut group = || {
                    let own = gauss();
                    (0..6).map(|_| (own + 0.3 * gauss(), vec![1.0])).collect::<Group>()
                };
                let all: Vec<Group> = (0..groups).map(|_| group()).collect();
                let new = group().iter().map(|(y, _)| y).sum::<f64>() / 6.0;
                let found = estimate(&all).unwrap();
                let variance = found.between.powi(2) + found.within.powi(2) / 6.0 + found.covariance[(0, 0)];
                (new - found.value[0]).abs() < deviations * variance.sqrt()
            });
            let covered = covered.count();
            assert!((368..=398).contains(&covered), "{groups} groups: {covered} of 400");
        }
    }

    #[test]
    fn groups_that_differ_by_no_more_than_noise_have_little_scatter_of_their_own() {
        let groups = constant(&[&[9.0, 11.0, 10.0], &[11.0, 9.5, 9.5], &[10.5, 9.5, 10.0]]);
        let found = estimate(&groups).unwrap();
        assert!(found.between > 0.0 && found.between < found.within, "{found:?}");
    }

    #[test]
    fn a_slope_within_groups_is_not_taken_for_a_difference_between_them() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
        let groups: Vec<Group> = (0..6)
            .map(|g| {
                let own = 3.0 * f64::from(g % 3);
                let point = |x: f64, noise: f64| (own - 2.0 * x + 0.05 * noise, vec![1.0, x]);
                (0..20).map(|k| point(f64::from(k) + f64::from(g), rng.random::<f64>() - 0.5)).collect()
            })
            .collect();
        let found = estimate(&groups).unwrap();
        assert!((found.value[1] + 2.0).abs() < 4.0 * found.covariance[(1, 1)].sqrt() + 1e-3);
        // Of 0, 3, 6, 0, 3, 6 the standard deviation is 2.68; the penalty counts half a group less.
        assert!((found.between - 2.83).abs() < 0.1, "{}", found.between);
        assert!(found.within < 0.03);
    }

    #[test]
    fn a_single_group_and_a_column_of_zeros_say_nothing() {
        assert!(estimate(&constant(&[&[1.0, 2.0, 3.0]])).is_none());
        let zeros: Vec<Group> = (0..3).map(|_| vec![(1.0, vec![1.0, 0.0]); 4]).collect();
        assert!(estimate(&zeros).is_none());
        assert!(estimate(&[]).is_none());
    }
}
