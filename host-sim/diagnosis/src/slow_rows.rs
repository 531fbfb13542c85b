//! Is an effect there in slow motion as well?
//!
//! A controller answers the noise of its gyro with the next command, and the rows of moments are derivatives of the same noise. So above some hertz
//! the moments that are measured and those that are commanded have noise in common, and least squares takes it for physics (Ljung 1999,
//! section 13.4): for rotors that answer 5 ms late, in flights whose gyro has a noise of 0.02 rad/s, and for whatever else leans on that.
//! The noise of a derivative grows with the square of the frequency, and a craft moves at a hertz: rows through a longer window have
//! next to none of it. What is physics has the same coefficients in both (Hausman, Econometrica 46(6), 1978).

use model::Effect;
use nalgebra::{DMatrix, DVector};
use sysid::Fit;
use sysid::prepare::Prepared;

use crate::finding::InSlowRows;
use crate::significance::{independent_stretches, zero_p_value};

/// Window of the filter, s. At 0.8 s noise still makes up to 1.7 ms of dead time, at 1.2 s 0.3 ms.
const WINDOW_S: f64 = 1.2;

/// What slow rows of the training flights say of an effect that a fit to all rows has; nothing where they do not determine the model.
pub(crate) fn in_slow_rows(fit: &Fit, effect: Effect, train: &[&Prepared]) -> Option<InSlowRows> {
    let slow: Vec<Prepared> = train.iter().filter_map(|flight| flight.through_window(WINDOW_S)).collect();
    let slow: Vec<&Prepared> = slow.iter().collect();
    let again = sysid::fit(&slow, &fit.model.vehicle, &fit.model.effects(), Some(&fit.model)).ok()?;
    let [(quick, errors), (slowly, slow_errors)] = [fit, &again].map(|fit| estimates(fit, effect));
    let differences: Vec<f64> = quick.iter().zip(&slowly).map(|(a, b)| a - b).collect();
    let covariance = errors + slow_errors;
    let coefficients = effect.info().coefficients;
    Some(InSlowRows {
        part: part(&quick, &slowly, &covariance)?,
        same_p_value: zero_p_value(&differences, &covariance, coefficients, independent_stretches(&slow)),
    })
}

/// How much of the coefficients of all rows there is in those of the slow ones: 1 where they are the same.
fn part(quick: &[f64], slowly: &[f64], covariance: &DMatrix<f64>) -> Option<f64> {
    let [quick, slowly] = [quick, slowly].map(DVector::from_column_slice);
    let weighed = covariance.clone().cholesky()?.solve(&quick);
    Some(weighed.dot(&slowly) / weighed.dot(&quick))
}

/// The coefficients of an effect, and their covariance.
fn estimates(fit: &Fit, effect: Effect) -> (Vec<f64>, DMatrix<f64>) {
    let before = fit.model.terms.iter().take_while(|term| term.effect != effect);
    let first: usize = before.map(|term| term.coefficients.len()).sum();
    let values = fit.model.term(effect).map_or_else(Vec::new, model::Term::values);
    let count = values.len();
    (values, fit.covariance.view((first, first), (count, count)).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The parts of two coefficients count by what is known of each: 0.2 of the one and all of the other, which is four times as well known.
    #[test]
    fn a_part_is_that_of_the_coefficients_that_are_known_best() {
        let covariance = DMatrix::from_diagonal(&DVector::from_column_slice(&[4.0, 1.0]));
        let of = |quick: &[f64], slowly: &[f64]| part(quick, slowly, &covariance).unwrap();
        assert!((of(&[3.0, 0.0], &[3.0, 0.0]) - 1.0).abs() < 1e-12);
        assert!((of(&[3.0, -2.0], &[0.0, 0.0])).abs() < 1e-12);
        assert!((of(&[1.0, 1.0], &[0.2, 1.0]) - (0.25 * 0.2 + 1.0) / 1.25).abs() < 1e-12);
        assert!(part(&[1.0, 1.0], &[1.0, 1.0], &DMatrix::zeros(2, 2)).is_none());
    }
}
