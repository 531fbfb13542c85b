//! Flights at low frequency: what a controller's answer to the noise of its gyro has in common with that noise is left out.
//!
//! A controller answers the noise of its gyro with the next command, and the rows of moments are derivatives of the same noise. So above some hertz
//! the moments that are measured and those that are commanded have noise in common, and least squares takes it for physics (Ljung 1999,
//! section 13.4): for rotors that answer 5 ms late, in flights whose gyro has a noise of 0.02 rad/s, and for whatever else leans on that.
//! The noise of a derivative grows with the square of the frequency, and a craft moves at a hertz: rows through a longer window have
//! next to none of it. All rows know more where there is no such noise; where there is, the two differ by more than their errors
//! (Hausman, Econometrica 46(6), 1978).

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::prepare::Prepared;

/// Window of the filter, s. At 0.8 s noise still makes up to 1.7 ms of dead time, at 1.2 s 0.3 ms.
pub const WINDOW_S: f64 = 1.2;
/// p-value under which rows at low frequency contradict all rows. They cost an estimate only some of its sharpness where they do so by chance.
const CONTRADICTION: f64 = 0.05;
/// Fewest windows that rows must span for their errors to be known.
const FEWEST_WINDOWS: f64 = 10.0;

/// The rows of a flight at low frequency; nothing where they span too little to say how well they know anything.
pub fn at_low_frequency(flight: &Prepared) -> Option<Prepared> {
    let rows_span_s = |flight: &Prepared| flight.rows() as f64 * flight.period_s;
    flight.through_window(WINDOW_S).filter(|low| rows_span_s(low) >= FEWEST_WINDOWS * WINDOW_S)
}

/// An estimate from all rows, unless the one from rows at low frequency contradicts it. `differences` gives what the two differ by, each
/// with its variance.
pub(crate) fn unless_contradicted<T>(
    all: Option<T>,
    low: Option<T>,
    differences: impl Fn(&T, &T) -> Vec<(f64, f64)>,
) -> Option<T> {
    match (all, low) {
        (Some(all), Some(low)) if are_different(&differences(&all, &low)) => Some(low),
        (all, _) => all,
    }
}

/// Whether differences, each with its variance, are too large for chance.
fn are_different(differences: &[(f64, f64)]) -> bool {
    let squares: f64 =
        differences.iter().map(|(difference, variance)| difference * difference / variance).sum();
    ChiSquared::new(differences.len() as f64).is_ok_and(|chance| chance.sf(squares) < CONTRADICTION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// Chi squared of one and of two degrees of freedom is 3.84 and 5.99 at a p-value of 0.05 (tables).
    #[test]
    fn low_frequency_is_believed_where_it_contradicts() {
        let of = |low: [f64; 2], count: usize| {
            let pairs = |a: &[f64; 2], b: &[f64; 2]| (0..count).map(|i| (a[i] - b[i], 1.0)).collect();
            unless_contradicted(Some([0.0, 0.0]), Some(low), pairs).unwrap()
        };
        assert_eq!(of([3.83_f64.sqrt(), 0.0], 1), [0.0, 0.0]);
        assert_eq!(of([3.85_f64.sqrt(), 0.0], 1), [3.85_f64.sqrt(), 0.0]);
        assert_eq!(of([3.85_f64.sqrt(), 0.0], 2), [0.0, 0.0]);
        assert_eq!(of([3.0_f64.sqrt(), 3.0_f64.sqrt()], 2), [3.0_f64.sqrt(), 3.0_f64.sqrt()]);
        assert_eq!(of([9.0, 9.0], 0), [0.0, 0.0]);
    }

    #[test]
    fn an_estimate_that_is_missing_contradicts_nothing() {
        let none = |_: &f64, _: &f64| vec![(100.0, 1.0)];
        assert_eq!(unless_contradicted(Some(1.0), None, none), Some(1.0));
        assert_eq!(unless_contradicted(None, Some(1.0), none), None);
    }

    #[test]
    fn a_flight_must_be_long_to_say_something_at_low_frequency() {
        let of = |seconds: f64| {
            let flight = fly(&truth(), 7, seconds, &NONE);
            at_low_frequency(&Prepared::new(&flight, &truth().vehicle).unwrap())
        };
        assert!(of(10.0).is_none());
        assert!(of(20.0).is_some());
    }
}
