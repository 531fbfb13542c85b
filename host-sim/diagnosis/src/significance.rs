//! Tests of coefficients and gains on flights, whose neighbouring samples are not independent: stretches of time as long as
//! the window of the coefficients' covariance count instead.

use std::ops::Range;

use model::{Axis, Effect};
use nalgebra::{DMatrix, DVector};
use sysid::fit::least_squares::WINDOW_S;
use sysid::prepare::Prepared;
use sysid::statistics::{self, Blocks};
use sysid::{Fit, Residuals};

/// p-value of the hypothesis that all coefficients of `effect` are zero.
pub(crate) fn effect_p_value(fit: &Fit, effect: Effect, train: &[&Prepared]) -> f64 {
    let (values, covariance) = estimates(fit, effect);
    zero_p_value(&values, &covariance, effect.info().coefficients, independent_stretches(train))
}

/// The coefficients of an effect, and their covariance.
pub(crate) fn estimates(fit: &Fit, effect: Effect) -> (Vec<f64>, DMatrix<f64>) {
    let before = fit.model.terms.iter().take_while(|term| term.effect != effect);
    let first: usize = before.map(|term| term.coefficients.len()).sum();
    let values = fit.model.term(effect).map_or_else(Vec::new, model::Term::values);
    let count = values.len();
    (values, fit.covariance.view((first, first), (count, count)).into_owned())
}

/// p-value of the hypothesis that all `coefficients` are zero: Wald's statistic against the F distribution.
///
/// Coefficients with a prior only qualify the others (an offset, a shift): zero is no hypothesis about them. `independent` is what
/// the covariance is known from: stretches of time, see [`independent_stretches`], or fewer.
pub(crate) fn zero_p_value<'a>(
    values: &[f64],
    covariance: &DMatrix<f64>,
    coefficients: impl IntoIterator<Item = &'a model::Coefficient>,
    independent: f64,
) -> f64 {
    let is_tested = |(i, c): (usize, &model::Coefficient)| c.prior.is_none().then_some(i);
    let tested: Vec<usize> = coefficients.into_iter().enumerate().filter_map(is_tested).collect();
    let k = tested.len();
    let theta = DVector::from_iterator(k, tested.iter().map(|&i| values[i]));
    let covariance = DMatrix::from_fn(k, k, |r, c| covariance[(tested[r], tested[c])]);
    statistics::wald_p_value(&theta, covariance, independent)
}

/// How many independent stretches of time flights have.
pub(crate) fn independent_stretches(flights: &[&Prepared]) -> f64 {
    flights.iter().map(|f| f.rows() as f64 * f.period_s).sum::<f64>() / WINDOW_S
}

/// Adds to `blocks` by how much the squared residuals of a flight fall from `before` to `after`, over axes with their weights, and
/// by how much they would by chance. Gives the whole fall.
pub(crate) fn take_fall(
    blocks: &mut Blocks,
    flight: &Prepared,
    weights: impl IntoIterator<Item = (Axis, f64)>,
    (before, after): (&Residuals, &Residuals),
) -> f64 {
    let mut fall = vec![0.0; flight.rows()];
    let mut chance = fall.clone();
    for (axis, weight) in weights {
        let pairs = before.residual[axis.index()].iter().zip(&after.residual[axis.index()]);
        for ((f, c), (x, y)) in fall.iter_mut().zip(&mut chance).zip(pairs) {
            *f += weight * (x * x - y * y);
            *c += weight * 2.0 * y * (x - y);
        }
    }
    blocks.gain.extend(block_sums(flight, &fall));
    blocks.chance.extend(block_sums(flight, &chance));
    fall.iter().sum()
}

/// Sums over blocks of time as long as a stretch, not across gaps.
pub(crate) fn block_sums(flight: &Prepared, values: &[f64]) -> Vec<f64> {
    let length = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
    statistics::block_sums(values, &flight.row_starts(), length)
}

/// The rows of each stretch of a flight.
pub(crate) fn rows_of_stretches(flight: &Prepared) -> Vec<Range<usize>> {
    let starts = flight.row_starts();
    let ends = starts.iter().skip(1).copied().chain([flight.rows()]);
    starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// Two stretches of a flight that is held against itself: the rows of the one end where those of the other begin.
    #[test]
    fn rows_of_stretches_follow_each_other() {
        let mut flight = prepared(&truth(), 30..31, 6.0, &ORDINARY).remove(0);
        let rows = flight.rows();
        assert_eq!(rows_of_stretches(&flight), std::slice::from_ref(&(0..rows)));
        flight.stretches.push(flight.stretches[0].part(0..150));
        let second = 150 - 2 * flight.margin;
        assert_eq!(rows_of_stretches(&flight), [0..rows, rows..rows + second]);
    }

    /// A ground effect's height offset only qualifies its strength: a large offset is no evidence, and it takes no degree of
    /// freedom. F(1, n - 1) is Student's t squared: 2.0930 is the 2.5 % point at 19 degrees of freedom.
    #[test]
    fn coefficients_that_qualify_others_are_not_tested() {
        let coefficients = Effect::GroundEffect.info().coefficients;
        assert!(coefficients[0].prior.is_none() && coefficients[1..].iter().all(|c| c.prior.is_some()));
        let count = coefficients.len();
        let mut values = vec![1e3; count];
        values[0] = 2.0930;
        let p = zero_p_value(&values, &DMatrix::identity(count, count), coefficients, 20.0);
        assert!((p - 0.05).abs() < 1e-4, "{p}");
    }
}
