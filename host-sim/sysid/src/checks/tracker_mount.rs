//! How the tracker's body axes and its tracked point lie against the accelerometer.
//!
//! ```text
//! R (p'' - g) - f = c - tilt x (f - mean f) + R (R^T)'' lever + w x R (p'' - g) late_1 + R dp''/dt late_2,   c = -tilt x mean f
//! ```
//!
//! With `f` what the accelerometer told, its own offset included: to the sides, that is the same as a tilt, for in the mean the force of a
//! flying craft is -g along z of the body. So the value of the tilt says little, but a change of it says that the tracked body was defined anew, that
//! a sensor was moved, or that the offset has changed.
//! The small part of the varying force is that of the tilt that the constant gives: fitted by itself, it would cost the lever its accuracy.

use model::Vehicle;
use nalgebra::{DVector, Vector3};

use crate::checks::accelerometer::Comparison;
use crate::fit::least_squares::{self, FlightRows, RowColumn};
use crate::prepare::{Prepared, vector};

/// Fewest rows: some seconds.
const FEWEST_ROWS: usize = 300;
/// A constant along each axis, the lever and lateness.
const UNKNOWNS: usize = 8;
/// Place of the lever among them.
const LEVER: usize = 3;
/// Largest standard errors of what is told, rad and m.
const KNOWN_RAD: f64 = 0.002;
const KNOWN_M: f64 = 0.003;

/// A tracked body against the accelerometer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerMount {
    /// Turn of the tracked attitude against the accelerometer about x and y, the accelerometer's offset over g included, rad.
    pub tilt_rad: [f64; 2],
    /// Their standard errors, rad.
    pub tilt_error_rad: [f64; 2],
    /// Absent where the craft hardly turned.
    pub lever: Option<Lever>,
}

/// Tracked point from the accelerometer, body FRD.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lever {
    /// Along each axis, m.
    pub value_m: [f64; 3],
    /// Standard errors of that, m.
    pub error_m: [f64; 3],
}

/// Of a flight with a motion capture and an accelerometer; nothing of others.
pub fn of_flight(flight: &Prepared, vehicle: &Vehicle) -> Option<TrackerMount> {
    if flight.has_logged_velocity {
        return None;
    }
    let comparison = Comparison::of(flight, vehicle.gravity)?;
    if comparison.rows.tracked[0].len() < FEWEST_ROWS {
        return None;
    }
    let with = |tilt_rad: [f64; 2]| {
        let rows = rows(&comparison, flight.accelerometer_bias_m_s2, tilt_rad);
        least_squares::solve(&[rows], &[None; UNKNOWNS]).ok()
    };
    let tilt_rad = |c: &DVector<f64>| [-c[1] / vehicle.gravity, c[0] / vehicle.gravity];
    let solution = with(tilt_rad(&with([0.0; 2])?.value))?;
    let of = |k: usize| solution.value[k];
    let error = |k: usize| solution.covariance[(k, k)].max(0.0).sqrt();
    let tilt_error_rad = [1, 0].map(|k| error(k) / vehicle.gravity);
    let is_known = tilt_error_rad.iter().all(|error| *error < KNOWN_RAD);
    let places = [LEVER, LEVER + 1, LEVER + 2];
    let lever = Lever { value_m: places.map(of), error_m: places.map(error) };
    let has_lever = lever.error_m.iter().all(|error| *error < KNOWN_M);
    is_known.then(|| TrackerMount {
        tilt_rad: tilt_rad(&solution.value),
        tilt_error_rad,
        lever: has_lever.then_some(lever),
    })
}

/// What the tracker has beside the accelerometer, whose offset to the sides was taken out of the flight, and whose varying part is turned by a tilt.
fn rows(comparison: &Comparison, taken_out_m_s2: [f64; 2], tilt_rad: [f64; 2]) -> FlightRows {
    let rows = &comparison.rows;
    let count = rows.tracked[0].len();
    let mean = Vector3::from_fn(|axis, _| rows.sensed[axis].iter().sum::<f64>() / count.max(1) as f64);
    let offset = Vector3::new(taken_out_m_s2[0], taken_out_m_s2[1], 0.0);
    let tilt = Vector3::new(tilt_rad[0], tilt_rad[1], 0.0);
    let mut targets: [Vec<f64>; 6] = Default::default();
    targets[..3].fill(vec![0.0; count]);
    for k in 0..count {
        let sensed = vector(&rows.sensed, k);
        let target = vector(&rows.tracked, k) - sensed - offset + tilt.cross(&(sensed - mean));
        (0..3).for_each(|axis| targets[3 + axis].push(target[axis]));
    }
    let constant = |axis: usize| {
        let mut column = RowColumn::default();
        column[3 + axis] = Some(vec![1.0; count]);
        column
    };
    let further = rows.further.iter().map(|[x, y, z]| -> RowColumn {
        [None, None, None, Some(x.clone()), Some(y.clone()), Some(z.clone())]
    });
    rows.of(targets, (0..3).map(constant).chain(further).collect())
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use nalgebra::Rotation3;

    use flights::Column;

    use super::*;
    use crate::testing::waving_with_imu;

    /// An accelerometer that is off, and a tracked body that is turned by 1.5 deg and -1 deg and tracked 15 mm ahead of the sensor.
    #[test]
    fn a_tracked_body_that_was_defined_anew_shows_its_turn_and_its_lever() {
        let lever_m = Vector3::new(0.015, -0.01, 0.02);
        let turn = Rotation3::from_euler_angles(1.5_f64.to_radians(), (-1.0_f64).to_radians(), 0.0);
        let offset_m_s2 = Vector3::new(0.05, -0.03, 0.0);
        let of = |lever_m: Vector3<f64>, turn: Rotation3<f64>| {
            let attitudes = RefCell::new(Vec::new());
            let mut flight = waving_with_imu(4000, |force, dcm| {
                attitudes.borrow_mut().push(dcm);
                force + offset_m_s2
            });
            let attitudes = attitudes.into_inner();
            for (axis, column) in [Column::X, Column::Y, Column::Z].into_iter().enumerate() {
                let shifted = flight.required(column).iter().zip(&attitudes);
                let shifted = shifted.map(|(value, dcm)| value + dcm.tr_mul(&lever_m)[axis]).collect();
                flight.replace(column, shifted);
            }
            let angles: Vec<(f64, f64, f64)> = attitudes
                .iter()
                .map(|dcm| {
                    Rotation3::from_matrix(&(turn.inverse().matrix() * dcm).transpose()).euler_angles()
                })
                .collect();
            flight.replace(Column::Phi, angles.iter().map(|a| a.0).collect());
            flight.replace(Column::Theta, angles.iter().map(|a| a.1).collect());
            flight.replace(Column::Psi, angles.iter().map(|a| a.2).collect());
            let vehicle = Vehicle::thesis();
            of_flight(&Prepared::new(&flight, &vehicle).unwrap(), &vehicle).unwrap()
        };
        let (before, now) = (of(Vector3::zeros(), Rotation3::identity()), of(lever_m, turn));
        for (axis, degrees) in [1.5_f64, -1.0].into_iter().enumerate() {
            let found_deg = (now.tilt_rad[axis] - before.tilt_rad[axis]).to_degrees();
            assert!((found_deg - degrees).abs() < 0.05, "{found_deg} for {degrees}");
        }
        let [now_m, before_m] = [now, before].map(|of| Vector3::from(of.lever.unwrap().value_m));
        assert!((now_m - before_m - lever_m).norm() < 0.001, "{now_m:?} {before_m:?}");
    }
}
