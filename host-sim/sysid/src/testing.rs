//! Flights for tests: told sample by sample by a formula, or flown by the product's own plant.

#[path = "../../diagnosis/tests/common/flown.rs"]
mod flown;

use flights::{Column, Flight};
use model::{Vehicle, frames};
use nalgebra::{Matrix3, Vector3};

use crate::Prepared;

pub(crate) use flown::{FED_BACK, NONE, ORDINARY, fly, truth};

/// A sample of a flight at 100 Hz. To begin with the craft hovers at the origin.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub(crate) time_s: f64,
    pub(crate) position_ned_m: [f64; 3],
    pub(crate) euler_rad: [f64; 3],
    pub(crate) rate_rad_s: [f64; 3],
    pub(crate) command: [f64; 4],
    pub(crate) battery_v: f64,
}

impl Row {
    pub(crate) fn hover(time_s: f64) -> Self {
        Self {
            time_s,
            position_ned_m: [0.0; 3],
            euler_rad: [0.0; 3],
            rate_rad_s: [0.0; 3],
            command: [1600.0; 4],
            battery_v: 12.0,
        }
    }

    /// Waves about all axes: place, attitude and the rates that go with it. Hands over the
    /// acceleration of the place, NED, m/s^2.
    pub(crate) fn wave(&mut self) -> Vector3<f64> {
        let t = self.time_s;
        // Amplitude, frequency rad/s and phase of north, east, down, phi, theta, psi.
        let waves = [
            (0.7, 1.9, 0.3),
            (0.6, 2.3, 1.1),
            (0.4, 2.9, 2.0),
            (0.25, 2.1, 0.7),
            (0.2, 2.7, 1.9),
            (0.5, 1.3, 0.1),
        ];
        let value = waves.map(|(a, w, f)| a * (w * t + f).sin());
        let slope = waves.map(|(a, w, f)| a * w * (w * t + f).cos());
        let [x, y, z, phi, theta, psi] = value;
        (self.position_ned_m, self.euler_rad) = ([x, y, z - 1.0], [phi, theta, psi]);
        let slopes = Vector3::new(slope[3], slope[4], slope[5]);
        self.rate_rad_s = frames::body_rates_from_euler(Vector3::new(phi, theta, psi), slopes).into();
        Vector3::from_fn(|i, _| -value[i] * waves[i].1 * waves[i].1)
    }
}

/// A waving flight with what an accelerometer without faults feels, turned into what was logged by
/// `told` from the specific force along the body axes and the attitude (inertial to body).
pub(crate) fn waving_with_imu(
    samples: usize,
    told: impl Fn(Vector3<f64>, Matrix3<f64>) -> Vector3<f64>,
) -> Flight {
    let mut flight = flight(samples, |_, row| {
        row.wave();
    });
    let forces: Vec<Vector3<f64>> = flight
        .required(Column::T)
        .iter()
        .map(|&t| {
            let mut row = Row::hover(t);
            let felt_m_s2 = row.wave() - Vector3::new(0.0, 0.0, 9.81);
            let dcm = frames::dcm_from_euler(row.euler_rad.into());
            told(dcm * felt_m_s2, dcm)
        })
        .collect();
    for (i, column) in [Column::Ax, Column::Ay, Column::Az].into_iter().enumerate() {
        flight.replace(column, forces.iter().map(|f| f[i]).collect());
    }
    flight
}

/// A flight of so many samples; `edit` says at each time in what it differs from a hover.
pub(crate) fn flight(samples: usize, edit: impl Fn(f64, &mut Row)) -> Flight {
    use Column::*;
    let row = |k: usize| {
        let mut row = Row::hover(0.01 * k as f64);
        edit(row.time_s, &mut row);
        let Row { time_s, position_ned_m: [x, y, z], euler_rad: [f, g, h], rate_rad_s: [p, q, r], .. } = row;
        let [a, b, c, d] = row.command;
        [time_s, x, y, z, f, g, h, p, q, r, a, b, c, d, row.battery_v]
    };
    let rows: Vec<[f64; 15]> = (0..samples).map(row).collect();
    let columns = [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
    let values = columns.into_iter().enumerate().map(|(i, c)| (c, rows.iter().map(|r| r[i]).collect()));
    Flight::from_columns("made-up.csv", values)
}

/// The same, prepared for the thesis' vehicle.
pub(crate) fn prepared(samples: usize, edit: impl Fn(f64, &mut Row)) -> Prepared {
    Prepared::new(&flight(samples, edit), &Vehicle::thesis()).unwrap()
}
