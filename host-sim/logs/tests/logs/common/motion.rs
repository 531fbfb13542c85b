//! Checks of frames, signs and motor order on a recording: what `verify_logs.py` of the shared data does.

use logs::{Signal, Span};
use nalgebra::{DMatrix, DVector};

/// Values of one component at even steps.
pub(crate) type Series = Vec<f64>;

/// Even steps over a span, s.
pub(crate) fn grid([start, end]: Span, step_s: f64) -> Series {
    (0..((end - start) / step_s) as usize).map(|k| start + k as f64 * step_s).collect()
}

/// The components of a signal at times, linear in between.
pub(crate) fn at<const N: usize>(signal: &Signal<N>, times: &[f64]) -> [Series; N] {
    signal.values.each_ref().map(|values| {
        times
            .iter()
            .map(|&t| {
                let after = signal.t.partition_point(|&time| time < t).clamp(1, signal.t.len() - 1);
                let (t0, t1) = (signal.t[after - 1], signal.t[after]);
                let part = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
                values[after - 1] * (1.0 - part) + values[after] * part
            })
            .collect()
    })
}

/// Half the width of the smoothing window: 0.11 s in all, at least five values.
fn half_width(step_s: f64) -> usize {
    ((0.11 / step_s) as usize / 2 * 2 + 1).max(5) / 2
}

/// Weighted sums over the window around each value (Savitzky and Golay); what lies at the ends is left out.
fn filtered(values: &[f64], step_s: f64, weight: impl Fn(f64, f64) -> f64) -> Series {
    let m = half_width(step_s);
    let window = 2 * m + 1;
    let weights: Vec<f64> = (0..window).map(|i| weight(i as f64 - m as f64, m as f64)).collect();
    values
        .windows(window)
        .map(|part| part.iter().zip(&weights).map(|(value, weight)| value * weight).sum())
        .collect()
}

/// Smoothed by a parabola.
pub(crate) fn smooth(values: &[f64], step_s: f64) -> Series {
    filtered(values, step_s, |i, m| {
        3.0 * (3.0 * m * m + 3.0 * m - 1.0 - 5.0 * i * i)
            / ((2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0))
    })
}

/// Slope of a parabola.
pub(crate) fn derivative(values: &[f64], step_s: f64) -> Series {
    filtered(values, step_s, |i, m| i / (m * (m + 1.0) * (2.0 * m + 1.0) / 3.0 * step_s))
}

/// Signs of the motors on an angular acceleration: "+--+" in our order, at the lead of the commands that explains most.
pub(crate) fn motor_signs(commands: &[Series; 4], rate: &[f64], step_s: f64) -> String {
    let motors = commands.each_ref().map(|motor| smooth(motor, step_s));
    let acceleration = derivative(rate, step_s);
    let mut best = (f64::INFINITY, String::new());
    for lag in 0..=(0.16 / step_s) as usize {
        let rows = acceleration.len() - lag;
        let matrix =
            DMatrix::from_fn(rows, 5, |row, column| motors.get(column).map_or(1.0, |motor| motor[row]));
        let known = DVector::from_column_slice(&acceleration[lag..]);
        let solved = (matrix.transpose() * &matrix)
            .cholesky()
            .expect("motors that move")
            .solve(&(matrix.transpose() * &known));
        let rest = (&matrix * &solved - &known).norm_squared() / rows as f64;
        if rest < best.0 {
            best = (rest, solved.iter().take(4).map(|&c| if c > 0.0 { '+' } else { '-' }).collect());
        }
    }
    best.1
}

/// Mean.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
