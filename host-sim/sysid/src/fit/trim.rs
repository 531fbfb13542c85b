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

use crate::fit::least_squares::RowColumn;
use crate::fit::least_squares::{self, FlightRows, Solution};
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

#[cfg(test)]
mod tests {
    use flights::Column;
    use model::{Plant, Vehicle};
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// A flight with measured rotor speeds and an accelerometer of little noise that is off
    /// forwards by so much, m/s^2.
    fn logged(seed: u64, off_m_s2: f64) -> Prepared {
        let model = truth();
        let mut flight = fly(&model, seed, 12.0, &NONE);
        let adjust = model.adjustments();
        let bare = Prepared::new(&flight, &model.vehicle).unwrap();
        let states = bare.states(&bare.stretches[0], &model.vehicle, &adjust);
        let plant = Plant::new(&model);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let rows: Vec<([f64; 6], [f64; 4])> = (0..states.len())
            .map(|k| {
                let input = states.at(k);
                let mut felt = plant.accelerations(&plant.sample_of(&input));
                felt.iter_mut().for_each(|f| *f += 0.1 * (rng.random::<f64>() - 0.5));
                felt[0] += off_m_s2;
                (felt, input.rotor_rad_s)
            })
            .collect();
        for (i, column) in [Column::Ax, Column::Ay, Column::Az].into_iter().enumerate() {
            flight.replace(column, rows.iter().map(|(felt, _)| felt[i]).collect());
        }
        let speeds = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];
        for (i, column) in speeds.into_iter().enumerate() {
            flight.replace(column, rows.iter().map(|(_, rotor)| rotor[i]).collect());
        }
        Prepared::new(&flight, &Vehicle::thesis()).unwrap()
    }

    fn estimated(mut flights: Vec<Prepared>) -> Vec<Option<Trim>> {
        estimate(&mut flights.iter_mut().collect::<Vec<_>>(), &truth());
        flights.into_iter().map(|flight| flight.trim).collect()
    }

    /// Without a common part, which would stay in the residual and blow up the errors.
    #[test]
    fn constants_that_differ_between_flights_are_found_in_each() {
        let trims = estimated(vec![logged(1, 0.2), logged(2, -0.1), logged(3, -0.1)]);
        for (trim, expected) in trims.iter().zip([0.2, -0.1, -0.1]) {
            let trim = trim.as_ref().expect("each stands out");
            assert!((trim.value[0] - expected).abs() < 0.01, "{trim:?}");
            assert!(trim.std_error[0] < 0.01, "{trim:?}");
        }
    }

    /// Off by 0.3, 0 and 0 m/s^2: the first is 0.2 from the mean.
    #[test]
    fn a_constant_counts_from_the_mean_of_all_flights() {
        let trims = estimated(vec![logged(1, 0.3), logged(2, 0.0), logged(3, 0.0)]);
        let first = trims[0].as_ref().expect("it stands out");
        assert!((first.value[0] - 0.2).abs() < 0.01, "{first:?}");
    }

    #[test]
    fn what_all_flights_are_off_by_is_the_crafts() {
        let trims = estimated(vec![logged(1, 0.3), logged(2, 0.3), logged(3, 0.3)]);
        assert!(trims.iter().all(|trim| trim.as_ref().is_none_or(|t| t.value[0] == 0.0)), "{trims:?}");
    }

    #[test]
    fn a_single_flight_and_flights_of_commands_have_none_and_lose_what_they_had() {
        let trim = || Some(Trim { value: [1.0; 6], std_error: [0.1; 6] });
        let alone = Prepared { trim: trim(), ..logged(1, 0.3) };
        assert_eq!(estimated(vec![alone]), [None]);
        let model = truth();
        let tracked = |seed: u64| {
            let flight = Prepared::new(&fly(&model, seed, 8.0, &NONE), &model.vehicle).unwrap();
            Prepared { trim: trim(), ..flight }
        };
        assert_eq!(estimated(vec![tracked(1), tracked(2)]), [None, None]);
        assert_eq!(estimated(Vec::new()), []);
    }

    #[test]
    fn forces_have_trim_by_an_accelerometer_only_and_moments_by_measured_speeds() {
        let mut flight = logged(1, 0.0);
        assert!(has_trim(&flight, 0) && has_trim(&flight, 5));
        flight.force_target = ForceTarget::Velocity;
        assert!(!has_trim(&flight, 2) && has_trim(&flight, 3));
        flight.stretches[0].logged_rotor_rad_s = None;
        assert!(!has_trim(&flight, 3));
    }
}
