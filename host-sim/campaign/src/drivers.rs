//! What drives the loss of a craft: of each number that was drawn, how much of the spread of the outcome it explains, where it is worst,
//! and by what the odds change with it.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::statistics::{Interval, exact_interval};

/// Groups of equal size that the draws are sorted into by a number.
const GROUPS: usize = 5;
/// Iterations of the logistic fit.
const ROUNDS: usize = 50;
/// A coefficient of the logistic fit for one standard deviation of its number, or its error, beyond which a number all but tells lost from
/// kept draws: odds mean nothing then.
const APART: [f64; 2] = [4.0, 1.0];
/// Losses that a logistic fit takes for each of its coefficients (Peduzzi and others, J. Clinical Epidemiology 49, 1996).
const LOSSES_OF_A_COEFFICIENT: usize = 10;

/// What one number does to the outcome.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Driver {
    /// Its name; the name ends with the unit.
    pub input: String,
    /// Share of the variance of the outcome between groups of draws by this number, percent: the first-order sensitivity index, less
    /// what chance adds.
    pub variance_percent: f64,
    /// Chance that so much comes of a number without influence, times the count of numbers (Bonferroni).
    pub p_value: f64,
    /// Range of the group with the most losses.
    pub worst_range: [f64; 2],
    /// Share of the draws lost in it, percent.
    pub worst_percent: f64,
    /// Exact 95 % interval of that share, percent.
    pub worst_interval_percent: [f64; 2],
    /// All groups, by the number.
    pub groups: Vec<Group>,
    /// By what the odds of a loss are multiplied for each standard deviation more, with all other numbers as they are (logistic fit);
    /// absent where there are too few losses, or where some number all but tells lost from kept draws.
    pub odds_ratio: Option<f64>,
    /// Its 95 % interval.
    pub odds_interval: Option<[f64; 2]>,
}

/// Draws in which a number is about the same.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Group {
    /// Its least and its most there.
    pub range: [f64; 2],
    /// Share of the draws lost, percent.
    pub lost_percent: f64,
    /// Exact 95 % interval of that share, percent.
    pub interval_percent: [f64; 2],
}

impl Group {
    fn of(places: &[usize], values: &[f64], lost: &[bool]) -> Self {
        let hits = places.iter().filter(|place| lost[**place]).count();
        let Interval { low, high } = exact_interval(hits as u64, places.len() as u64);
        let end = |pick: fn(f64, f64) -> f64| {
            places.iter().map(|place| values[*place]).reduce(pick).unwrap_or(f64::NAN)
        };
        Self {
            range: [end(f64::min), end(f64::max)],
            lost_percent: 100.0 * hits as f64 / places.len().max(1) as f64,
            interval_percent: [100.0 * low, 100.0 * high],
        }
    }
}

/// The drivers of a loss, the strongest first.
pub(crate) fn drivers(inputs: &[(&str, Vec<f64>)], lost: &[bool]) -> Vec<Driver> {
    let count = lost.iter().filter(|lost| **lost).count();
    if count == 0 || count == lost.len() {
        return Vec::new();
    }
    let varied: Vec<&(&str, Vec<f64>)> = inputs.iter().filter(|(_, values)| spread(values) > 0.0).collect();
    let odds = logistic(&varied.iter().map(|(_, values)| standard(values)).collect::<Vec<_>>(), lost);
    let tests = varied.len() as f64;
    let mut found: Vec<Driver> = varied
        .iter()
        .enumerate()
        .map(|(k, (name, values))| {
            let odds = odds.as_ref().map(|odds| odds[k]);
            let mut driver = of_one(name, values, lost);
            driver.p_value = (driver.p_value * tests).min(1.0);
            driver.odds_ratio = odds.map(|(value, _)| value.exp());
            driver.odds_interval =
                odds.map(|(value, error)| [-1.96, 1.96].map(|times| (value + times * error).exp()));
            driver
        })
        .collect();
    found.sort_by(|one, other| other.variance_percent.total_cmp(&one.variance_percent));
    found
}

/// The groups of draws by one number: places of the draws.
fn groups(values: &[f64]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut distinct: Vec<f64> = order.iter().map(|place| values[*place]).collect();
    distinct.dedup();
    if distinct.len() <= GROUPS {
        let with = |value: &f64| order.iter().copied().filter(|place| values[*place] == *value).collect();
        return distinct.iter().map(with).collect();
    }
    let start = |k: usize| k * order.len() / GROUPS;
    (0..GROUPS).map(|k| order[start(k)..start(k + 1)].to_vec()).filter(|group| !group.is_empty()).collect()
}

fn of_one(name: &str, values: &[f64], lost: &[bool]) -> Driver {
    let groups = groups(values);
    let all = lost.len() as f64;
    let mean = lost.iter().filter(|lost| **lost).count() as f64 / all;
    let hits = |group: &[usize]| group.iter().filter(|place| lost[**place]).count() as f64;
    // Of outcomes 0 and 1: chi-squared is the sum of squares between groups over the variance, and its mean by chance is one less than
    // the groups.
    let chi_squared: f64 = groups
        .iter()
        .map(|group| group.len() as f64 * (hits(group) / group.len() as f64 - mean).powi(2))
        .sum::<f64>()
        / (mean * (1.0 - mean));
    let freedom = groups.len() as f64 - 1.0;
    let p_value = ChiSquared::new(freedom).map_or(1.0, |chi| chi.sf(chi_squared));
    let groups: Vec<Group> = groups.iter().map(|group| Group::of(group, values, lost)).collect();
    let worst = groups.iter().max_by(|one, other| one.lost_percent.total_cmp(&other.lost_percent));
    let worst = worst.cloned().unwrap_or_else(|| Group::of(&[], values, lost));
    Driver {
        input: name.to_owned(),
        variance_percent: 100.0 * ((chi_squared - freedom) / all).max(0.0),
        p_value,
        worst_range: worst.range,
        worst_percent: worst.lost_percent,
        worst_interval_percent: worst.interval_percent,
        groups,
        odds_ratio: None,
        odds_interval: None,
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn spread(values: &[f64]) -> f64 {
    let middle = mean(values);
    mean(&values.iter().map(|value| (value - middle).powi(2)).collect::<Vec<_>>()).sqrt()
}

/// In standard deviations from its mean.
fn standard(values: &[f64]) -> Vec<f64> {
    let (middle, one) = (mean(values), spread(values));
    values.iter().map(|value| (value - middle) / one).collect()
}

/// A logistic regression by Newton's method: each coefficient with its standard error. Nothing where there are too few of either
/// outcome, or where a number tells them apart altogether.
fn logistic(columns: &[Vec<f64>], lost: &[bool]) -> Option<Vec<(f64, f64)>> {
    let (rows, width) = (lost.len(), columns.len() + 1);
    let losses = lost.iter().filter(|lost| **lost).count();
    if losses.min(rows - losses) < LOSSES_OF_A_COEFFICIENT * width {
        return None;
    }
    let x = DMatrix::from_fn(rows, width, |row, k| if k == 0 { 1.0 } else { columns[k - 1][row] });
    let y = DVector::from_fn(rows, |row, _| f64::from(u8::from(lost[row])));
    let mut beta = DVector::zeros(width);
    for _ in 0..ROUNDS {
        let p = (&x * &beta).map(|eta: f64| 1.0 / (1.0 + (-eta).exp()));
        let mut weighted = x.clone();
        for (row, p) in p.iter().enumerate() {
            weighted.row_mut(row).scale_mut(p * (1.0 - p));
        }
        let information = x.tr_mul(&weighted).cholesky()?;
        let step = information.solve(&x.tr_mul(&(&y - &p)));
        beta += &step;
        if step.amax() < 1e-10 {
            let covariance = information.inverse();
            let found: Vec<(f64, f64)> = (1..width).map(|k| (beta[k], covariance[(k, k)].sqrt())).collect();
            let [most, most_error] = APART;
            let is_apart = |(value, error): &(f64, f64)| value.abs() > most || *error > most_error;
            return (!found.iter().any(is_apart)).then_some(found);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two numbers and an outcome without any random generator.
    fn sample() -> (Vec<f64>, Vec<f64>, Vec<bool>) {
        let fraction = |k: u32, by: f64| (f64::from(k) * by).fract();
        let a: Vec<f64> = (0..600).map(|k| fraction(k, 0.618_033_988_749_895)).collect();
        let b: Vec<f64> = (0..600).map(|k| fraction(k, 0.414_213_562_373_095)).collect();
        let lost = (0..600)
            .map(|k| fraction(k, 0.732_050_807_568_877) < 1.0 / (1.0 + (3.0 - 4.0 * a[k as usize]).exp()))
            .collect();
        (a, b, lost)
    }

    /// statsmodels 0.15.0: Logit on the standardised columns.
    #[test]
    fn the_logistic_fit_is_that_of_statsmodels() {
        let (a, b, lost) = sample();
        let found = logistic(&[standard(&a), standard(&b)], &lost).unwrap();
        let expected = STATSMODELS;
        for ((value, error), (expected, expected_error)) in found.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-6 && (error - expected_error).abs() < 1e-6, "{found:?}");
        }
    }

    const STATSMODELS: [(f64, f64); 2] = [
        (1.117_794_985_384_132, 0.112_573_715_491_907_73),
        (0.014_496_804_612_452_762, 0.098_370_950_005_732_18),
    ];

    #[test]
    fn the_number_that_matters_comes_first_with_its_worst_range() {
        let (a, b, lost) = sample();
        let found = drivers(&[("b", b), ("a", a)], &lost);
        assert_eq!(found[0].input, "a");
        assert!(found[0].p_value < 1e-6 && found[1].p_value > 0.01, "{found:?}");
        assert!(found[0].worst_range[0] > 0.75 && found[0].worst_percent > 50.0, "{found:?}");
        assert!(found[0].odds_ratio.unwrap() > 2.0 && found[1].variance_percent < 2.0, "{found:?}");
    }

    #[test]
    fn a_number_that_tells_them_apart_has_no_odds() {
        let (a, b, _) = sample();
        let lost: Vec<bool> = a.iter().map(|a| *a > 0.5).collect();
        let found = drivers(&[("a", a), ("b", b)], &lost);
        assert!(found[0].input == "a" && found[0].odds_ratio.is_none(), "{found:?}");
    }

    #[test]
    fn what_is_always_or_never_lost_has_no_drivers_and_few_losses_no_odds() {
        let (a, _, mut lost) = sample();
        assert!(drivers(&[("a", a.clone())], &[true; 600]).is_empty());
        lost.iter_mut().skip(40).for_each(|lost| *lost = false);
        assert!(drivers(&[("a", a)], &lost)[0].odds_ratio.is_none());
    }
}
