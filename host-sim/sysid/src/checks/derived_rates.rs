//! Rates that were derived from the attitude and smoothed.
//!
//! A gyro has noise of its own. Rates that a logger made of the attitude have the attitude's noise: a filter of its derivative gives them
//! back, quick changes and all. Where that filter smooths, the moments of a fit are those of a smoothed motion. They answer to commands
//! before these are given, and what turns the craft quickly is missing in them.
//!
//! An estimator's attitude may be made of the gyro, so that its derivative is the gyro. That filter takes nothing away.

use std::f64::consts::PI;

use flights::{Column, Flight, StandIn, median_step};
use nalgebra::{DMatrix, DVector};

/// Rows on either side that a rate may be smoothed over: 0.1 s at 100 Hz.
const REACH: usize = 10;
/// Rows that are looked at, evenly spread over a flight, and at least.
const MOST_ROWS: usize = 1000;
const LEAST_ROWS: usize = 200;
/// Part of the squares of second differences that a filter gives back of rates that were made by one. They are what is quick: of a gyro
/// beside a tracker it is noise that neither shares with the other.
const GIVEN_BACK: f64 = 0.98;
/// Frequencies that are smoothed away, in cycles per row, ...
const QUICK: [f64; 2] = [0.125, 0.25];
/// ... of whose power no more than this part is left.
const LEFT: f64 = 0.5;
/// Part of the largest normal equation that is added to all: of a motion without noise, neighbouring rows are nearly alike.
const RIDGE: f64 = 1e-9;
/// Part by which the times of rows side by side may be uneven.
const EVEN: f64 = 0.1;

const RATES: [Column; 3] = [Column::P, Column::Q, Column::R];

/// What to say where the rates were derived from the attitude and smoothed.
pub fn check(flight: &Flight) -> Option<String> {
    if flight.stand_ins().iter().any(|what| [StandIn::RatesOfAttitude, StandIn::AnglesOfGyro].contains(what))
    {
        return None;
    }
    let rows = even_rows(flight.required(Column::T));
    let slopes = flight.rates_of_attitude();
    let smooths = |(column, slope): (&Column, &Vec<f64>)| {
        let filter = filter_between(slope, flight.required(*column), &rows)?;
        (power_left(&filter) < LEFT).then_some(())
    };
    RATES.iter().zip(&slopes).map(smooths).collect::<Option<Vec<()>>>()?;
    Some(
        "p, q, r appear to be smoothed derivatives of phi, theta, psi, not gyro rates: fast rotation is filtered out, so roll, pitch and \
         yaw may remain unexplained; log gyro rates"
            .into(),
    )
}

/// Some rows amid others at even times.
fn even_rows(t: &[f64]) -> Vec<usize> {
    let step_s = median_step(t);
    let side = REACH + 1;
    let is_even = |k: &usize| {
        let lasts_s = t[k + side] - t[k - side];
        (lasts_s / (2.0 * side as f64 * step_s) - 1.0).abs() < EVEN
    };
    let rows: Vec<usize> = (side..t.len().saturating_sub(side)).filter(is_even).collect();
    let stride = rows.len().div_ceil(MOST_ROWS).max(1);
    rows.into_iter().step_by(stride).collect()
}

/// The filter of one signal that gives another back, from the rows before to those behind; nothing where none does.
fn filter_between(from: &[f64], to: &[f64], rows: &[usize]) -> Option<Vec<f64>> {
    const TAPS: usize = 2 * REACH + 1;
    let bend = |of: &[f64], k: usize| of[k - 1] - 2.0 * of[k] + of[k + 1];
    let (mut normal, mut right) = (DMatrix::<f64>::zeros(TAPS, TAPS), DVector::<f64>::zeros(TAPS));
    let (mut squares, mut count) = (0.0, 0);
    for &row in rows {
        let taps = DVector::from_fn(TAPS, |tap, _| bend(from, row + tap - REACH));
        let value = bend(to, row);
        if !(value.is_finite() && taps.iter().all(|tap| tap.is_finite())) {
            continue;
        }
        normal.syger(1.0, &taps, &taps, 1.0);
        right.axpy(value, &taps, 1.0);
        squares += value * value;
        count += 1;
    }
    if count < LEAST_ROWS || squares == 0.0 {
        return None;
    }
    let ridge = RIDGE * normal.diagonal().amax();
    (0..TAPS).for_each(|k| normal[(k, k)] += ridge);
    let filter = normal.cholesky()?.solve(&right);
    (right.dot(&filter) > GIVEN_BACK * squares).then(|| filter.as_slice().to_vec())
}

/// Part of the power of the true rates at quick frequencies that is left in those that a filter makes of central differences.
fn power_left(filter: &[f64]) -> f64 {
    const FREQUENCIES: usize = 16;
    let [slow, quick] = QUICK;
    let at = |k: usize| {
        let turn = 2.0 * PI * (slow + (quick - slow) * k as f64 / (FREQUENCIES - 1) as f64);
        let part = |of: fn(f64) -> f64| -> f64 {
            filter.iter().enumerate().map(|(tap, value)| value * of(turn * (tap as f64 - REACH as f64))).sum()
        };
        let of_differences = turn.sin() / turn;
        (part(f64::cos).powi(2) + part(f64::sin).powi(2)) * of_differences * of_differences
    };
    (0..FREQUENCIES).map(at).sum::<f64>() / FREQUENCIES as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, ORDINARY, fly, truth};

    /// The flight with rates that are the mean of so many central differences on either side.
    fn smoothed(flight: &Flight, side: usize) -> Flight {
        let mut derived = flight.clone();
        for (column, slope) in RATES.into_iter().zip(flight.rates_of_attitude()) {
            let mean = |k: usize| {
                let near = &slope[k.saturating_sub(side)..(k + side + 1).min(slope.len())];
                near.iter().sum::<f64>() / near.len() as f64
            };
            derived.replace(column, (0..slope.len()).map(mean).collect());
        }
        derived
    }

    #[test]
    fn smoothed_derivatives_are_told_and_neither_a_gyro_nor_what_takes_nothing_away() {
        for noise in [NONE, ORDINARY] {
            let flight = fly(&truth(), 7, 12.0, &noise);
            assert_eq!(check(&flight), None, "a gyro");
            assert_eq!(check(&smoothed(&flight, 0)), None, "an attitude that was made of the gyro");
            for side in [2, 4] {
                let told = check(&smoothed(&flight, side));
                assert!(told.is_some_and(|sentence| sentence.contains("log gyro rates")), "{side}");
            }
        }
    }

    #[test]
    fn rates_that_stand_in_and_flights_of_a_second_are_not_judged() {
        let short = smoothed(&fly(&truth(), 7, 1.5, &NONE), 2);
        assert_eq!(check(&short), None);
    }

    /// A mean over five rows at a quarter of a cycle per row: (1 + 2 cos 90 + 2 cos 180) / 5 = -0.2.
    #[test]
    fn power_is_that_of_the_filter_and_of_central_differences() {
        let mut mean = vec![0.0; 2 * REACH + 1];
        mean[REACH - 2..=REACH + 2].fill(0.2);
        let quarter = (0.2 * 2.0 / PI).powi(2);
        let eighth = ((1.0 + 2.0 * 0.5_f64.sqrt()) / 5.0 * (PI / 4.0).sin() / (PI / 4.0)).powi(2);
        let power = power_left(&mean);
        assert!(power > quarter && power < eighth, "{power}");
        let mut nothing = vec![0.0; 2 * REACH + 1];
        nothing[REACH] = 1.0;
        assert!(power_left(&nothing) > LEFT);
    }
}
