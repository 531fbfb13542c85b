//! Further columns of a flight that formulas of users name, on the grid of its stretches.
//!
//! They are not smoothed, mended or turned: what they mean is known to the formula only. Between values they run straight, as
//! many are logged less often than the flight.

use std::borrow::Cow;

use flights::Flight;
use model::{NO_FURTHER, user_effects};

use crate::prepare::stretch::Stretch;

/// Values further apart than this say nothing of what lies between, s.
const LONGEST_GAP_S: f64 = 2.0;

/// Puts the columns that formulas name onto the samples of the stretches, as far as the flight has them.
pub(super) fn put(stretches: &mut [Stretch], flight: &Flight, t: &[f64]) {
    for (place, name) in user_effects::columns().into_iter().enumerate() {
        let Some(values) = values_of(flight, name, t) else { continue };
        let (times, values): (Vec<f64>, Vec<f64>) =
            t.iter().zip(&*values).filter(|(_, value)| value.is_finite()).unzip();
        for stretch in stretches.iter_mut() {
            stretch.further.resize(stretch.time_s.len(), NO_FURTHER);
            stretch.further_places.push(place);
            for (further, time) in stretch.further.iter_mut().zip(&stretch.time_s) {
                further[place] = straight(&times, &values, *time);
            }
        }
    }
}

/// The values of a column, logged or known by the rows themselves.
fn values_of<'a>(flight: &'a Flight, name: &str, t: &[f64]) -> Option<Cow<'a, [f64]>> {
    if name == user_effects::TIME_COLUMN {
        let began_s = t.first().copied().unwrap_or(0.0);
        return Some(t.iter().map(|t| t - began_s).collect());
    }
    flight.further(name).map(Cow::from)
}

/// The value at a moment; NaN where none is near enough on either side.
fn straight(times: &[f64], values: &[f64], time: f64) -> f64 {
    let after = times.partition_point(|own| *own < time);
    // A grid may begin or end a part of a sample beside the log's rows.
    let near = |k: usize| if (times[k] - time).abs() < LONGEST_GAP_S { values[k] } else { f64::NAN };
    match (after.checked_sub(1), times.get(after)) {
        (_, Some(next)) if *next == time => values[after],
        (Some(before), Some(next)) if next - times[before] <= LONGEST_GAP_S => {
            let part = (time - times[before]) / (next - times[before]);
            values[before] + part * (values[after] - values[before])
        }
        (Some(_), Some(_)) | (None, None) => f64::NAN,
        (None, Some(_)) => near(after),
        (Some(before), None) => near(before),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_that_is_logged_rarely_runs_straight_and_nothing_is_made_up_in_a_long_gap() {
        let (times, values) = ([0.0, 1.0, 4.0], [2.0, 4.0, 5.0]);
        let at = |time| straight(&times, &values, time);
        assert_eq!((at(0.0), at(0.25), at(1.0)), (2.0, 2.5, 4.0));
        assert_eq!((at(-0.1), at(4.1)), (2.0, 5.0));
        assert!(at(2.0).is_nan() && at(9.0).is_nan() && straight(&[], &[], 1.0).is_nan());
    }
}
