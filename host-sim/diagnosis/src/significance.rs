//! Tests of coefficients and gains on flights, whose neighbouring samples are not independent: stretches of time as long as
//! the window of the coefficients' covariance count instead.

use model::Effect;
use nalgebra::{DMatrix, DVector};
use sysid::Fit;
use sysid::fit::least_squares::WINDOW_S;
use sysid::prepare::Prepared;
use sysid::statistics;

/// Values of a shape of a formula that differ so much that they could each have been found by chance: a place or a length over where
/// its quantity goes.
const SHAPES: f64 = 10.0;

/// p-value of the hypothesis that all coefficients of `effect` are zero.
///
/// The shapes of users' formulas mean nothing where the effect is none (Davies, Biometrika 74, 1987, p. 33), and how an amplitude varies
/// with them depends on how the formula is written: at the end of the range, or extrapolated far beyond. So amplitudes are tested at the
/// shapes that were found, and pay for each of these.
pub(crate) fn effect_p_value(fit: &Fit, effect: Effect, train: &[&Prepared]) -> f64 {
    let first: usize =
        fit.model.terms.iter().take_while(|t| t.effect != effect).map(|t| t.coefficients.len()).sum();
    let values: Vec<f64> =
        fit.model.term(effect).map_or_else(Vec::new, |t| t.coefficients.iter().map(|c| c.value).collect());
    let count = values.len();
    let covariance = fit.covariance.view((first, first), (count, count)).into_owned();
    let (coefficients, independent) = (effect.info().coefficients, independent_stretches(train));
    if !matches!(effect, Effect::User(_)) {
        return zero_p_value(&values, &covariance, coefficients, independent);
    }
    let shapes = coefficients.iter().filter(|c| c.prior.is_some()).count();
    let p_value = zero_p_value(&values, &at_shapes(&covariance, coefficients), coefficients, independent);
    (p_value * SHAPES.powi(shapes as i32)).min(1.0)
}

/// A covariance of coefficients where those with a prior are what they are.
fn at_shapes(covariance: &DMatrix<f64>, coefficients: &[model::Coefficient]) -> DMatrix<f64> {
    let held: Vec<usize> =
        coefficients.iter().enumerate().filter(|(_, c)| c.prior.is_some()).map(|(k, _)| k).collect();
    let of_held = DMatrix::from_fn(held.len(), held.len(), |r, c| covariance[(held[r], held[c])]);
    let across = DMatrix::from_fn(held.len(), covariance.ncols(), |r, c| covariance[(held[r], c)]);
    // Where they are not known, nothing is known at them either.
    match of_held.cholesky() {
        Some(factor) => covariance - across.tr_mul(&factor.solve(&across)),
        None => covariance.clone(),
    }
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

/// Sums over blocks of time as long as a stretch, not across gaps.
pub(crate) fn block_sums(flight: &Prepared, values: &[f64]) -> Vec<f64> {
    let length = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
    statistics::block_sums(values, &flight.row_starts(), length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is known of one of two values when the other is known: a variance of 1 - 0.8^2 at a correlation of 0.8. The held one is not
    /// looked at.
    #[test]
    fn amplitudes_are_tested_at_the_shapes_that_were_found() {
        let coefficients = &Effect::GroundEffect.info().coefficients[..2];
        let covariance = DMatrix::from_row_slice(2, 2, &[1.0, 0.8 * 3.0, 0.8 * 3.0, 9.0]);
        let at = at_shapes(&covariance, coefficients);
        assert!((at[(0, 0)] - 0.36).abs() < 1e-12 && at[(1, 1)].abs() < 1e-12, "{at}");
        let values = [2.0930 * 0.6, 7.0];
        assert!((zero_p_value(&values, &at, coefficients, 20.0) - 0.05).abs() < 1e-4);
        let unknown = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]);
        assert_eq!(at_shapes(&unknown, coefficients), unknown);
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
