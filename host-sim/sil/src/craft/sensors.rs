//! What the sensors see of the craft: motion capture, gyro, voltmeter.
//!
//! Motion capture gives the tracked point (vehicle file and `tracking-offset`) and the tracked
//! attitude (tilted by `attitude-offset`); both come from the model's [`Adjustments`], which
//! identification uses too. The delay is not here: a flight file holds poses at the time they were
//! taken.

use control::Measurement;
use model::{Adjustments, Model, State, frames};
use nalgebra::{Matrix3, Vector3};

use super::noise::{NoiseModel, NoiseSample, NoiseSource};

/// The sensors of one craft in one flight.
#[derive(Debug, Clone)]
pub struct Sensors {
    /// From the centre of mass, body FRD, m; none if they are the same.
    tracked_point_m: Option<Vector3<f64>>,
    /// Present if the tracked attitude is not the body's.
    tilt: Option<Adjustments>,
    noise: Option<NoiseSource>,
}

impl Sensors {
    /// The sensors of `model`, ideal without `noise`.
    pub fn new(model: &Model, noise: Option<NoiseModel>, period_s: f64, seed: u64) -> Self {
        let adjust = model.adjustments();
        let point = Vector3::from(model.vehicle.tracked_point) + adjust.tracked_point_m();
        Self {
            tracked_point_m: (point != Vector3::zeros()).then_some(point),
            tilt: adjust.tilt().is_some().then_some(adjust),
            noise: noise.map(|model| NoiseSource::new(model, period_s, seed)),
        }
    }

    /// What the sensors measure of a state, now.
    // Where it is used part by part it need not be copied as a whole.
    #[inline(always)]
    pub fn sense(&mut self, state: &State, battery_v: f64) -> Measurement {
        let body = frames::dcm_from_quaternion(&state.attitude);
        let mut position_m = state.position_ned_m;
        if let Some(point) = &self.tracked_point_m {
            position_m += body.tr_mul(point);
        }
        let mut seen = Measurement {
            position_m: single(&position_m),
            attitude_rad: match &self.tilt {
                None => euler_rad(&body),
                Some(adjust) => euler_rad(&adjust.measured_dcm(&body)),
            },
            gyro_rad_s: Some(single(&state.rate_rad_s)),
            battery_v: battery_v as f32,
        };
        if let Some(source) = &mut self.noise {
            disturb(&mut seen, source.sample());
        }
        seen
    }
}

#[inline]
fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Phi, theta, psi of a tracked attitude (inertial to body), in the single precision that is
/// measured in. From `libm`: the same bits on every host.
#[inline]
fn euler_rad(dcm: &Matrix3<f64>) -> [f32; 3] {
    let at = |row, column| dcm[(row, column)] as f32;
    [
        libm::atan2f(at(1, 2), at(2, 2)),
        -libm::asinf(at(0, 2).clamp(-1.0, 1.0)),
        libm::atan2f(at(0, 1), at(0, 0)),
    ]
}

#[inline(always)]
fn disturb(seen: &mut Measurement, noise: &NoiseSample) {
    let add = |values: &mut [f32; 3], noise: &[f64; 3]| {
        values.iter_mut().zip(noise).for_each(|(value, noise)| *value += *noise as f32);
    };
    add(&mut seen.position_m, &noise.position_m);
    add(&mut seen.attitude_rad, &noise.attitude_rad);
    if let Some(rates) = &mut seen.gyro_rad_s {
        add(rates, &noise.gyro_rad_s);
    }
    seen.battery_v += noise.battery_v as f32;
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::Effect;

    fn tilted_state() -> State {
        let mut state = State::at_rest(Vector3::new(1.0, 2.0, -1.0), [600.0; 4]);
        state.attitude = frames::quaternion_from_euler(Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        state.rate_rad_s = Vector3::new(0.1, 0.2, 0.3);
        state
    }

    #[test]
    fn ideal_sensors_see_the_state() {
        let seen = Sensors::new(&Model::thesis(), None, 0.01, 0).sense(&tilted_state(), 11.1);
        assert_eq!(seen.position_m, [1.0, 2.0, -1.0]);
        assert_eq!(seen.gyro_rad_s, Some([0.1, 0.2, 0.3]));
        assert_eq!(seen.battery_v, 11.1);
        assert!((seen.attitude_rad[2] - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    }

    #[test]
    fn tracked_angles_are_those_of_the_attitude() {
        let mut sensors = Sensors::new(&Model::thesis(), None, 0.01, 0);
        for k in 0..200 {
            let k = f64::from(k);
            let euler = Vector3::new(3.1 * (0.7 * k).sin(), 1.5 * (1.3 * k).sin(), 3.1 * (2.1 * k).cos());
            let mut state = tilted_state();
            state.attitude = frames::quaternion_from_euler(euler);
            let seen = sensors.sense(&state, 11.1).attitude_rad;
            // Single precision, made worse by the steep arcsine near 90 degrees of pitch.
            let tolerance = 4e-7 / euler.y.cos();
            for (got, expected) in seen.iter().zip(euler.iter()) {
                assert!((f64::from(*got) - expected).abs() < tolerance, "{seen:?} {euler}");
            }
        }
    }

    #[test]
    fn a_tracked_point_ahead_of_the_centre_lies_east_of_a_craft_that_heads_east() {
        let mut model = Model::thesis();
        model.vehicle.tracked_point = [0.02, 0.0, 0.0];
        model.set(Effect::TrackingOffset, &[0.03, 0.0, 0.01]);
        let seen = Sensors::new(&model, None, 0.01, 0).sense(&tilted_state(), 11.1);
        for (got, expected) in seen.position_m.iter().zip([1.0, 2.05, -0.99]) {
            assert!((got - expected).abs() < 1e-6, "{:?}", seen.position_m);
        }
    }

    #[test]
    fn a_tilted_tracker_reports_its_tilt_in_level_hover() {
        let mut model = Model::thesis();
        model.set(Effect::AttitudeOffset, &[0.02, 0.0]);
        let level = State::at_rest(Vector3::new(0.0, 0.0, -1.0), [600.0; 4]);
        let seen = Sensors::new(&model, None, 0.01, 0).sense(&level, 11.1);
        assert!((seen.attitude_rad[0] - 0.02).abs() < 1e-6 && seen.attitude_rad[1].abs() < 1e-6, "{seen:?}");
    }

    #[test]
    fn noise_is_added_to_everything_and_is_the_seeds() {
        let sense = |seed| {
            Sensors::new(&Model::thesis(), Some(NoiseModel::default()), 0.01, seed)
                .sense(&tilted_state(), 11.1)
        };
        let (ideal, noisy) =
            (Sensors::new(&Model::thesis(), None, 0.01, 0).sense(&tilted_state(), 11.1), sense(3));
        assert_eq!(noisy, sense(3));
        assert_ne!(noisy, sense(4));
        for k in 0..3 {
            let error = f64::from(noisy.position_m[k] - ideal.position_m[k]).abs();
            assert!(error > 0.0 && error < 5.0 * 3e-4, "{error}");
        }
        assert!(noisy.battery_v != ideal.battery_v && noisy.gyro_rad_s != ideal.gyro_rad_s);
    }
}
