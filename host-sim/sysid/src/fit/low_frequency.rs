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
    together_at_low_frequency(&[flight])?.pop()
}

/// The rows of flights at low frequency, for what is fitted to all of them; nothing where together they span too little. Flights that are
/// shorter than the window are left out.
pub fn together_at_low_frequency(flights: &[&Prepared]) -> Option<Vec<Prepared>> {
    let low: Vec<Prepared> = flights.iter().filter_map(|flight| flight.through_window(WINDOW_S)).collect();
    let span_s: f64 = low.iter().map(|flight| flight.rows() as f64 * flight.period_s).sum();
    (span_s >= FEWEST_WINDOWS * WINDOW_S).then_some(low)
}

/// A number that was estimated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) variance: f64,
}

/// What all rows say, unless rows at low frequency contradict it. `estimates` are the numbers of which it consists, each in its place; one that
/// either lacks says nothing.
pub(crate) fn unless_contradicted<T>(
    all: Option<T>,
    low: Option<T>,
    estimates: impl Fn(&T) -> Vec<Option<Estimate>>,
) -> Option<T> {
    match (all, low) {
        (Some(all), Some(low)) if are_different(&estimates(&all), &estimates(&low)) => Some(low),
        (all, _) => all,
    }
}

/// Whether the differences between independent estimates of the same numbers are too large for chance.
fn are_different(all: &[Option<Estimate>], low: &[Option<Estimate>]) -> bool {
    let in_both = all.iter().zip(low).filter_map(|(all, low)| all.zip(*low));
    let squares: Vec<f64> =
        in_both.map(|(all, low)| (all.value - low.value).powi(2) / (all.variance + low.variance)).collect();
    ChiSquared::new(squares.len() as f64).is_ok_and(|chance| chance.sf(squares.iter().sum()) < CONTRADICTION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// Numbers of variance 1/2: their differences have 1.
    fn estimates(values: &[Option<f64>]) -> Vec<Option<Estimate>> {
        values.iter().map(|value| value.map(|value| Estimate { value, variance: 0.5 })).collect()
    }

    fn chosen(all: &[Option<f64>], low: &[Option<f64>]) -> Vec<Option<f64>> {
        unless_contradicted(Some(all.to_vec()), Some(low.to_vec()), |of| estimates(of)).unwrap()
    }

    /// Chi squared of one and of two degrees of freedom is 3.84 and 5.99 at a p-value of 0.05 (tables).
    #[test]
    fn low_frequency_is_believed_where_it_contradicts() {
        let believed = |low: &[f64]| {
            let low: Vec<Option<f64>> = low.iter().map(|squared| Some(squared.sqrt())).collect();
            chosen(&vec![Some(0.0); low.len()], &low) == low
        };
        assert!(!believed(&[3.83]) && believed(&[3.85]));
        assert!(!believed(&[3.85, 0.0]) && !believed(&[2.9, 3.0]) && believed(&[3.0, 3.0]));
        assert_eq!(chosen(&[], &[]), []);
    }

    /// 9 and 0 differ by much, but they are not the same number.
    #[test]
    fn numbers_are_compared_in_their_places() {
        let all = [Some(0.0), None, Some(9.0)];
        assert_eq!(chosen(&all, &[Some(0.0), Some(9.0), None]), all);
        assert_eq!(chosen(&all, &[None, Some(0.0), Some(9.0)]), all);
        assert_eq!(chosen(&all, &[None, None, Some(0.0)]), [None, None, Some(0.0)]);
    }

    #[test]
    fn an_estimate_that_is_missing_contradicts_nothing() {
        let of = |value: &f64| estimates(&[Some(*value)]);
        assert_eq!(unless_contradicted(Some(1.0), None, of), Some(1.0));
        assert_eq!(unless_contradicted(None, Some(1.0), of), None);
    }

    #[test]
    fn flights_must_be_long_to_say_something_at_low_frequency() {
        let of = |seconds: f64| Prepared::new(&fly(&truth(), 7, seconds, &NONE), &truth().vehicle).unwrap();
        let (tiny, short, long) = (of(1.0), of(10.0), of(20.0));
        assert!(at_low_frequency(&short).is_none() && at_low_frequency(&long).is_some());
        assert!(together_at_low_frequency(&[&short, &tiny]).is_none());
        assert_eq!(together_at_low_frequency(&[&short, &tiny, &short]).map(|low| low.len()), Some(2));
    }
}
