//! Does the gyro measure what the tracked attitude does: to scale, at right angles, with a steady bias?
//!
//! ```text
//! rate of the attitude = N gyro + bias + drift t
//! ```
//!
//! Both sides go through filters of equal response (`tracks.rs`), once the clocks agree. The gyro is the regressor: its noise
//! is small beside that of a differentiated attitude, so that the factors are hardly too small. A tracked frame that is turned against the
//! gyro shows as a rotation, the part of N that changes its sign with its indices: that is no fault of the gyro and is left to
//! `attitude-offset`.

use nalgebra::Matrix3;
use report::number::{fixed, with_error};

use crate::checks::tracks::{self, Pair};
use crate::fit::least_squares::{self, FlightRows, RowColumn};
use crate::prepare::Prepared;

/// Time between the rows of the regression, s.
const ROW_PERIOD_S: f64 = 0.03;
/// Scales and cross axes that matter.
const MATTERS: f64 = 0.02;
/// Change of a bias over a flight that matters, rad/s.
const MATTERS_RAD_S: f64 = 0.02;
/// Standard errors that a fault stands out by.
const SIGNIFICANT: f64 = 5.0;
/// Rows of a regression at least: some seconds.
const FEWEST_ROWS: usize = 300;
const NAMES: [&str; 3] = ["p", "q", "r"];
/// Factors, biases and drifts.
const UNKNOWNS: usize = 15;

/// Faults of the gyro, in sentences.
pub fn check(flight: &Prepared) -> Vec<String> {
    let pairs = tracks::rates(flight, |k, stretch| stretch.dcm[k]);
    let (rows, length_s) = rows(&pairs, flight.period_s);
    if rows.rows() < FEWEST_ROWS {
        return Vec::new();
    }
    let Ok(solution) = least_squares::solve(&[rows], &[None; UNKNOWNS]) else { return Vec::new() };
    let of = |k: usize| (solution.value[k], solution.covariance[(k, k)].max(0.0).sqrt());
    let Some(gyro) = Matrix3::from_fn(|i, j| of(3 * i + j).0).try_inverse() else { return Vec::new() };
    let error = |i: usize, j: usize| of(3 * i + j).1;
    let mut found = Vec::new();
    for i in 0..3 {
        let (more, error) = (gyro[(i, i)] - 1.0, error(i, i));
        if more.abs() > MATTERS.max(SIGNIFICANT * error) {
            found.push(scale_sentence(NAMES[i], more, error));
        }
    }
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let (shared, error) = (0.5 * (gyro[(i, j)] + gyro[(j, i)]), 0.5 * error(i, j).hypot(error(j, i)));
        if shared.abs() > MATTERS.max(SIGNIFICANT * error) {
            found.push(format!(
                "the gyro's {} and {} are not at right angles: each measures {} of the other",
                NAMES[i],
                NAMES[j],
                with_error(100.0 * shared, 100.0 * error, "%")
            ));
        }
    }
    for (i, name) in NAMES.iter().enumerate() {
        // What the gyro gains is taken out of the attitude's rate.
        let (slope, error) = of(UNKNOWNS - 3 + i);
        if (slope * length_s).abs() > MATTERS_RAD_S.max(SIGNIFICANT * error * length_s) {
            let drift = with_error(-60.0 * slope, 60.0 * error, "rad/s");
            found.push(format!("the bias of the gyro's {name} drifts by {drift} in a minute"));
        }
    }
    found
}

fn scale_sentence(name: &str, more: f64, error: f64) -> String {
    let than = if more > 0.0 { "larger" } else { "smaller" };
    let by = with_error(100.0 * more.abs(), 100.0 * error, "%");
    let scale = fixed(1.0 / (1.0 + more), 3);
    format!(
        "the gyro's {name} is {by} {than} than the rate of the tracked attitude: if the tracker is right, write {name} = {{ column = \
         \"{name}\", scale = {scale} }} under [columns] in columns.toml"
    )
}

/// The regression, and the time from its first row to its last, s.
fn rows(pairs: &[Pair], period_s: f64) -> (FlightRows, f64) {
    let stride = ((ROW_PERIOD_S / period_s).round() as usize).max(1);
    let (middle_s, _) = tracks::span(pairs, period_s);
    let mut targets: [Vec<f64>; 6] = Default::default();
    let mut gyro: [Vec<f64>; 3] = Default::default();
    let (mut times, mut starts) = (Vec::new(), Vec::new());
    for pair in pairs {
        starts.push(times.len());
        for k in (0..pair.len()).step_by(stride) {
            times.push(pair.start_s + k as f64 * period_s - middle_s);
            for axis in 0..3 {
                targets[3 + axis].push(pair.tracked[axis][k]);
                gyro[axis].push(pair.onboard[axis][k]);
            }
        }
    }
    starts.dedup();
    targets[..3].iter_mut().for_each(|target| *target = vec![0.0; times.len()]);
    let on = |axis: usize, values: &Vec<f64>| {
        let mut column = RowColumn::default();
        column[3 + axis] = Some(values.clone());
        column
    };
    let ones = vec![1.0; times.len()];
    let mut columns = Vec::with_capacity(UNKNOWNS);
    columns.extend((0..9).map(|k| on(k / 3, &gyro[k % 3])));
    columns.extend((0..3).map(|axis| on(axis, &ones)));
    columns.extend((0..3).map(|axis| on(axis, &times)));
    let length_s = times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
    (FlightRows { targets, columns, starts, period_s: stride as f64 * period_s }, length_s)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::prepared;

    /// A waving flight of 40 s whose gyro makes of the true rates what `told` says, with noise of tracker and gyro.
    fn told(told: impl Fn(f64, Vector3<f64>) -> Vector3<f64>) -> Vec<String> {
        let noise = std::cell::RefCell::new(rand_pcg::Pcg64::seed_from_u64(9));
        let flight = prepared(4000, |t, row| {
            row.wave();
            let draw = |size: f64| size * (noise.borrow_mut().random::<f64>() - 0.5);
            let rates = told(t, row.rate_rad_s.into());
            row.rate_rad_s = std::array::from_fn(|i| rates[i] + draw(0.03));
            row.euler_rad.iter_mut().for_each(|angle| *angle += draw(0.002));
        });
        check(&flight)
    }

    #[test]
    fn a_gyro_without_faults_has_none_and_one_that_is_turned_is_left_to_the_attitude() {
        assert_eq!(told(|_, rates| rates), [""; 0]);
        let turned = nalgebra::Rotation3::from_euler_angles(0.03, -0.02, 0.04);
        assert_eq!(told(|_, rates| turned * rates), [""; 0]);
    }

    #[test]
    fn scale_cross_axis_and_drift_are_named_with_their_sizes() {
        let scaled = told(|_, rates| rates.component_mul(&Vector3::new(1.0, 0.94, 1.0)));
        assert_eq!(scaled.len(), 1, "{scaled:?}");
        let percent: f64 = scaled[0].split_whitespace().nth(4).unwrap().parse().unwrap();
        assert!(scaled[0].starts_with("the gyro's q is ") && (percent - 6.0).abs() < 0.2, "{scaled:?}");
        assert!(scaled[0].contains("smaller than") && scaled[0].contains("scale = 1.06"), "{scaled:?}");
        let crossed =
            told(|_, rates| Vector3::new(rates.x + 0.05 * rates.y, rates.y + 0.05 * rates.x, rates.z));
        assert_eq!(crossed.len(), 1, "{crossed:?}");
        assert!(
            crossed[0].starts_with("the gyro's p and q are not at right angles: each measures "),
            "{crossed:?}"
        );
        let drifting = told(|t, rates| rates + Vector3::new(0.0, 0.0, 0.002 * (t - 20.0)));
        assert_eq!(drifting.len(), 1, "{drifting:?}");
        assert!(drifting[0].starts_with("the bias of the gyro's r drifts by 0.1"), "{drifting:?}");
    }
}
