//! Biases of the gyro and the accelerometer, found against the tracked motion and taken out.

use model::frames;
use nalgebra::Vector3;

use crate::filter::{RegressionFilter, compose, sum_of_products};
use crate::prepare::stretch::{Stretch, vector};

/// Takes out the mean difference between the accelerometer and the accelerations of the tracked motion over the whole
/// flight, along x and y: there a bias stands for a drag, a wind or a cable that is not there. Forces move the craft and
/// the accelerometer alike, so none of them is taken out with it. Along z the scale of the thrust hides it. Only for logs
/// of an estimator, which levels its attitude by the motion: of raw tracking the same difference is the tilt of the
/// tracked frame.
pub(crate) fn remove_accelerometer_bias(
    stretches: &mut [Stretch],
    filter: &RegressionFilter,
    gravity_m_s2: f64,
) -> [f64; 2] {
    let half = 2 * filter.half();
    let gravity = Vector3::new(0.0, 0.0, gravity_m_s2);
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for stretch in stretches.iter() {
        let Some(imu) = &stretch.imu_m_s2 else { continue };
        let at = |signal: &[Vec<f64>; 3], k: usize, taps: &[f64]| {
            Vector3::from(signal.each_ref().map(|s| sum_of_products(&s[k - taps.len() / 2..], taps)))
        };
        for k in (half..stretch.time_s.len() - half).step_by(10) {
            let moved = at(&stretch.velocity_ned_m_s, k, &filter.derivative) - gravity;
            let difference = at(imu, k, &filter.smooth) - stretch.dcm[k] * moved;
            if difference.iter().all(|d| d.is_finite()) {
                sum += difference;
                count += 1.0;
            }
        }
    }
    let bias = if count > 0.0 { [sum.x / count, sum.y / count] } else { [0.0; 2] };
    for stretch in stretches {
        for (signal, b) in stretch.imu_m_s2.iter_mut().flatten().zip(bias) {
            signal.iter_mut().for_each(|value| *value -= b);
        }
    }
    bias
}

/// Takes out the mean difference between the gyro and the rates of the smoothed attitude over the whole flight.
pub(crate) fn remove_gyro_bias(stretches: &mut [Stretch], filter: &RegressionFilter) -> [f64; 3] {
    let half = filter.half();
    let slope_of_smoothed = compose(&filter.smooth, &filter.derivative);
    let mut sum = Vector3::zeros();
    let mut count = 0.0;
    for stretch in stretches.iter() {
        let at = |k: usize, taps: &[f64]| {
            let start = k - taps.len() / 2;
            Vector3::from(stretch.euler_rad.each_ref().map(|angle| sum_of_products(&angle[start..], taps)))
        };
        // A mean needs no more than ten values a second.
        for k in (2 * half..stretch.time_s.len() - 2 * half).step_by(10) {
            let rates = frames::body_rates_from_euler(at(k, &filter.smooth), at(k, &slope_of_smoothed));
            let difference = vector(&stretch.rate_rad_s, k) - rates;
            if difference.iter().all(|d| d.is_finite()) {
                sum += difference;
                count += 1.0;
            }
        }
    }
    let bias = if count > 0.0 { sum / count } else { Vector3::zeros() };
    for stretch in stretches {
        for (rate, b) in stretch.rate_rad_s.iter_mut().zip(bias.iter()) {
            rate.iter_mut().for_each(|r| *r -= b);
        }
    }
    bias.into()
}
