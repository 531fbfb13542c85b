//! The constant offset of an accelerometer to the sides, found in its own rows and taken out.
//!
//! Forces are fitted to the accelerometer where there is one. An ordinary one is off by 0.05 m/s^2, and then a force is fitted that no air
//! exerts: it turns with the craft, so that it passes for a wind that wanders, and hides the drag. To the sides a craft feels
//!
//! ```text
//! f = offset + d v + e |v| v + R a + w' x l + w x (w x l)
//! ```
//!
//! its drag, a steady push `a` over the ground, of a wind or a cable, and what a turning craft gives a sensor at `l` from its centre. A craft that turns about its vertical axis and flies to and fro
//! tells them apart; where it does not, the error of the offset is large and nothing is taken out. Against the tracked motion no more can be
//! said: there, an attitude that leans is the same as an offset. What else pushes along the axes of the body all the time, as a rotor that leans,
//! goes with it; [`put_back`] is for whoever knows better. Along the thrust, an offset is hidden by the scale of the thrust.

use crate::checks::linear_sensor::Rows;
use nalgebra::{Matrix3, Vector3};

use crate::filter::sum_of_products;
use crate::fit::least_squares::{self, FlightRows, Prior, RowColumn};
use crate::prepare::{ForceTarget, Prepared, Stretch, subtract_accelerometer_bias, vector};

/// Standard errors that an offset stands out by.
const SIGNIFICANT: f64 = 3.0;
/// Smallest offset that matters, m/s^2.
const MATTERS_M_S2: f64 = 0.01;
/// Largest standard error of one that is known, m/s^2.
const KNOWN_M_S2: f64 = 0.02;
/// Offset, linear and quadratic drag of each axis, the push and the lever.
const UNKNOWNS: usize = 11;
/// Places of the last two among them.
const PUSH: usize = 6;
const LEVER: usize = 8;
/// What is left of an offset by rounding, m/s^2.
const ROUNDING_M_S2: f64 = 1e-6;
/// Where a sensor is: at the centre, within so much, m.
const LEVER_M: f64 = 0.1;

/// A constant specific force along x and y of the body, as an accelerometer tells it: its own offset, and what pushes the craft there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstantForce {
    /// Along x and y, with what was taken out of the flight, m/s^2.
    pub value_m_s2: [f64; 2],
    /// Standard errors of that, m/s^2.
    pub error_m_s2: [f64; 2],
}

/// Of a flight whose forces are an accelerometer's; nothing where it does not tell them from drag and a push over the ground. An estimator's
/// flight has lost its offset before, and without a position nobody knows how fast the craft moved.
pub fn constant_force(flight: &Prepared) -> Option<ConstantForce> {
    if flight.force_target != ForceTarget::Imu || flight.has_logged_velocity || !flight.has_position {
        return None;
    }
    let rows = rows(flight);
    if rows.rows() <= UNKNOWNS {
        return None;
    }
    let mut priors = [None; UNKNOWNS];
    priors[LEVER..].fill(Some(Prior { expected: 0.0, deviation: LEVER_M }));
    let solution = least_squares::solve(&[rows], &priors).ok()?;
    let error_m_s2 = [0, 1].map(|k| solution.covariance[(k, k)].max(0.0).sqrt());
    let value_m_s2 = [0, 1].map(|k| solution.value[k] + flight.accelerometer_bias_m_s2[k]);
    let is_known = error_m_s2.iter().all(|error| *error < KNOWN_M_S2);
    is_known.then_some(ConstantForce { value_m_s2, error_m_s2 })
}

/// Takes the offset out of a flight, where it stands out.
pub(super) fn take_out(flight: &mut Prepared) {
    let Some(ConstantForce { value_m_s2, error_m_s2 }) = constant_force(flight) else { return };
    let stands_out = |k: usize| value_m_s2[k].abs() > MATTERS_M_S2.max(SIGNIFICANT * error_m_s2[k]);
    if stands_out(0) || stands_out(1) {
        let further = [0, 1].map(|k| value_m_s2[k] - flight.accelerometer_bias_m_s2[k]);
        subtract_accelerometer_bias(&mut flight.stretches, further);
        flight.accelerometer_bias_m_s2 = value_m_s2;
    }
}

/// Puts back what turned out to be a force, into a flight that an offset was taken out of. Whether there was anything to put back: done once, it
/// stays done.
pub fn put_back(flight: &mut Prepared, force_m_s2: [f64; 2]) -> bool {
    let taken_out_m_s2 = flight.accelerometer_bias_m_s2;
    let told = constant_force(flight).filter(|_| taken_out_m_s2 != [0.0; 2]);
    let Some(ConstantForce { value_m_s2, .. }) = told else { return false };
    let offset_m_s2 = [0, 1].map(|k| value_m_s2[k] - force_m_s2[k]);
    let further = [0, 1].map(|k| offset_m_s2[k] - taken_out_m_s2[k]);
    subtract_accelerometer_bias(&mut flight.stretches, further);
    flight.accelerometer_bias_m_s2 = offset_m_s2;
    further.iter().any(|of| of.abs() > ROUNDING_M_S2)
}

fn rows(flight: &Prepared) -> FlightRows {
    let stride = Rows::stride(flight.period_s);
    let (taps, half) = (&flight.filter.smooth, flight.filter.half());
    let mut targets: [Vec<f64>; 6] = Default::default();
    let mut columns: Vec<[Vec<f64>; 2]> = vec![Default::default(); UNKNOWNS];
    let mut starts = Vec::new();
    for stretch in &flight.stretches {
        let Some(imu) = &stretch.imu_m_s2 else { continue };
        starts.push(targets[0].len());
        for k in flight.row_samples(stretch, stride) {
            let dcm = &stretch.dcm[k];
            let velocity = dcm * vector(&stretch.velocity_ned_m_s, k);
            let speed = velocity.norm();
            let of_lever = acceleration_of_lever(flight, stretch, k);
            for axis in 0..2 {
                targets[axis].push(sum_of_products(&imu[axis][k - half..], taps));
                let own = [1.0, velocity[axis], speed * velocity[axis]];
                for (place, value) in own.into_iter().enumerate() {
                    columns[2 * place + axis][axis].push(value);
                    columns[2 * place + 1 - axis][axis].push(0.0);
                }
                (0..2).for_each(|direction| columns[PUSH + direction][axis].push(dcm[(axis, direction)]));
                (0..3).for_each(|of| columns[LEVER + of][axis].push(of_lever[(axis, of)]));
            }
        }
    }
    let count = targets[0].len();
    targets[2..].iter_mut().for_each(|axis| axis.resize(count, 0.0));
    let columns =
        columns.into_iter().map(|[x, y]| -> RowColumn { [Some(x), Some(y), None, None, None, None] });
    FlightRows { targets, columns: columns.collect(), starts, period_s: flight.period_s * stride as f64 }
}

/// The acceleration of a place on a turning craft against its centre, as a matrix that a lever in m is multiplied by.
fn acceleration_of_lever(flight: &Prepared, stretch: &Stretch, k: usize) -> Matrix3<f64> {
    let from = k - flight.filter.half();
    let filtered = |taps: &[f64]| {
        Vector3::from(stretch.rate_rad_s.each_ref().map(|rate| sum_of_products(&rate[from..], taps)))
    };
    let turning = filtered(&flight.filter.smooth).cross_matrix();
    filtered(&flight.filter.derivative).cross_matrix() + turning * turning
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};
    use model::Vehicle;

    use super::*;
    use crate::testing::{Row, flight};

    const DRAG: f64 = -0.25;
    const PUSH_M_S2: [f64; 2] = [0.12, -0.07];

    /// Flies to and fro, level, under a drag and a push, with an accelerometer that is off, and yaws by so much.
    fn flown(offset_m_s2: [f64; 2], yaw_rad: f64, quadratic_drag: f64) -> Prepared {
        Prepared::new(&raw(offset_m_s2, yaw_rad, quadratic_drag), &Vehicle::thesis()).unwrap()
    }

    fn raw(offset_m_s2: [f64; 2], yaw_rad: f64, quadratic_drag: f64) -> Flight {
        let velocity = |t: f64| Vector3::new(1.5 * (0.9 * t).sin(), 1.2 * (1.3 * t).cos(), 0.0);
        let yaw = |t: f64| 0.4 + yaw_rad * (0.37 * t).sin();
        let mut flight = flight(4000, |t, row: &mut Row| {
            row.position_ned_m = [-1.5 / 0.9 * (0.9 * t).cos(), 1.2 / 1.3 * (1.3 * t).sin(), -1.0];
            row.euler_rad = [0.0, 0.0, yaw(t)];
            row.rate_rad_s = [0.0, 0.0, 0.37 * yaw_rad * (0.37 * t).cos()];
        });
        let t: Vec<f64> = flight.required(Column::T).to_vec();
        let felt = |t: f64| {
            let v = velocity(t);
            let push = Vector3::new(PUSH_M_S2[0], PUSH_M_S2[1], 0.0);
            let (sine, cosine) = yaw(t).sin_cos();
            let over_ground = push + (DRAG + quadratic_drag * v.norm()) * v;
            [
                cosine * over_ground.x + sine * over_ground.y + offset_m_s2[0],
                cosine * over_ground.y - sine * over_ground.x + offset_m_s2[1],
                -9.81,
            ]
        };
        let felt: Vec<[f64; 3]> = t.iter().map(|t| felt(*t)).collect();
        for (axis, column) in [Column::Ax, Column::Ay, Column::Az].into_iter().enumerate() {
            flight.replace(column, felt.iter().map(|felt| felt[axis]).collect());
        }
        flight
    }

    #[test]
    fn an_offset_is_told_from_drag_and_push_and_taken_out() {
        for quadratic_drag in [0.0, -0.08] {
            let (mut flight, right) =
                (flown([0.05, -0.03], 1.5, quadratic_drag), flown([0.0; 2], 1.5, quadratic_drag));
            take_out(&mut flight);
            let [x, y] = flight.accelerometer_bias_m_s2;
            assert!((x - 0.05).abs() < 1e-3 && (y + 0.03).abs() < 1e-3, "{x} {y}");
            let felt = |flight: &Prepared| flight.stretches[0].imu_m_s2.as_ref().unwrap()[0].clone();
            assert!(felt(&flight).iter().zip(felt(&right)).all(|(own, right)| (own - right).abs() < 1e-3));
        }
    }

    #[test]
    fn a_right_accelerometer_and_one_that_cannot_be_told_from_a_push_stay_as_they_are() {
        for (offset, yaw_rad) in [([0.0; 2], 1.5), ([0.05, -0.03], 0.0)] {
            let mut flight = flown(offset, yaw_rad, -0.08);
            let before = flight.stretches[0].imu_m_s2.clone();
            take_out(&mut flight);
            assert_eq!(flight.accelerometer_bias_m_s2, [0.0; 2], "{offset:?} {yaw_rad}");
            assert_eq!(flight.stretches[0].imu_m_s2, before);
        }
    }

    /// A sensor 60 mm ahead of the centre and 40 mm to the left: where the craft yaws to and fro, it is pulled back by 9 mm/s^2 in the mean, which
    /// is no offset.
    #[test]
    fn a_sensor_beside_the_centre_feels_the_turns_of_the_craft() {
        let lever_m = Vector3::new(0.06, -0.04, 0.0);
        let (yaw_rad, turn_rad_s) = (1.5, 0.37);
        let at_centre = raw([0.05, -0.03], yaw_rad, 0.0);
        let mut flight = at_centre.clone();
        let t: Vec<f64> = flight.required(Column::T).to_vec();
        let felt = |t: f64| {
            let rate = Vector3::new(0.0, 0.0, yaw_rad * turn_rad_s * (turn_rad_s * t).cos());
            let slope = Vector3::new(0.0, 0.0, -yaw_rad * turn_rad_s * turn_rad_s * (turn_rad_s * t).sin());
            slope.cross(&lever_m) + rate.cross(&rate.cross(&lever_m))
        };
        for (axis, column) in [Column::Ax, Column::Ay].into_iter().enumerate() {
            let told = t.iter().zip(at_centre.required(column)).map(|(t, force)| force + felt(*t)[axis]);
            flight.replace(column, told.collect());
        }
        let [own, centre] = [flight, at_centre]
            .map(|flight| constant_force(&Prepared::new(&flight, &Vehicle::thesis()).unwrap()).unwrap());
        for axis in 0..2 {
            assert!((own.value_m_s2[axis] - centre.value_m_s2[axis]).abs() < 2e-3, "{own:?} {centre:?}");
        }
    }

    #[test]
    fn what_turned_out_to_be_a_force_is_felt_again() {
        let (mut flight, before) = (flown([0.05, -0.03], 1.5, 0.0), flown([0.02, -0.03], 1.5, 0.0));
        assert!(!put_back(&mut flight, [0.03, 0.0]));
        take_out(&mut flight);
        let [x, y] = constant_force(&flight).unwrap().value_m_s2;
        assert!((x - 0.05).abs() < 1e-3 && (y + 0.03).abs() < 1e-3, "{x} {y}");
        let push_m_s2 = flight.accelerometer_bias_m_s2.map(|offset| 0.6 * offset);
        assert!(put_back(&mut flight, push_m_s2));
        assert!(!put_back(&mut flight, push_m_s2));
        let [x, y] = constant_force(&flight).unwrap().value_m_s2;
        assert!((x - 0.05).abs() < 1e-3 && (y + 0.03).abs() < 1e-3, "{x} {y}");
        let felt = |flight: &Prepared| flight.stretches[0].imu_m_s2.as_ref().unwrap()[0].clone();
        let right = felt(&before).into_iter().map(|before| before - 0.02 + 0.03);
        assert!(felt(&flight).iter().zip(right).all(|(own, right)| (own - right).abs() < 1e-3));
    }

    #[test]
    fn forces_of_a_tracker_have_none() {
        let mut flight = flown([0.05, -0.03], 1.5, 0.0);
        flight.force_target = ForceTarget::Position;
        take_out(&mut flight);
        assert_eq!(flight.accelerometer_bias_m_s2, [0.0; 2]);
    }
}
