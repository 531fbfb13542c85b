//! Flights in closed loop: are motor coefficients the craft's, or do they follow how the flight was flown?
//!
//! A controller answers every moment that disturbs the craft with its motors. Where motor commands follow a disturbance
//! that the model leaves out or has only in part, least squares takes the disturbance for the motors' work and their
//! coefficients shrink, in each flight by another amount: they follow the manoeuvres, not the craft (Ljung 1999,
//! section 13.4). Two signs of it, both measured here:
//! - the motor coefficients of single flights, everything else held, differ by more than their errors;
//! - the motors' moment is strongly correlated with a speed or a rate: what they do is an answer.
//!
//! A third, by how much they are too small, comes from the frequencies that controllers do not answer: `motor_response.rs`.
//!
//! The remedy is excitation that answers nothing: each motor by itself, at several hertz, on top of the controller.

use model::{Axis, Effect, Model};
use nalgebra::DVector;
use report::number::fixed;
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::fit::least_squares;
use crate::fit::least_squares::RowColumn;
use crate::fit::linearise::residuals_at_rows;
use crate::fit::motor_response::{MotorResponse, motion_about, motor_responses};
use crate::fit::rotation::has_rotation;
use crate::prepare::Prepared;

/// Correlation of the motors' moment with a speed or rate from which on they are taken for an answer to it.
pub const STRONG_CORRELATION: f64 = 0.8;
/// Largest p-value of "the motor coefficients of all flights are the same".
const SIGNIFICANCE: f64 = 0.001;

/// Motor coefficients of one axis, flight by flight.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MotorsOfFlights {
    /// p, q or r.
    pub axis: Axis,
    /// Each flight, those that do not determine the axis left out.
    pub flights: Vec<MotorsOfFlight>,
    /// Root mean square of the differences from the common coefficients over their standard errors: 1 where there is
    /// nothing but error.
    pub spread: f64,
    /// p-value of the hypothesis that all flights have the same coefficients.
    pub p_value: f64,
    /// The speed or rate that the motors' moment follows most.
    pub follows: &'static str,
    /// Their correlation.
    pub correlation: f64,
    /// What the motors do at several hertz; nothing where flights are too short or sampled too slowly to show it.
    pub response: Option<MotorResponse>,
    /// What to think of it and what to fly; nothing where there is no reason to doubt.
    pub warning: Option<String>,
}

/// Coefficients of motors 1 to 4 on one axis in one flight, 1/(kg m^2).
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MotorsOfFlight {
    /// File name.
    pub name: String,
    /// Values.
    pub value: [f64; 4],
    /// Standard errors.
    pub std_error: [f64; 4],
}

/// Motor coefficients of each flight with the rest of the model held; nothing for a model without rotation.
pub fn motors_of_flights(model: &Model, flights: &[&Prepared]) -> Vec<MotorsOfFlights> {
    let Some(term) = model.term(Effect::RotorMoments).filter(|_| has_rotation(model)) else {
        return Vec::new();
    };
    let common: Vec<f64> = term.coefficients.iter().map(|c| c.value).collect();
    let columns: Vec<Vec<RowColumn>> =
        flights.iter().map(|f| f.columns(&[Effect::RotorMoments], model, f.fit_stride(), None)).collect();
    let mut responses = motor_responses(model, flights);
    [Axis::P, Axis::Q, Axis::R]
        .into_iter()
        .enumerate()
        .map(|(place, axis)| {
            let own: [f64; 4] = std::array::from_fn(|motor| common[4 * place + motor]);
            let mut motors = of_axis(model, flights, &columns, axis, own);
            let of_axis = responses.iter().position(|response| response.axis == axis);
            motors.response = of_axis.map(|at| responses.swap_remove(at));
            motors.warning = warning(&motors);
            motors
        })
        .collect()
}

fn of_axis(
    model: &Model,
    flights: &[&Prepared],
    columns: &[Vec<RowColumn>],
    axis: Axis,
    common: [f64; 4],
) -> MotorsOfFlights {
    let first = 4 * (axis.index() - 3);
    let (mut found, mut wald, mut freedom) = (Vec::new(), 0.0, 0.0);
    for (flight, columns) in flights.iter().zip(columns) {
        let Some((step, distance, std_error)) = own_step(model, flight, &columns[first..first + 4], axis)
        else {
            continue;
        };
        wald += distance;
        freedom += 4.0;
        found.push(MotorsOfFlight {
            name: flight.name.clone(),
            value: std::array::from_fn(|motor| common[motor] + step[motor]),
            std_error,
        });
    }
    // The common coefficients are theirs: four fewer.
    freedom -= 4.0;
    let p_value = ChiSquared::new(freedom).map_or(1.0, |d| d.sf(wald));
    let (follows, correlation) = strongest_correlation(model, flights, columns, axis, common);
    MotorsOfFlights {
        axis,
        flights: found,
        spread: if freedom > 0.0 { (wald / freedom).sqrt() } else { 0.0 },
        p_value,
        follows,
        correlation,
        response: None,
        warning: None,
    }
}

/// Step from the common coefficients to the flight's own, its square in units of its covariance, and standard errors.
fn own_step(
    model: &Model,
    flight: &Prepared,
    motors: &[RowColumn],
    axis: Axis,
) -> Option<(DVector<f64>, f64, [f64; 4])> {
    let stride = flight.fit_stride();
    let mut targets = residuals_at_rows(flight, model, stride).residual;
    let rows = targets[axis.index()].len();
    for (index, target) in targets.iter_mut().enumerate().filter(|(index, _)| *index != axis.index()) {
        debug_assert_ne!(index, axis.index());
        target.fill(0.0);
    }
    let only = |column: Vec<f64>| -> RowColumn {
        let mut all = RowColumn::default();
        all[axis.index()] = Some(column);
        all
    };
    let mut columns: Vec<RowColumn> =
        motors.iter().filter_map(|column| column[axis.index()].clone()).map(only).collect();
    // A constant of the flight would lean on unequal motors.
    columns.push(only(vec![1.0; rows]));
    let rows = flight.rows_of_fit(targets, columns);
    let solution = least_squares::solve(&[rows], &[None; 5]).ok()?;
    let step: DVector<f64> = solution.value.rows(0, 4).into_owned();
    let covariance = solution.covariance.view((0, 0), (4, 4)).into_owned();
    let std_error = std::array::from_fn(|k| covariance[(k, k)].max(0.0).sqrt());
    let distance = step.dot(&covariance.cholesky()?.solve(&step));
    Some((step, distance, std_error))
}

/// The speed or rate with the strongest correlation with the motors' moment about an axis, means of flights aside.
fn strongest_correlation(
    model: &Model,
    flights: &[&Prepared],
    columns: &[Vec<RowColumn>],
    axis: Axis,
    common: [f64; 4],
) -> (&'static str, f64) {
    let place = axis.index() - 3;
    // Sums of squares and products: moment, speed, rate.
    let mut sums = [[0.0; 3]; 3];
    for (flight, columns) in flights.iter().zip(columns) {
        let conditions = flight.conditions(&model.vehicle, &model.adjustments());
        let rows = flight.row_samples_of_conditions();
        let moment: Vec<f64> = (0..rows.len())
            .map(|row| {
                let part =
                    |motor: usize| columns[4 * place + motor][axis.index()].as_ref().map_or(0.0, |c| c[row]);
                (0..4).map(|motor| common[motor] * part(motor)).sum()
            })
            .collect();
        let at_rows = |all: &[f64]| -> Vec<f64> { rows.iter().map(|&k| all[k]).collect() };
        // Roll answers sideward speed, pitch forward speed; yaw has none.
        let speed = match axis {
            Axis::P => at_rows(&conditions.velocity_m_s[1]),
            Axis::Q => at_rows(&conditions.velocity_m_s[0]),
            _ => vec![0.0; rows.len()],
        };
        let signals = [moment, speed, at_rows(&conditions.rate_rad_s[place])].map(about_mean);
        for (i, a) in signals.iter().enumerate() {
            for (j, b) in signals.iter().enumerate() {
                sums[i][j] += a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            }
        }
    }
    let correlation = |k: usize| {
        let norm = (sums[0][0] * sums[k][k]).sqrt();
        if norm > 0.0 { sums[0][k] / norm } else { 0.0 }
    };
    let names = match axis {
        Axis::P => ["sideward speed", "roll rate"],
        Axis::Q => ["forward speed", "pitch rate"],
        _ => ["speed", "yaw rate"],
    };
    let (speed, rate) = (correlation(1), correlation(2));
    if speed.abs() >= rate.abs() { (names[0], speed) } else { (names[1], rate) }
}

fn about_mean(mut signal: Vec<f64>) -> Vec<f64> {
    let mean = signal.iter().sum::<f64>() / signal.len().max(1) as f64;
    signal.iter_mut().for_each(|s| *s -= mean);
    signal
}

fn warning(motors: &MotorsOfFlights) -> Option<String> {
    const REMEDY: &str = "excite each motor by itself at several hertz";
    if let Some(response) = motors.response.as_ref().filter(|response| response.contradicts()) {
        return Some(format!("{}; {REMEDY}", response.sentence()));
    }
    let axis = motion_about(motors.axis);
    (motors.correlation.abs() > STRONG_CORRELATION && motors.p_value < SIGNIFICANCE).then(|| {
        format!(
            "{axis}: the motors' moment follows the {} (correlation {}) and motor coefficients differ between \
             flights by {} of their errors: they depend on how the flights were flown; {REMEDY}",
            motors.follows,
            fixed(motors.correlation, 2),
            fixed(motors.spread, 1)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn motors(correlation: f64, p_value: f64) -> MotorsOfFlights {
        MotorsOfFlights {
            axis: Axis::Q,
            flights: Vec::new(),
            spread: 3.24,
            p_value,
            follows: "forward speed",
            correlation,
            response: None,
            warning: None,
        }
    }

    #[test]
    fn only_motors_that_follow_and_differ_are_doubted() {
        assert_eq!(warning(&motors(0.79, 1e-9)), None);
        assert_eq!(warning(&motors(-0.99, 0.002)), None);
        assert_eq!(
            warning(&motors(-0.81, 0.0009)).unwrap(),
            "pitch: the motors' moment follows the forward speed (correlation -0.81) and motor coefficients \
             differ between flights by 3.2 of their errors: they depend on how the flights were flown; excite \
             each motor by itself at several hertz"
        );
    }

    #[test]
    fn a_signal_is_taken_about_its_mean() {
        assert_eq!(about_mean(vec![1.0, 2.0, 6.0]), [-2.0, -1.0, 3.0]);
        assert!(about_mean(Vec::new()).is_empty());
    }

    #[test]
    fn of_a_model_without_rotation_there_are_no_motors() {
        let mut model = truth();
        let flight = Prepared::new(&fly(&model, 1, 8.0, &NONE), &model.vehicle).unwrap();
        model.terms.retain(|term| term.effect == Effect::Thrust);
        assert!(motors_of_flights(&model, &[&flight]).is_empty());
    }

    #[test]
    fn a_single_flight_differs_from_no_other() {
        let model = truth();
        let flight = Prepared::new(&fly(&model, 1, 8.0, &NONE), &model.vehicle).unwrap();
        let all = motors_of_flights(&model, &[&flight]);
        assert_eq!(all.iter().map(|m| m.axis).collect::<Vec<_>>(), [Axis::P, Axis::Q, Axis::R]);
        for motors in &all {
            assert_eq!((motors.spread, motors.p_value, motors.flights.len()), (0.0, 1.0, 1));
            assert!(motors.correlation.abs() <= 1.0 && motors.warning.is_none());
        }
        let none = motors_of_flights(&model, &[]);
        assert!(none.iter().all(|m| m.flights.is_empty() && m.p_value == 1.0 && m.correlation == 0.0));
    }

    #[test]
    fn each_flight_shows_the_coefficients_of_the_craft_that_flew_it() {
        let model = truth();
        let mut weak = model.clone();
        let mut values = model.term(Effect::RotorMoments).unwrap().values();
        values[1] *= 0.7;
        weak.set(Effect::RotorMoments, &values);
        let flights = [(&model, 1), (&weak, 2)]
            .map(|(flown, seed)| Prepared::new(&fly(flown, seed, 12.0, &NONE), &flown.vehicle).unwrap());
        let roll = motors_of_flights(&model, &flights.each_ref()).swap_remove(0);
        let truth = |values: &[f64], motor: usize| values[motor];
        let common = model.term(Effect::RotorMoments).unwrap().values();
        for motor in 0..4 {
            let [same, own] = [0, 1].map(|flight| roll.flights[flight].value[motor]);
            let size = common[0].abs();
            assert!((same - truth(&common, motor)).abs() < 0.08 * size, "{motor}: {same}");
            assert!((own - truth(&values, motor)).abs() < 0.08 * size, "{motor}: {own}");
        }
        assert!(roll.p_value < 1e-3 && roll.spread > 2.0, "{roll:?}");
    }
}
