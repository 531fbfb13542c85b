//! The constant offset of an accelerometer to the sides, found in its own rows and taken out.
//!
//! Forces are fitted to the accelerometer where there is one. An ordinary one is off by 0.05 m/s^2, and then a force is fitted that no air
//! exerts: it turns with the craft, so that it passes for a wind that wanders, and hides the drag. To the sides a craft feels
//!
//! ```text
//! f = offset + d v + e |v| v + R a
//! ```
//!
//! its drag, and a steady push `a` over the ground, of a wind or a cable. A craft that turns about its vertical axis and flies to and fro
//! tells the four apart; where it does not, the error of the offset is large and nothing is taken out. Against the tracked motion no more can be
//! said: there, an attitude that leans is the same as an offset. What else pushes along the axes of the body all the time, as a rotor that leans,
//! goes with it. Along the thrust, an offset is hidden by the scale of the thrust.

use crate::checks::linear_sensor::Rows;
use crate::filter::sum_of_products;
use crate::fit::least_squares::{self, FlightRows, RowColumn};
use crate::prepare::{ForceTarget, Prepared, subtract_accelerometer_bias, vector};

/// Standard errors that an offset stands out by.
const SIGNIFICANT: f64 = 3.0;
/// Smallest offset that matters, m/s^2.
const MATTERS_M_S2: f64 = 0.01;
/// Largest standard error of one that is known, m/s^2.
const KNOWN_M_S2: f64 = 0.02;
/// Offset, linear and quadratic drag of each axis, and the push.
const UNKNOWNS: usize = 8;

/// Takes the offset out of a flight whose forces are the accelerometer's. An estimator's flight has lost it before, and without a position
/// nobody knows how fast the craft moved.
pub(super) fn take_out(flight: &mut Prepared) {
    if flight.force_target != ForceTarget::Imu || flight.has_logged_velocity || !flight.has_position {
        return;
    }
    let Some(offset_m_s2) = offset_m_s2(flight) else { return };
    subtract_accelerometer_bias(&mut flight.stretches, offset_m_s2);
    flight.accelerometer_bias_m_s2 = offset_m_s2;
}

/// The offset along x and y, where the flight tells and it stands out.
fn offset_m_s2(flight: &Prepared) -> Option<[f64; 2]> {
    let rows = rows(flight);
    if rows.rows() <= UNKNOWNS {
        return None;
    }
    let solution = least_squares::solve(&[rows], &[None; UNKNOWNS]).ok()?;
    let errors = [0, 1].map(|k| solution.covariance[(k, k)].max(0.0).sqrt());
    let offset = [0, 1].map(|k| solution.value[k]);
    let is_known = errors.iter().all(|error| *error < KNOWN_M_S2);
    let stands_out = |k: usize| offset[k].abs() > MATTERS_M_S2.max(SIGNIFICANT * errors[k]);
    (is_known && (stands_out(0) || stands_out(1))).then_some(offset)
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
            for axis in 0..2 {
                targets[axis].push(sum_of_products(&imu[axis][k - half..], taps));
                let own = [1.0, velocity[axis], speed * velocity[axis]];
                for (place, value) in own.into_iter().enumerate() {
                    columns[2 * place + axis][axis].push(value);
                    columns[2 * place + 1 - axis][axis].push(0.0);
                }
                (0..2).for_each(|direction| columns[6 + direction][axis].push(dcm[(axis, direction)]));
            }
        }
    }
    let count = targets[0].len();
    targets[2..].iter_mut().for_each(|axis| axis.resize(count, 0.0));
    let columns =
        columns.into_iter().map(|[x, y]| -> RowColumn { [Some(x), Some(y), None, None, None, None] });
    FlightRows { targets, columns: columns.collect(), starts, period_s: flight.period_s * stride as f64 }
}

#[cfg(test)]
mod tests {
    use flights::Column;
    use model::Vehicle;
    use nalgebra::Vector3;

    use super::*;
    use crate::testing::{Row, flight};

    const DRAG: f64 = -0.25;
    const PUSH_M_S2: [f64; 2] = [0.12, -0.07];

    /// Flies to and fro, level, under a drag and a push, with an accelerometer that is off, and yaws by so much.
    fn flown(offset_m_s2: [f64; 2], yaw_rad: f64, quadratic_drag: f64) -> Prepared {
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
        Prepared::new(&flight, &Vehicle::thesis()).unwrap()
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

    #[test]
    fn forces_of_a_tracker_have_none() {
        let mut flight = flown([0.05, -0.03], 1.5, 0.0);
        flight.force_target = ForceTarget::Position;
        take_out(&mut flight);
        assert_eq!(flight.accelerometer_bias_m_s2, [0.0; 2]);
    }
}
