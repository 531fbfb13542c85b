//! Open-loop predictions from logged states over half a second, less the log.

use model::{Plant, State};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

use crate::fit::open_loop::{LONGEST_HORIZON, Track, velocity_ned_m_s};
use crate::prepare::Stretch;

/// Horizons that enter the loss are multiples of this, samples.
const HORIZON_STEP: usize = 5;
/// Position, velocity, attitude and rate of one horizon.
const PER_HORIZON: usize = 12;
pub(super) const HORIZONS: usize = LONGEST_HORIZON / HORIZON_STEP;
pub(super) const PER_START: usize = PER_HORIZON * HORIZONS;

/// A stretch with what rollouts need.
pub(super) struct Run<'a> {
    pub(super) flight: usize,
    pub(super) states: Vec<State>,
    pub(super) rotor_mean_rad_s: Vec<[f64; 4]>,
    pub(super) velocities: Vec<Vector3<f64>>,
    pub(super) stretch: &'a Stretch,
    pub(super) period_s: f64,
    pub(super) starts: Vec<usize>,
    /// Starts in one block of the covariance.
    pub(super) block: usize,
}

impl Run<'_> {
    /// Predicted less logged states: for each start and horizon position, velocity, attitude, rate.
    pub(super) fn errors(&self, plant: &Plant, trim: &[f64; 6]) -> Vec<f64> {
        let track = Track {
            states: &self.states,
            rotor_mean_rad_s: &self.rotor_mean_rad_s,
            stretch: self.stretch,
            period_s: self.period_s,
            turns: true,
        };
        let mut errors = Vec::with_capacity(self.starts.len() * PER_START);
        for &start in &self.starts {
            track.roll_out(plant, trim, start, LONGEST_HORIZON, |h, state| {
                if h % HORIZON_STEP != 0 {
                    return;
                }
                let logged = &self.states[start + h];
                let velocity = velocity_ned_m_s(state) - self.velocities[start + h];
                let parts = [
                    state.position_ned_m - logged.position_ned_m,
                    velocity,
                    turn_between(&logged.attitude, &state.attitude),
                    state.rate_rad_s - logged.rate_rad_s,
                ];
                errors.extend(parts.iter().flat_map(|part| part.iter().copied()));
            });
        }
        errors
    }
}

/// Rotation vector from one attitude (w, x, y, z) to another, rad.
fn turn_between(from: &Vector4<f64>, to: &Vector4<f64>) -> Vector3<f64> {
    let unit = |q: &Vector4<f64>| UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    (unit(from).inverse() * unit(to)).scaled_axis()
}

pub(super) fn norm(part: &[f64]) -> f64 {
    part.iter().map(|e| e * e).sum::<f64>().sqrt()
}

pub(super) fn slopes(base: &[f64], mut moved: Vec<f64>, step: f64) -> Vec<f64> {
    moved.iter_mut().zip(base).for_each(|(m, b)| *m = (*m - b) / step);
    moved
}

#[cfg(test)]
mod tests {
    use model::frames;

    use super::*;

    #[test]
    fn the_turn_between_attitudes_is_the_angle_about_their_common_axis() {
        let yaw = |angle: f64| frames::quaternion_from_euler(Vector3::new(0.0, 0.0, angle));
        let turn = turn_between(&yaw(0.3), &yaw(1.0));
        assert!((turn - Vector3::new(0.0, 0.0, 0.7)).norm() < 1e-12, "{turn}");
    }

    /// q and -q are one attitude: no turn, not a whole one.
    #[test]
    fn the_sign_of_a_quaternion_is_no_turn() {
        let q = frames::quaternion_from_euler(Vector3::new(0.2, -0.4, 2.9));
        assert!(turn_between(&q, &-q).norm() < 1e-7);
    }

    #[test]
    fn slopes_of_what_is_linear_are_its_factors() {
        assert_eq!(slopes(&[1.0, 2.0], vec![1.5, 1.0], 0.25), [2.0, -4.0]);
    }
}
