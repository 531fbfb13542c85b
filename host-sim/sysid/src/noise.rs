//! What the residual would be if nothing were missing: the sensors' own noise, through the filters.
//!
//! The noise of a channel is read off its fourth differences, in which motion hardly shows and white noise does, and the
//! filters' taps say what becomes of it in a row. On flights of complete models the residual's variance is that, within
//! the scatter of a variance. A residual well above has a cause, whether or not it depends on anything measured: a
//! gust, a swinging load, an engine that ages. Its spectrum says at which frequency.
//!
//! Logs of an estimator instead of sensors have no white noise to go by; their channels fail the test for whiteness
//! (the autocorrelation of fourth differences is known), and nothing is said.

use std::f64::consts::TAU;

use crate::Residuals;
use crate::prepare::{ForceTarget, Prepared};

/// Variance of the fourth difference of unit white noise: 1 + 16 + 36 + 16 + 1.
const FOURTH_DIFFERENCE: f64 = 70.0;
/// Its autocorrelation at one and two samples: -56/70 and 28/70.
const WHITE: [f64; 2] = [-0.8, 0.4];
/// How far the autocorrelation may be off; 2,000 samples scatter by 0.03.
const WHITE_TOLERANCE: f64 = 0.12;
/// Frequencies looked at, Hz: from what a flight is long enough for to where the filters end.
const FREQUENCIES_HZ: (f64, f64, usize) = (0.1, 5.0, 99);
/// An oscillation has this part of the excess within a sixth of its frequency.
const CONCENTRATED: f64 = 0.5;

/// Picks the three channels that a force row comes from.
type Channel = fn(&crate::prepare::Stretch) -> &[Vec<f64>; 3];

/// Variance that sensor noise alone leaves in a row of each axis of a flight, (unit of the axis)^2; nothing where the
/// channel behind the axis is not white noise at its highest frequencies.
fn floor(flight: &Prepared) -> [Option<f64>; 6] {
    let filter = &flight.filter;
    let energy = |taps: &[f64]| taps.iter().map(|t| t * t).sum::<f64>();
    let once = energy(&filter.derivative);
    let (channel, gain): (Channel, f64) = match flight.force_target {
        ForceTarget::Imu => (|s| s.imu_m_s2.as_ref().unwrap_or(&s.rate_rad_s), energy(&filter.smooth)),
        ForceTarget::Velocity => (|s| &s.velocity_ned_m_s, once),
        ForceTarget::Position => (|s| &s.position_ned_m, energy(&self_convolution(&filter.derivative))),
    };
    let force: [Option<f64>; 3] = std::array::from_fn(|i| white_variance(flight, |s| &channel(s)[i]));
    // Inertial axes and body axes share the mean: a tracker is about as good in each direction.
    let force = match (flight.force_target, force) {
        (ForceTarget::Imu, each) => each,
        (_, [Some(x), Some(y), Some(z)]) => [Some((x + y + z) / 3.0); 3],
        _ => [None; 3],
    };
    let turning: [Option<f64>; 3] = std::array::from_fn(|i| white_variance(flight, |s| &s.rate_rad_s[i]));
    std::array::from_fn(|axis| {
        if axis < 3 { force[axis].map(|v| v * gain) } else { turning[axis - 3].map(|v| v * once) }
    })
}

/// Variance of the white noise in a channel, by the median of its squared fourth differences: a glitch does not count.
fn white_variance(flight: &Prepared, channel: impl Fn(&crate::prepare::Stretch) -> &Vec<f64>) -> Option<f64> {
    let mut squares = Vec::new();
    let mut lagged = [0.0; 3];
    for stretch in &flight.stretches {
        let differences: Vec<f64> =
            channel(stretch).windows(5).map(|w| w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).collect();
        for (lag, sum) in lagged.iter_mut().enumerate() {
            *sum += differences
                .iter()
                .zip(&differences[lag.min(differences.len())..])
                .map(|(a, b)| a * b)
                .sum::<f64>();
        }
        squares.extend(differences.iter().map(|d| d * d));
    }
    let white = WHITE.iter().zip(&lagged[1..]).all(|(w, sum)| (sum / lagged[0] - w).abs() < WHITE_TOLERANCE);
    if !white {
        return None;
    }
    let middle = squares.len() / 2;
    // The median of a squared normal deviate is 0.4549 of its variance.
    Some(*squares.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.4549 / FOURTH_DIFFERENCE)
}

fn self_convolution(taps: &[f64]) -> Vec<f64> {
    let mut result = vec![0.0; 2 * taps.len() - 1];
    for (i, a) in taps.iter().enumerate() {
        for (j, b) in taps.iter().enumerate() {
            result[i + j] += a * b;
        }
    }
    result
}

/// Ratio of the residual's variance to what the sensors' noise explains, for each axis over several flights; nothing
/// where the noise is not known.
pub fn excess(flights: &[&Prepared], residuals: &[Residuals]) -> [Option<f64>; 6] {
    let (mut found, mut expected) = ([0.0; 6], [Some(0.0); 6]);
    for (flight, residual) in flights.iter().zip(residuals) {
        let floor = floor(flight);
        for axis in 0..6 {
            found[axis] += residual.residual[axis].iter().map(|e| e * e).sum::<f64>();
            expected[axis] = expected[axis].zip(floor[axis]).map(|(sum, v)| sum + v * flight.rows() as f64);
        }
    }
    std::array::from_fn(|axis| expected[axis].filter(|e| *e > 0.0).map(|e| found[axis] / e))
}

/// Where in frequency a residual stands out most from white noise through the filters: "an oscillation at 0.70 Hz", or
/// "slow changes" when it is spread out.
pub(crate) fn frequency(flights: &[&Prepared], residuals: &[Residuals], axis: usize) -> String {
    let (low, high, count) = FREQUENCIES_HZ;
    let grid: Vec<f64> = (0..count).map(|k| low + (high - low) * k as f64 / (count - 1) as f64).collect();
    let mut power = vec![0.0; count];
    for (flight, residual) in flights.iter().zip(residuals) {
        let signal = &residual.residual[axis];
        let n = signal.len() as f64;
        for (sum, frequency) in power.iter_mut().zip(&grid) {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (k, e) in signal.iter().enumerate() {
                let hann = 0.5 - 0.5 * (TAU * k as f64 / n).cos();
                let angle = TAU * frequency * flight.period_s * k as f64;
                real += hann * e * angle.cos();
                imaginary += hann * e * angle.sin();
            }
            *sum += (real * real + imaginary * imaginary) / n;
        }
    }
    let total: f64 = power.iter().sum();
    let peak = (0..count).max_by(|a, b| power[*a].total_cmp(&power[*b])).unwrap_or(0);
    let near = |k: usize| (grid[k] / grid[peak] - 1.0).abs() < 1.0 / 6.0 || k.abs_diff(peak) <= 1;
    let around: f64 = (0..count).filter(|k| near(*k)).map(|k| power[k]).sum();
    if around > CONCENTRATED * total && grid[peak] > 0.25 {
        format!("an oscillation at {:.2} Hz", grid[peak])
    } else {
        "slow changes in time".into()
    }
}
