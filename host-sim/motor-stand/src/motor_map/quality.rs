//! What is left out of a fit as missed pulses, and what makes a fit useless.

use super::craft_log::{CraftLog, range};
use super::error::MotorMapError;
use super::rows::Point;
use super::run::{Fitted, Run};
use super::terms::Terms;
use super::voltage_noise::noise_share;

/// Least part of the speed's variance that is explained where two logs belong together.
pub(super) const LEAST_FIT: f64 = 0.6;
/// Residuals this many times their usual size are missed pulses.
const OUTLIER: f64 = 6.0;
/// Standard error of the voltage's coefficient, part of speed over voltage, beyond which it was not
/// excited.
const VOLTAGE_ERROR: f64 = 0.2;
/// Part of the voltage's variance that may be noise. The coefficient comes out too small by this part.
const VOLTAGE_NOISE: f64 = 0.02;

/// Takes points out that are far from everything else; how many.
pub(super) fn leave_out_missed(run: &mut Run<'_>, terms: Terms, fitted: &Fitted) -> usize {
    let mut count = 0;
    for motor in 0..run.points.len() {
        let residuals = run.residuals(motor, terms, fitted);
        let mut sizes: Vec<f64> = residuals.iter().map(|(_, e)| e.abs()).collect();
        if sizes.is_empty() {
            continue;
        }
        let middle = sizes.len() / 2;
        // The median size of a normal deviate is 0.6745 of its deviation.
        let deviation = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
        let missed: Vec<usize> =
            residuals.iter().filter(|(_, e)| e.abs() > OUTLIER * deviation).map(|(k, _)| *k).collect();
        count += missed.len();
        let mut index = 0;
        let mut next = missed.iter().peekable();
        run.points[motor].retain(|_| {
            let out = next.peek() == Some(&&index);
            if out {
                next.next();
            }
            index += 1;
            !out
        });
    }
    count
}

pub(super) fn check(
    craft: &CraftLog,
    run: &Run<'_>,
    fitted: &Fitted,
    terms: Terms,
) -> Result<(), MotorMapError> {
    let command = fitted.coefficients[0].value;
    if !(command > 0.0) {
        return Err(MotorMapError::Falling { command });
    }
    let explained = 1.0 - fitted.rms.powi(2) / variance(&run.points);
    if explained < LEAST_FIT {
        return Err(MotorMapError::NoOverlap { percent: 100.0 * explained.max(0.0) });
    }
    if terms == Terms::Voltage {
        let error = fitted.coefficients[1].std_error;
        let volts = craft.volts.iter().sum::<f64>() / craft.volts.len() as f64;
        if !(error < VOLTAGE_ERROR * mean_speed(&run.points) / volts) {
            return Err(not_excited(craft, format!("which determines it to +- {error:.0} rad/s/V only")));
        }
        let share = noise_share(run, fitted.shape);
        if !(share < VOLTAGE_NOISE) {
            let percent = (100.0 * share).min(100.0);
            return Err(not_excited(craft, format!("and {percent:.0} % of its variance is noise")));
        }
    }
    Ok(())
}

pub(super) fn not_excited(craft: &CraftLog, why: String) -> MotorMapError {
    let (low_v, high_v) = range(&craft.volts);
    MotorMapError::VoltageNotExcited { low_v, high_v, why }
}

pub(super) fn mean_speed(points: &[Vec<Point>]) -> f64 {
    let count: usize = points.iter().map(Vec::len).sum();
    points.iter().flatten().map(|p| p.speed).sum::<f64>() / count.max(1) as f64
}

pub(super) fn variance(points: &[Vec<Point>]) -> f64 {
    let mean = mean_speed(points);
    let count: usize = points.iter().map(Vec::len).sum();
    points.iter().flatten().map(|p| (p.speed - mean).powi(2)).sum::<f64>() / count.max(1) as f64
}
