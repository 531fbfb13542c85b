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
    subtract_accelerometer_bias(stretches, bias);
    bias
}

/// Takes a bias along x and y out of the accelerometer.
pub(crate) fn subtract_accelerometer_bias(stretches: &mut [Stretch], bias_m_s2: [f64; 2]) {
    for stretch in stretches {
        for (signal, b) in stretch.imu_m_s2.iter_mut().flatten().zip(bias_m_s2) {
            signal.iter_mut().for_each(|value| *value -= b);
        }
    }
}

/// What the gyro tells of a craft that stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandingGyro {
    /// Mean rates, rad/s.
    pub mean_rad_s: [f64; 3],
    /// Standard errors of them, rad/s.
    pub std_error_rad_s: [f64; 3],
}

/// Differences in a second, which count as one: the noise of an attitude lasts.
const PER_SECOND: usize = 10;
/// Biases of a standing and of a flying craft further apart than so many standard errors are two: vibration, or a gyro that
/// warms up.
const ONE_BIAS: f64 = 4.0;

/// Takes out the mean difference between the gyro and the rates of the smoothed attitude over the whole flight, and what a
/// standing craft's gyro tells: the two by their standard errors.
pub(crate) fn remove_gyro_bias(
    stretches: &mut [Stretch],
    filter: &RegressionFilter,
    standing: Option<StandingGyro>,
    notes: &mut Vec<String>,
) -> [f64; 3] {
    let differences = gyro_differences(stretches, filter);
    let mut bias = Vector3::zeros();
    if !differences.is_empty() {
        bias = differences.iter().sum::<Vector3<f64>>() / differences.len() as f64;
    }
    if let Some(standing) = standing {
        bias = with_standing(bias, &differences, &standing, notes);
    }
    for stretch in stretches {
        for (rate, b) in stretch.rate_rad_s.iter_mut().zip(bias.iter()) {
            rate.iter_mut().for_each(|r| *r -= b);
        }
    }
    bias.into()
}

/// The bias of a flying craft with that of the standing one: their mean by their standard errors, where they are one.
fn with_standing(
    flying: Vector3<f64>,
    differences: &[Vector3<f64>],
    standing: &StandingGyro,
    notes: &mut Vec<String>,
) -> Vector3<f64> {
    let seconds: Vec<Vector3<f64>> = differences
        .chunks_exact(PER_SECOND)
        .map(|second| second.iter().sum::<Vector3<f64>>() / PER_SECOND as f64)
        .collect();
    if seconds.len() < 2 {
        return flying;
    }
    let count = seconds.len() as f64;
    let mean = seconds.iter().sum::<Vector3<f64>>() / count;
    let squares: Vector3<f64> = seconds.iter().map(|s| (s - mean).component_mul(&(s - mean))).sum();
    let of_flying = squares / (count * (count - 1.0));
    let (stood, of_stood) = (
        Vector3::from(standing.mean_rad_s),
        Vector3::from(standing.std_error_rad_s).map(|error| (error * error).max(f64::MIN_POSITIVE)),
    );
    let is_one = |i: usize| (flying[i] - stood[i]).powi(2) < ONE_BIAS.powi(2) * (of_flying[i] + of_stood[i]);
    if !(0..3).all(is_one) {
        notes.push("gyro bias differs between standing and flying: that of the flight is taken".into());
        return flying;
    }
    notes.push("gyro bias from standing still as well".into());
    let both =
        |i: usize, _| (flying[i] * of_stood[i] + stood[i] * of_flying[i]) / (of_stood[i] + of_flying[i]);
    Vector3::from_fn(both)
}

/// Differences between the gyro and the rates of the smoothed attitude, ten a second at 100 Hz: a mean needs no more.
fn gyro_differences(stretches: &[Stretch], filter: &RegressionFilter) -> Vec<Vector3<f64>> {
    let half = filter.half();
    let slope_of_smoothed = compose(&filter.smooth, &filter.derivative);
    let mut differences = Vec::new();
    for stretch in stretches {
        let at = |k: usize, taps: &[f64]| {
            let start = k - taps.len() / 2;
            Vector3::from(stretch.euler_rad.each_ref().map(|angle| sum_of_products(&angle[start..], taps)))
        };
        for k in (2 * half..stretch.time_s.len() - 2 * half).step_by(10) {
            let rates = frames::body_rates_from_euler(at(k, &filter.smooth), at(k, &slope_of_smoothed));
            let difference = vector(&stretch.rate_rad_s, k) - rates;
            if difference.iter().all(|d| d.is_finite()) {
                differences.push(difference);
            }
        }
    }
    differences
}

#[cfg(test)]
mod tests {
    use flights::Column;
    use model::Vehicle;

    use super::*;
    use crate::Prepared;
    use crate::testing::{Row, flight, prepared};

    const GYRO_BIAS_RAD_S: [f64; 3] = [0.02, -0.03, 0.05];

    /// Turns slowly about all axes; the gyro sees it with a bias.
    fn turning(t: f64, row: &mut Row) {
        let euler = Vector3::new(0.2 * t.sin(), 0.1 * (1.3 * t).cos(), 0.4 * t);
        let slope = Vector3::new(0.2 * t.cos(), -0.13 * (1.3 * t).sin(), 0.4);
        let rate = frames::body_rates_from_euler(euler, slope) + Vector3::from(GYRO_BIAS_RAD_S);
        (row.euler_rad, row.rate_rad_s) = (euler.into(), rate.into());
    }

    #[test]
    fn the_bias_of_a_turning_gyro_is_found_and_taken_out() {
        let prepared = prepared(1000, turning);
        for (found, bias) in prepared.gyro_bias_rad_s.iter().zip(GYRO_BIAS_RAD_S) {
            // The filter is exact for quartics; these sines are all but that within its window.
            assert!((found - bias).abs() < 1e-6, "{found} {bias}");
        }
        let stretch = &prepared.stretches[0];
        let mut row = Row::hover(0.0);
        turning(stretch.time_s[0], &mut row);
        for (i, rate) in stretch.rate_rad_s.iter().enumerate() {
            assert!((rate[0] - (row.rate_rad_s[i] - GYRO_BIAS_RAD_S[i])).abs() < 1e-6);
        }
    }

    #[test]
    fn a_gyro_without_a_value_has_no_bias() {
        let mut stretches = prepared(300, |_, _| {}).stretches;
        stretches[0].rate_rad_s[1].fill(f64::NAN);
        let filter = RegressionFilter::new(0.01);
        assert_eq!(remove_gyro_bias(&mut stretches, &filter, None, &mut Vec::new()), [0.0; 3]);
        assert!(stretches[0].rate_rad_s[0].iter().all(|r| *r == 0.0));
    }

    /// Half of the flight's own bias is wrong where a standing craft's is ten times surer.
    #[test]
    fn a_standing_crafts_bias_counts_by_its_error_and_not_where_it_is_another() {
        let seconds = [0.01, 0.03, 0.02, 0.02, 0.015, 0.025];
        let differences: Vec<Vector3<f64>> =
            seconds.iter().flat_map(|d| vec![Vector3::new(*d, 0.0, -*d); PER_SECOND]).collect();
        let flying = Vector3::new(0.02, 0.0, -0.02);
        // Standard error of the mean of the six seconds.
        let error = (2.5e-4_f64 / 30.0).sqrt();
        let standing = |x: f64, error: f64| StandingGyro {
            mean_rad_s: [x, 0.0, -0.02],
            std_error_rad_s: [error, error, error],
        };
        let mut notes = Vec::new();
        let equal = with_standing(flying, &differences, &standing(0.022, error), &mut notes);
        assert!((equal.x - 0.021).abs() < 1e-12 && (equal.z + 0.02).abs() < 1e-12, "{equal:?}");
        let sure = with_standing(flying, &differences, &standing(0.022, 0.1 * error), &mut notes);
        assert!((sure.x - (0.022 - 0.002 / 101.0)).abs() < 1e-12, "{sure:?}");
        let another = with_standing(flying, &differences, &standing(0.08, error), &mut notes);
        assert_eq!(another, flying);
        assert_eq!(notes[1], "gyro bias from standing still as well");
        assert_eq!(notes[2], "gyro bias differs between standing and flying: that of the flight is taken");
    }

    /// Falls under a drag of 0.5 m/s^2 forwards while the nose points down by 0.1 rad.
    fn accelerometer_flight(logs_velocity: bool, bias: [f64; 3]) -> Prepared {
        let dcm = frames::dcm_from_euler(Vector3::new(0.0, -0.1, 0.0));
        let acceleration = Vector3::new(-0.5, 0.0, 1.0);
        let force = dcm * (acceleration - Vector3::new(0.0, 0.0, 9.81));
        let mut flight = flight(500, |t, row| {
            row.position_ned_m = (0.5 * t * t * acceleration).into();
            row.euler_rad = [0.0, -0.1, 0.0];
        });
        let t: Vec<f64> = flight.required(Column::T).to_vec();
        for (i, column) in [Column::Ax, Column::Ay, Column::Az].into_iter().enumerate() {
            flight.replace(column, vec![force[i] + bias[i]; t.len()]);
        }
        if logs_velocity {
            for (i, column) in [Column::Vx, Column::Vy, Column::Vz].into_iter().enumerate() {
                flight.replace(column, t.iter().map(|t| acceleration[i] * t).collect());
            }
        }
        Prepared::new(&flight, &Vehicle::thesis()).unwrap()
    }

    #[test]
    fn an_accelerometers_bias_is_found_to_the_sides_and_left_along_the_thrust() {
        let with = accelerometer_flight(true, [0.3, -0.2, 0.4]);
        let without = accelerometer_flight(true, [0.0; 3]);
        let [x, y] = with.accelerometer_bias_m_s2;
        assert!((x - 0.3).abs() < 1e-9 && (y + 0.2).abs() < 1e-9, "{x} {y}");
        // The drag moves craft and accelerometer alike: it is no bias.
        assert!(without.accelerometer_bias_m_s2.iter().all(|b| b.abs() < 1e-9));
        let imu = |prepared: &Prepared| -> Vec<f64> {
            prepared.stretches[0].imu_m_s2.as_ref().unwrap().iter().map(|axis| axis[100]).collect()
        };
        let left: Vec<f64> = imu(&with).iter().zip(imu(&without)).map(|(a, b)| a - b).collect();
        assert!(left[0].abs() < 1e-9 && left[1].abs() < 1e-9 && (left[2] - 0.4).abs() < 1e-9, "{left:?}");
    }

    #[test]
    fn raw_tracking_leaves_the_accelerometer_as_it_is() {
        let prepared = accelerometer_flight(false, [0.3, -0.2, 0.4]);
        assert_eq!(prepared.accelerometer_bias_m_s2, [0.0; 2]);
    }
}
