//! Does the accelerometer feel what the tracked point does: to scale, at right angles, with a steady bias?
//!
//! The specific force is the tracked acceleration less gravity, turned into the body (`imu.rs` has found its axes right). The tracked
//! point may be off the sensor by a lever, which turns with the craft:
//!
//! ```text
//! R (p'' - g) = N f + bias + drift t + R (R^T)'' lever + w x R (p'' - g) late_1 + R dp''/dt late_2
//! ```
//!
//! To the sides a craft feels its drag alone, and in a craft that goes to and fro gravity along an attitude that is some milliseconds late
//! looks like more of it: what the clocks (`clocks.rs`) may have left of lateness of attitude and position is fitted besides.
//!
//! Vibration makes an accelerometer noisy and differentiating twice makes a tracker noisy, so each is held against the other, and only
//! what both ways say counts (`linear_sensor.rs`).
//!
//! The same rows tell whether the tracker's frame is level (`tracker_tilt.rs`).

use nalgebra::{Matrix3, Vector3};

use crate::checks::frame_taps::Taps;
use crate::checks::linear_sensor::{Rows, Sensor};
use crate::prepare::{Prepared, Stretch, push, vector};
use crate::statistics::deviation;

const ACCELEROMETER: Sensor = Sensor {
    name: "accelerometer",
    columns: ["ax", "ay", "az"],
    tracked: "the acceleration of the tracked point less gravity",
    unit: "m/s^2",
    drift_matters: 0.2,
};

/// Forces under which an axis tells nothing of its scale, m/s^2.
const EXCITED_M_S2: f64 = 0.3;

/// An accelerometer held against a tracker, row by row.
pub(super) struct Comparison {
    pub(super) rows: Rows,
    /// What gravity along x and y of the tracker's axes would do in them.
    pub(super) sideways: [[Vec<f64>; 3]; 2],
    pub(super) gravity_m_s2: f64,
}

impl Comparison {
    /// Of a flight; nothing without a position. Without an accelerometer it has no rows.
    pub(super) fn of(flight: &Prepared, gravity_m_s2: f64) -> Option<Self> {
        if !flight.has_position {
            return None;
        }
        let taps = Taps::new(flight.period_s);
        let mut rows = Rows::new(flight.period_s);
        rows.further = vec![Default::default(); 5];
        let mut comparison = Self { rows, sideways: Default::default(), gravity_m_s2 };
        for stretch in &flight.stretches {
            comparison.push(stretch, &taps, flight.period_s);
        }
        Some(comparison)
    }

    /// Appends the rows of a stretch.
    fn push(&mut self, stretch: &Stretch, taps: &Taps, period_s: f64) {
        let gravity_m_s2 = self.gravity_m_s2;
        let Some(imu) = &stretch.imu_m_s2 else { return };
        let count = stretch.time_s.len();
        let mut force: [Vec<f64>; 3] = Default::default();
        let mut levers: [[Vec<f64>; 3]; 3] = Default::default();
        for (k, dcm) in stretch.dcm.iter().enumerate() {
            let upright: Matrix3<f64> = dcm.transpose();
            push(&mut force, upright * vector(imu, k));
            levers.iter_mut().enumerate().for_each(|(axis, lever)| push(lever, upright.column(axis).into()));
        }
        self.rows.begin();
        let gravity = Vector3::new(0.0, 0.0, gravity_m_s2);
        let acceleration = |k: usize| taps.at(&taps.second, &stretch.position_ned_m, k);
        let margin = taps.half() + 1;
        for k in (margin..count.saturating_sub(margin)).step_by(Rows::stride(period_s)) {
            let dcm = &stretch.dcm[k];
            let sensed = dcm * taps.at(&taps.smooth, &force, k);
            let tracked = dcm * (acceleration(k) - gravity);
            self.rows.push(stretch.time_s[k], sensed.into(), tracked.into());
            let jerk = (acceleration(k + 1) - acceleration(k - 1)) / (2.0 * period_s);
            let late = [vector(&stretch.rate_rad_s, k).cross(&tracked), dcm * jerk];
            let levers = levers.iter().map(|lever| dcm * taps.at(&taps.second, lever, k));
            let further = self.rows.further.iter_mut().zip(levers.chain(late));
            further.for_each(|(column, value)| push(column, value));
            let along = |axis: usize| gravity_m_s2 * dcm.column(axis);
            self.sideways.iter_mut().enumerate().for_each(|(axis, column)| push(column, along(axis)));
        }
    }
}

/// Faults of the accelerometer, in sentences.
pub(super) fn check(Comparison { rows, .. }: &Comparison) -> Vec<String> {
    let tells = rows.tracked.each_ref().map(|axis| axis.len() > 1 && deviation(axis) > EXCITED_M_S2);
    let found = rows.sensor_either_way().map(|sensor| sensor.faults(&ACCELEROMETER, tells));
    found.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};

    use flights::{Column, Flight};
    use model::Vehicle;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::waving_with_imu;

    /// What is said of a waving flight of 40 s whose accelerometer makes of the true force what `told` says, with noise of tracker and
    /// accelerometer, tracked at a point that is a `lever` off.
    fn faults(
        told: impl Fn(f64, Vector3<f64>) -> Vector3<f64>,
        lever_m: Vector3<f64>,
        shake_m_s2: f64,
    ) -> Vec<String> {
        let noise = RefCell::new(rand_pcg::Pcg64::seed_from_u64(9));
        let draw = |size: f64| Vector3::from_fn(|_, _| size * (noise.borrow_mut().random::<f64>() - 0.5));
        let row = Cell::new(0.0);
        let offsets: RefCell<Vec<Vector3<f64>>> = RefCell::default();
        let mut flight = waving_with_imu(4000, |force, dcm| {
            row.set(row.get() + 0.01);
            offsets.borrow_mut().push(dcm.tr_mul(&lever_m));
            told(row.get(), force) + draw(shake_m_s2)
        });
        for (axis, column) in [Column::X, Column::Y, Column::Z].into_iter().enumerate() {
            let offsets = offsets.borrow();
            let shifted = flight.required(column).iter().zip(&*offsets);
            let shifted = shifted.map(|(value, offset)| value + offset[axis] + draw(0.001).x).collect();
            flight.replace(column, shifted);
        }
        of(&flight)
    }

    fn of(flight: &Flight) -> Vec<String> {
        check(&Comparison::of(&Prepared::new(flight, &Vehicle::thesis()).unwrap(), 9.81).unwrap())
    }

    const LEVER_M: Vector3<f64> = Vector3::new(0.03, -0.02, 0.05);

    #[test]
    fn an_accelerometer_without_faults_has_none_wherever_it_sits_and_however_it_shakes() {
        assert_eq!(faults(|_, force| force, Vector3::zeros(), 0.2), [""; 0]);
        assert_eq!(faults(|_, force| force, LEVER_M, 0.2), [""; 0]);
        assert_eq!(faults(|_, force| force, LEVER_M, 12.0), [""; 0]);
        let biased = |_, force: Vector3<f64>| force + Vector3::new(0.2, -0.3, 0.4);
        assert_eq!(faults(biased, LEVER_M, 0.2), [""; 0]);
        let turned = nalgebra::Rotation3::from_euler_angles(0.03, -0.02, 0.04);
        assert_eq!(faults(|_, force| turned * force, LEVER_M, 0.2), [""; 0]);
    }

    /// By two milliseconds, as clocks may leave it.
    #[test]
    fn an_attitude_that_is_a_little_late_is_no_fault_of_scale() {
        let mut flight = waving_with_imu(4000, |force, _| force);
        for column in [Column::Phi, Column::Theta, Column::Psi] {
            let values = flight.required(column);
            let at = |k: usize| values[k] - 0.2 * (values[k] - values[k.saturating_sub(1)]);
            let late = (0..values.len()).map(at).collect();
            flight.replace(column, late);
        }
        assert_eq!(of(&flight), [""; 0]);
    }

    #[test]
    fn scale_cross_axis_and_drift_are_named_with_their_sizes() {
        let scaled = faults(|_, force| force.component_mul(&Vector3::new(1.0, 1.0, 1.06)), LEVER_M, 0.2);
        assert_eq!(scaled.len(), 1, "{scaled:?}");
        let percent: f64 = scaled[0].split_whitespace().nth(4).unwrap().parse().unwrap();
        assert!(
            scaled[0].starts_with("the accelerometer's az is ") && (percent - 6.0).abs() < 0.5,
            "{scaled:?}"
        );
        assert!(scaled[0].contains("larger than") && scaled[0].contains("scale = 0.94"), "{scaled:?}");
        let crossed = |_, f: Vector3<f64>| Vector3::new(f.x + 0.05 * f.y, f.y + 0.05 * f.x, f.z);
        let crossed = faults(crossed, LEVER_M, 0.2);
        assert_eq!(crossed.len(), 1, "{crossed:?}");
        assert!(
            crossed[0].starts_with("the accelerometer's ax and ay are not at right angles"),
            "{crossed:?}"
        );
        let drifting = faults(|t, force| force + Vector3::new(0.01 * t, 0.0, 0.0), LEVER_M, 0.2);
        assert_eq!(drifting.len(), 1, "{drifting:?}");
        assert!(drifting[0].starts_with("the bias of the accelerometer's ax drifts by 0.6"), "{drifting:?}");
    }
}
