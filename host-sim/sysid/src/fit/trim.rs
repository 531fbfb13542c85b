//! What a flight has of its own: constants of the force and moment rows that change from run to run.
//!
//! An accelerometer's bias, an attitude estimate that settled a little off level, a battery strapped in a centimetre to the
//! side: in logs of one craft each flight has another constant in its rows. Left in, the constants of the flights with the
//! most rows pull at the common coefficients.
//!
//! Estimated on training flights, together with all linear coefficients, as **deviations from the flights' mean**: what is
//! common to all flights is the craft's or the wind's (`com-offset`, `attitude-offset`, `steady-wind`) and stays to
//! be found as that. A deviation counts when it is beyond [`SIGNIFICANT`] of its standard errors (coloured
//! residuals accounted for) and more than [`MATTERS`] of the row's residual. Only flights with measured rotor speeds have
//! trim (force rows: and with an accelerometer): where speeds follow from commands and forces from a tracker, a constant
//! that differs between flights is evidence of the battery, of weak motors, of wind.
//!
//! **Held-out flights have none.** To know a flight's own constant one must have flown it: comparison and open-loop
//! prediction get the common coefficients and nothing else.

use model::{Effect, Kind, Model};
use nalgebra::DVector;

use crate::fit::least_squares::{self, FlightRows, Solution};
use crate::fit::rows::RowColumn;
use crate::fit::terms::coefficient_count;
use crate::prepare::{ForceTarget, Prepared, Trim};

/// Standard errors beyond which a deviation is one.
pub const SIGNIFICANT: f64 = 4.0;
/// Smallest deviation that counts, of the standard deviation of the row's residual.
pub const MATTERS: f64 = 0.1;

/// Estimates the trim of training flights about the linear effects of `model` and writes it into them.
pub fn estimate(flights: &mut [&mut Prepared], model: &Model) {
    for flight in flights.iter_mut() {
        flight.trim = None;
    }
    let rows: Vec<usize> = (0..6).filter(|axis| flights.iter().all(|f| has_trim(f, *axis))).collect();
    if flights.len() < 2 || rows.is_empty() {
        return;
    }
    let linear: Vec<Effect> =
        model.effects().into_iter().filter(|e| e.info().kind != Kind::Adjusting).collect();
    let count = flights.len();
    let first: usize = linear.iter().map(|e| coefficient_count(*e)).sum();
    let all: Vec<FlightRows> = flights
        .iter()
        .enumerate()
        .map(|(index, flight)| flight_rows(flight, model, &linear, &rows, index, count))
        .collect();
    // Flights that do not determine the model: the fit says why.
    let Ok(solution) = least_squares::solve(&all, &vec![None; first + rows.len() * (count - 1)]) else {
        return;
    };
    for (index, flight) in flights.iter_mut().enumerate() {
        let mut trim = Trim { value: [0.0; 6], std_error: [f64::INFINITY; 6] };
        for (place, &axis) in rows.iter().enumerate() {
            let (value, error) = deviation(&solution, first + place * (count - 1), index, count);
            trim.std_error[axis] = error;
            if value.abs() > SIGNIFICANT * error && value.abs() > MATTERS * solution.sigma[axis] {
                trim.value[axis] = value;
            }
        }
        flight.trim = trim.value.iter().any(|v| *v != 0.0).then_some(trim);
    }
}

fn has_trim(flight: &Prepared, axis: usize) -> bool {
    flight.has_rotor_speeds() && (axis >= 3 || flight.force_target == ForceTarget::Imu)
}

/// Columns of all flights but the last are ones on that flight, and minus ones on the last.
fn flight_rows(
    flight: &Prepared,
    model: &Model,
    linear: &[Effect],
    rows: &[usize],
    index: usize,
    count: usize,
) -> FlightRows {
    let stride = flight.fit_stride();
    let targets = flight.targets(&model.vehicle, &model.adjustments(), stride);
    let length = targets[0].len();
    let mut columns = flight.columns(linear, model, stride, None);
    for &axis in rows {
        for own in 0..count - 1 {
            let value = if index == count - 1 { -1.0 } else { f64::from(u8::from(index == own)) };
            let mut column = RowColumn::default();
            column[axis] = (value != 0.0).then(|| vec![value; length]);
            columns.push(column);
        }
    }
    flight.rows_of_fit(targets, columns)
}

/// Value and standard error of flight `index`'s deviation on the axis whose parameters begin at `first`.
fn deviation(solution: &Solution, first: usize, index: usize, count: usize) -> (f64, f64) {
    let weights =
        DVector::from_fn(
            count - 1,
            |k, _| {
                if index == count - 1 { -1.0 } else { f64::from(u8::from(index == k)) }
            },
        );
    let values = solution.value.rows(first, count - 1);
    let covariance = solution.covariance.view((first, first), (count - 1, count - 1));
    (weights.dot(&values), weights.dot(&(covariance * &weights)).max(0.0).sqrt())
}
