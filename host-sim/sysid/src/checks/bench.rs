//! What is no flight whatever it holds: a clock that leaps by hours, motors that never turn.
//!
//! Both are looked at before anything else. A log of the bench says nothing about a craft in the air, and what is fitted to it
//! would be numbers without a meaning; a leap of the clock would ask for memory by the time that it claims.

use flights::{Column, Flight, StandIn};
use model::Vehicle;

use super::airborne::STOPPED;
use super::channels::COMMANDS;
use crate::prepare::PrepareError;

/// Longest gap in a log that is taken, s.
const LONGEST_GAP_S: f64 = 3600.0;
/// No rotor that carries a craft turns slower, rad/s.
const SLOWEST_ROTOR_RAD_S: f64 = 10.0;

pub(super) const SPEEDS: [Column; 4] = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];

/// Refuses a gap over an hour between two rows that are asked for.
pub(super) fn refuse_long_gaps(t: &[f64], asked: &[bool]) -> Result<(), PrepareError> {
    let gap = t.windows(2).zip(asked.windows(2)).find(|(t, asked)| {
        let is_long = t[1] - t[0] > LONGEST_GAP_S;
        is_long && asked.iter().all(|asked| *asked)
    });
    match gap {
        Some((t, _)) => Err(PrepareError::Gap { before_s: t[0], after_s: t[1], longest_s: LONGEST_GAP_S }),
        None => Ok(()),
    }
}

/// Refuses a log whose motors are at rest in all rows that are asked for, by all that it says of them.
pub(super) fn refuse_motors_at_rest(
    flight: &Flight,
    vehicle: &Vehicle,
    asked: &[bool],
) -> Result<(), PrepareError> {
    let largest = |columns: [Column; 4]| -> Option<f64> {
        let columns = columns.iter().map(|column| flight.column(*column)).collect::<Option<Vec<_>>>()?;
        let values = columns.into_iter().flat_map(|values| values.iter().zip(asked));
        values.filter(|(value, asked)| **asked && value.is_finite()).map(|(value, _)| *value).reduce(f64::max)
    };
    let [low, high] = vehicle.motors.command_range;
    let commands_were_logged = !flight.stand_ins().contains(&StandIn::RotorSpeeds);
    let command = largest(COMMANDS).filter(|_| commands_were_logged);
    let speed = largest(SPEEDS);
    if command.is_some_and(|command| command > low + STOPPED * (high - low))
        || speed.is_some_and(|speed| speed > SLOWEST_ROTOR_RAD_S)
    {
        return Ok(());
    }
    let what = match (command, speed) {
        (_, Some(speed)) => format!("omega1..4 are at most {speed} rad/s"),
        (Some(command), None) => {
            format!(
                "cmd1..4 are at most {command}, where the motors stand at {low} {}",
                vehicle.motors.command_unit
            )
        }
        (None, None) => return Ok(()),
    };
    Err(PrepareError::MotorsAtRest { what })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::{Parts, examine, examine_parts};
    use crate::testing::flight;

    /// Four seconds of a craft that hovers, its motors commanded so.
    fn commanded(command: f64) -> Flight {
        let mut flight = flight(400, |_, _| {});
        for column in COMMANDS {
            flight.replace(column, vec![command; 400]);
        }
        flight
    }

    fn refused(flight: &Flight, parts: &Parts) -> String {
        match examine_parts(flight, &Vehicle::thesis(), parts) {
            Ok(_) => panic!("taken"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn motors_at_rest_are_named_whatever_part_is_asked_for() {
        let [low, high] = Vehicle::thesis().motors.command_range;
        let still = commanded(low + 0.005 * (high - low));
        for parts in [Parts::Flown, Parts::Given(vec![[0.0, 4.0]])] {
            let error = refused(&still, &parts);
            assert!(error.starts_with("motors at rest: cmd1..4 are at most "), "{error}");
        }
        let turning = commanded(0.5 * (low + high));
        assert!(!matches!(examine(&turning, &Vehicle::thesis()), Err(PrepareError::MotorsAtRest { .. })));
    }

    #[test]
    fn a_gap_over_an_hour_is_refused_where_it_is_asked_for() {
        for leap_s in [3601.0, 1e6, 1e9, 1e15] {
            let mut leaping = commanded(1500.0);
            let mut t = leaping.required(Column::T).to_vec();
            t[200..].iter_mut().for_each(|t| *t += leap_s);
            leaping.replace(Column::T, t.clone());
            let error = refused(&leaping, &Parts::Flown);
            assert!(error.starts_with("has nothing between t = 1.99 s and t = "), "{error}");
            let one_side = Parts::Given(vec![[0.0, 1.995]]);
            let taken = examine_parts(&leaping, &Vehicle::thesis(), &one_side);
            assert!(!matches!(taken, Err(PrepareError::Gap { .. })));
        }
    }
}
