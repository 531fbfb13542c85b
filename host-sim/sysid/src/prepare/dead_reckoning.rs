//! The velocity of a craft whose position is not logged, carried on by its accelerometer.
//!
//! The specific force, turned by the attitude, and gravity make the acceleration over the ground; its integral is the velocity, but for
//! where it began and for what biases and a tilt that is a little off add up to. So it is forgotten within seconds: good for how fast the
//! craft flies to and fro, not for how fast on the whole. A filter of first order leaves out slow parts that are uncorrelated with what it lets
//! pass (the real part of 1/(1 + jx) is the square of its absolute value), so that a drag which is fitted to it has no bias by them.

use nalgebra::Vector3;

use crate::prepare::stretch::{Stretch, vector};

/// Time within which a velocity is forgotten, s: craft of a kilogram slow down within 2 to 4 s.
const FORGOTTEN_S: f64 = 5.0;
/// Shortest stretch whose mean acceleration is the sensors' bias rather than the craft's, s.
const UNBIASED_S: f64 = 10.0;

/// Gives stretches with an accelerometer the velocity that it tells, over the ground and, unless the height was logged, down.
pub(crate) fn carry_velocity(stretches: &mut [Stretch], has_height: bool, gravity_m_s2: f64, period_s: f64) {
    let gravity = Vector3::new(0.0, 0.0, gravity_m_s2);
    for stretch in stretches {
        let Some(force) = &stretch.imu_m_s2 else { continue };
        let count = stretch.time_s.len();
        let acceleration: Vec<Vector3<f64>> =
            (0..count).map(|k| stretch.dcm[k].tr_mul(&vector(force, k)) + gravity).collect();
        for axis in 0..if has_height { 2 } else { 3 } {
            stretch.velocity_ned_m_s[axis] = carried(acceleration.iter().map(|a| a[axis]), period_s);
        }
    }
}

/// The integral of an acceleration without its mean, forgotten.
fn carried(acceleration: impl ExactSizeIterator<Item = f64> + Clone, period_s: f64) -> Vec<f64> {
    let count = acceleration.len() as f64;
    let is_long = count * period_s >= UNBIASED_S;
    let mean = if is_long { acceleration.clone().sum::<f64>() / count } else { 0.0 };
    let keep = (-period_s / FORGOTTEN_S).exp();
    let (mut velocity, mut before) = (0.0, None);
    acceleration
        .map(|now| {
            let now = now - mean;
            velocity = keep * velocity + 0.5 * period_s * (now + before.unwrap_or(now));
            before = Some(now);
            velocity
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.01;

    /// To and fro at a frequency far above the forgetting: the amplitude over the frequency, a quarter of a period later. A bias is
    /// nothing.
    #[test]
    fn an_oscillation_keeps_its_velocity_and_a_bias_gives_none() {
        let rate_rad_s = std::f64::consts::TAU;
        let wave: Vec<f64> = (0..3000).map(|k| 0.3 + (rate_rad_s * STEP_S * f64::from(k)).cos()).collect();
        let velocity = carried(wave.iter().copied(), STEP_S);
        for (k, v) in velocity.iter().enumerate().skip(2500) {
            let expected = (rate_rad_s * STEP_S * k as f64).sin() / rate_rad_s;
            assert!((v - expected).abs() < 0.01, "{k}: {v} for {expected}");
        }
    }

    /// The step response of a leaky integrator: T (1 - exp(-t/T)).
    #[test]
    fn what_lasts_is_forgotten() {
        let velocity = carried(std::iter::repeat_n(1.0, 800), STEP_S);
        for (k, v) in velocity.iter().enumerate().skip(10) {
            let t = STEP_S * k as f64;
            assert!((v - FORGOTTEN_S * (1.0 - (-t / FORGOTTEN_S).exp())).abs() < 0.02, "{k}");
        }
    }
}
