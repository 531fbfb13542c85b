//! What is left out of a fit as missed pulses, and what makes a fit useless.

use super::craft_log::{CraftLog, range};
use super::error::MotorMapError;
use super::rows::{Point, Shape, rows};
use super::run::{Fitted, Run};
use super::terms::Terms;

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

/// Part of the variance of the voltage as the rotor follows it, beyond what goes with the command,
/// that is noise.
fn noise_share(run: &Run<'_>, shape: Shape) -> f64 {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for (motor, points) in run.points.iter().enumerate() {
        let found = rows(run.craft, motor, Terms::Voltage, points, shape, run.middle_s);
        pairs.extend(found.features[0].iter().copied().zip(found.features[1].iter().copied()));
    }
    run.craft.noise.after_lag(shape.lag) / left_of_volts(&pairs)
}

/// Variance of the second of each pair that the first does not explain.
fn left_of_volts(pairs: &[(f64, f64)]) -> f64 {
    let count = pairs.len().max(1) as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (command, volts) = (mean(&|p| p.0), mean(&|p| p.1));
    let both = mean(&|p| (p.0 - command) * (p.1 - volts));
    let commands = mean(&|p| (p.0 - command).powi(2));
    mean(&|p| (p.1 - volts).powi(2)) - both * both / commands.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::super::craft_log::{CraftLog, lagged};
    use super::*;
    use crate::stand::{Motor, Stand};
    use model::rotor_lag::RotorLag;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const LAG: f64 = 21.5;

    /// A log of nothing but noise of 20 mV, each reading logged `held` times.
    fn log(held: usize) -> CraftLog {
        let mut rng = Pcg64::seed_from_u64(held as u64);
        let mut normal = move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let craft_s: Vec<f64> = (0..200_000).map(|k| 0.01 * f64::from(k)).collect();
        let mut reading = 0.0;
        let mut read = |k: usize| {
            if k.is_multiple_of(held) {
                reading = 11.8 + 0.02 * normal();
            }
            reading
        };
        let battery_v = (0..craft_s.len()).map(&mut read).collect();
        let motor = Motor { number: 1, command: vec![1500.0; craft_s.len()], speed_rad_s: Vec::new() };
        CraftLog::new(&Stand { craft_s, battery_v, rotor_s: Vec::new(), motors: vec![motor] })
    }

    /// The variance that is foreseen is that of the voltage as the rotor follows it, to a tenth.
    #[test]
    fn noise_after_smoothing_and_lag_is_foreseen() {
        for held in [1, 10] {
            let craft = log(held);
            let followed = lagged(&craft, &craft.features(0, Terms::Voltage)[1], RotorLag::new(LAG));
            let mean = followed.iter().sum::<f64>() / followed.len() as f64;
            let variance = followed.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / followed.len() as f64;
            let foreseen = craft.noise.after_lag(LAG);
            println!("{held}: {:.3} mV, foreseen {:.3} mV", 1e3 * variance.sqrt(), 1e3 * foreseen.sqrt());
            assert!((foreseen / variance - 1.0).abs() < 0.1, "held {held}: {foreseen} against {variance}");
        }
    }

    /// What a straight line in the command leaves: volts of 1, -1, -1, 1 about it.
    #[test]
    fn what_goes_with_the_command_is_no_variation_of_its_own() {
        let pairs = [(-3.0, -5.0), (-1.0, -3.0), (1.0, 1.0), (3.0, 7.0)];
        assert!((left_of_volts(&pairs) - 1.0).abs() < 1e-12);
    }
}
