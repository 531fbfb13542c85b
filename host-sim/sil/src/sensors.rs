//! What the sensors see of the craft: motion capture, gyro, voltmeter.
//!
//! Motion capture gives the tracked point (vehicle file and `tracking-offset`) and the tracked attitude (tilted by
//! `attitude-offset`); both come from the model's [`Adjustments`], the same that identification uses. The delay is not
//! here: a flight file holds poses at the time they were taken.

use control::Measurement;
use model::{Adjustments, Model, State, frames};
use nalgebra::Vector3;

use crate::noise::{NoiseModel, NoiseSource};

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
        let point = Vector3::from(model.vehicle.tracked_point) + adjust.tracked_point_m;
        Self {
            tracked_point_m: (point != Vector3::zeros()).then_some(point),
            tilt: (adjust.attitude_tilt_rad != [0.0; 2]).then_some(adjust),
            noise: noise.map(|model| NoiseSource::new(model, period_s, seed)),
        }
    }

    /// What the sensors say of a state, now.
    #[inline]
    pub fn sense(&mut self, state: &State, battery_v: f64) -> Measurement {
        let mut position_m = state.position_ned_m;
        let mut attitude_rad = match &self.tilt {
            None => state.euler_rad(),
            Some(adjust) => {
                frames::euler_from_dcm(&adjust.measured_dcm(&frames::dcm_from_quaternion(&state.attitude)))
            }
        };
        if let Some(point) = self.tracked_point_m {
            position_m += frames::dcm_from_quaternion(&state.attitude).tr_mul(&point);
        }
        let (mut gyro_rad_s, mut battery_v) = (state.rate_rad_s, battery_v);
        if let Some(source) = &mut self.noise {
            let noise = source.sample();
            position_m += Vector3::from(noise.position_m);
            attitude_rad += Vector3::from(noise.attitude_rad);
            gyro_rad_s += Vector3::from(noise.gyro_rad_s);
            battery_v += noise.battery_v;
        }
        Measurement {
            position_m: single(&position_m),
            attitude_rad: single(&attitude_rad),
            gyro_rad_s: Some(single(&gyro_rad_s)),
            battery_v: battery_v as f32,
        }
    }
}

#[inline]
fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
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
