//! Is an effect there at low frequency as well?
//!
//! Above some hertz a controller's answer to the noise of its gyro passes for physics ([`sysid::fit::low_frequency`]). What is physics has the
//! same coefficients at low frequency.

use model::Effect;
use nalgebra::{DMatrix, DVector};
use sysid::Fit;
use sysid::fit::low_frequency::together_at_low_frequency;
use sysid::prepare::Prepared;

use crate::finding::AtLowFrequency;
use crate::significance::{estimates, independent_stretches, zero_p_value};

/// What rows at low frequency of the training flights say of an effect that a fit to all rows has; nothing where they span too little or do
/// not determine the model.
pub(crate) fn found_at_low_frequency(
    fit: &Fit,
    effect: Effect,
    train: &[&Prepared],
) -> Option<AtLowFrequency> {
    let low = together_at_low_frequency(train)?;
    let low: Vec<&Prepared> = low.iter().collect();
    let mut effects = fit.model.effects();
    effects.retain(|other| *other == effect || !is_like_at_low_frequency(*other, effect));
    let again = sysid::fit(&low, &fit.model.vehicle, &effects, Some(&fit.model)).ok()?;
    let [(all, errors), (lows, low_errors)] = [fit, &again].map(|fit| estimates(fit, effect));
    let differences: Vec<f64> = all.iter().zip(&lows).map(|(a, b)| a - b).collect();
    let covariance = errors + low_errors;
    let coefficients = effect.info().coefficients;
    Some(AtLowFrequency {
        part: part(&all, &lows, &covariance)?,
        same_p_value: zero_p_value(&differences, &covariance, coefficients, independent_stretches(&low)),
    })
}

/// A dead time and a longer lag are the same to slow motion. Were both fitted there, neither would be known, and a dead time that a shorter lag makes up
/// for, as gyro noise fakes both, would pass.
fn is_like_at_low_frequency(one: Effect, other: Effect) -> bool {
    [one, other].iter().all(|effect| matches!(effect, Effect::InputDelay | Effect::MotorLag))
}

/// How much of the coefficients of all rows there is in those at low frequency: 1 where they are the same.
fn part(all: &[f64], low: &[f64], covariance: &DMatrix<f64>) -> Option<f64> {
    let [all, low] = [all, low].map(DVector::from_column_slice);
    let weighed = covariance.clone().cholesky()?.solve(&all);
    Some(weighed.dot(&low) / weighed.dot(&all))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_time_is_like_a_lag_and_like_nothing_else() {
        assert!(is_like_at_low_frequency(Effect::MotorLag, Effect::InputDelay));
        assert!(is_like_at_low_frequency(Effect::InputDelay, Effect::MotorLag));
        assert!(!is_like_at_low_frequency(Effect::InputDelay, Effect::ThrustLinear));
        assert!(!is_like_at_low_frequency(Effect::RotorMoments, Effect::MotorLag));
    }

    /// The parts of two coefficients count by what is known of each: 0.2 of the one and all of the other, which is four times as well known.
    #[test]
    fn a_part_is_that_of_the_coefficients_that_are_known_best() {
        let covariance = DMatrix::from_diagonal(&DVector::from_column_slice(&[4.0, 1.0]));
        let of = |all: &[f64], low: &[f64]| part(all, low, &covariance).unwrap();
        assert!((of(&[3.0, 0.0], &[3.0, 0.0]) - 1.0).abs() < 1e-12);
        assert!((of(&[3.0, -2.0], &[0.0, 0.0])).abs() < 1e-12);
        assert!((of(&[1.0, 1.0], &[0.2, 1.0]) - (0.25 * 0.2 + 1.0) / 1.25).abs() < 1e-12);
        assert!(part(&[1.0, 1.0], &[1.0, 1.0], &DMatrix::zeros(2, 2)).is_none());
    }
}
