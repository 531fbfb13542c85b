//! Values of flights that scatter by more than their errors: their mean, and the scatter between flights.
//!
//! A flight's value is the craft's, plus what flights differ by anyway (wind, trim, how the battery sits), plus its own error. The
//! variance between flights is Paule and Mandel's (1982): that under which the weighted squares about the mean are as large as
//! they should be. Of all estimators of that variance it is the one that assumes least (DerSimonian and Kacker 2007).

use crate::fit::Estimate;

/// Values that scatter, as one.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Mean {
    /// Weighted mean.
    pub value: f64,
    /// Its standard error, scatter between flights included.
    pub std_error: f64,
    /// Standard deviation between flights beyond their errors.
    pub between: f64,
    /// Flights behind it.
    pub flights: usize,
}

/// Bisections of the variance between flights: enough for all digits.
const HALVINGS: usize = 60;

/// The mean of groups, each about a mean of its own, with one variance between flights for all: what is common to them.
pub(crate) fn between_variance(groups: &[&[Estimate]]) -> f64 {
    let freedom = groups.iter().map(|group| group.len().saturating_sub(1)).sum::<usize>() as f64;
    if freedom < 1.0 {
        return 0.0;
    }
    let squares = |variance: f64| groups.iter().map(|group| squares_about_mean(group, variance)).sum::<f64>();
    if squares(0.0) <= freedom {
        return 0.0;
    }
    // The squares fall as the variance grows; no value is further from the mean than all are apart.
    let spread = groups.iter().map(|group| plain_squares(group)).sum::<f64>();
    let (mut low, mut high) = (0.0, spread);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if squares(middle) > freedom {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Variance of values that are as good as exact: they are still summed.
const SMALLEST: f64 = 1e-200;

/// Weight of a value under a variance between flights.
pub(crate) fn weight(estimate: &Estimate, variance: f64) -> f64 {
    1.0 / (estimate.std_error * estimate.std_error + variance).max(SMALLEST)
}

/// Weighted mean, and the sum of the weights.
pub(crate) fn weighted(group: &[Estimate], variance: f64) -> (f64, f64) {
    let (sum, all) = group.iter().fold((0.0, 0.0), |(sum, all), estimate| {
        let weight = weight(estimate, variance);
        (sum + weight * estimate.value, all + weight)
    });
    (sum / all, all)
}

fn squares_about_mean(group: &[Estimate], variance: f64) -> f64 {
    if group.is_empty() {
        return 0.0;
    }
    let (mean, _) = weighted(group, variance);
    group.iter().map(|e| weight(e, variance) * (e.value - mean).powi(2)).sum()
}

fn plain_squares(group: &[Estimate]) -> f64 {
    let mean = group.iter().map(|e| e.value).sum::<f64>() / group.len().max(1) as f64;
    group.iter().map(|e| (e.value - mean).powi(2)).sum()
}

/// The mean of some values under a variance between flights.
pub(crate) fn mean_under(group: &[Estimate], variance: f64) -> Option<Mean> {
    if group.is_empty() {
        return None;
    }
    let (value, all) = weighted(group, variance);
    Some(Mean { value, std_error: 1.0 / all.sqrt(), between: variance.sqrt(), flights: group.len() })
}

/// The mean of some values.
pub fn mean(group: &[Estimate]) -> Option<Mean> {
    mean_under(group, between_variance(&[group]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thirteen trials of the BCG vaccine (Colditz et al. 1994), log relative risks and variances as in R's metafor, whose
    /// `rma(yi, vi, method = "PM")` gives tau^2 = 0.318, mean -0.715, standard error 0.181.
    const BCG: [(f64, f64); 13] = [
        (-0.8893, 0.3256),
        (-1.5854, 0.1946),
        (-1.3481, 0.4154),
        (-1.4416, 0.0200),
        (-0.2175, 0.0512),
        (-0.7861, 0.0069),
        (-1.6209, 0.2230),
        (0.0120, 0.0040),
        (-0.4694, 0.0564),
        (-1.3713, 0.0730),
        (-0.3394, 0.0124),
        (0.4459, 0.5325),
        (-0.0173, 0.0714),
    ];

    #[test]
    fn the_variance_between_is_that_of_metafor() {
        let trials = BCG.map(|(value, variance): (f64, f64)| Estimate { value, std_error: variance.sqrt() });
        let found = mean(&trials).unwrap();
        assert!((1000.0 * found.between.powi(2) - 318.0).abs() < 1.0, "{found:?}");
        assert!((found.value + 0.715).abs() < 1e-3 && (found.std_error - 0.181).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn values_that_agree_within_their_errors_scatter_by_nothing() {
        let estimates = [1.0, 1.1, 0.9].map(|value| Estimate { value, std_error: 0.2 });
        let found = mean(&estimates).unwrap();
        assert_eq!(found.between, 0.0);
        assert!((found.value - 1.0).abs() < 1e-12 && (found.std_error - 0.2 / 3.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(mean(&[]), None);
    }

    /// Without errors of their own it is the variance of the values about the means of their groups.
    #[test]
    fn exact_values_have_the_variance_of_the_analysis_of_variance() {
        let exact = |values: &[f64]| {
            values.iter().map(|&value| Estimate { value, std_error: 0.0 }).collect::<Vec<_>>()
        };
        let (a, b) = (exact(&[1.0, 2.0, 3.0]), exact(&[11.0, 13.0]));
        assert!((between_variance(&[&a, &b]) - 4.0 / 3.0).abs() < 1e-9);
    }
}
