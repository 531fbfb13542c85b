//! How much of what the voltage does is noise of the voltmeter. A fit takes such noise for variation,
//! and finds a coefficient that is too small by its part of the variance.

use super::rows::{Shape, rows};
use super::run::Run;
use super::terms::Terms;

/// Update intervals that spread by less than this part of their mean are those of a slower voltmeter.
const REGULAR: f64 = 0.5;
/// Time constants of the lag after which an impulse is over.
const FORGOTTEN: f64 = 6.0;

/// Noise of a voltmeter, and how it is smoothed.
pub(super) struct VoltageNoise {
    /// Variance of a reading, V^2.
    variance: f64,
    /// Samples for which a reading is logged again and again.
    held: usize,
    /// Weights of the samples that are smoothed together.
    taps: Vec<f64>,
    period_s: f64,
}

impl VoltageNoise {
    /// Of readings as they were logged; `since` says from which sample on there is no gap.
    pub(super) fn new(raw: &[f64], since: &[usize], taps: Vec<f64>, period_s: f64) -> Self {
        let is_new = |k: &usize| *k == 0 || since[*k] == *k || raw[*k].to_bits() != raw[*k - 1].to_bits();
        let updates: Vec<usize> = (0..raw.len()).filter(is_new).collect();
        let held = regular_interval(&updates);
        let read: Vec<usize> = if held > 1 { updates } else { (0..raw.len()).collect() };
        // A voltage that changes evenly has no second differences; independent noise has six times its variance.
        let squares: Vec<f64> = read
            .windows(3)
            .filter(|w| since[w[0]] == since[w[2]])
            .map(|w| (raw[w[2]] - 2.0 * raw[w[1]] + raw[w[0]]).powi(2))
            .collect();
        let variance = squares.iter().sum::<f64>() / (6.0 * squares.len().max(1) as f64);
        Self { variance, held, taps, period_s }
    }

    /// Variance of what is left of it after smoothing and lag, V^2.
    fn after_lag(&self, lag_rad_s: f64) -> f64 {
        let kept = (-lag_rad_s * self.period_s).exp();
        let count = (FORGOTTEN / (lag_rad_s * self.period_s)).ceil() as usize;
        let answer = |k: usize| (1.0 - kept) * kept.powi(k as i32);
        // The voltage over a sample is the mean of its ends.
        let means: Vec<f64> = (0..=self.taps.len())
            .map(|k| {
                let tap = |k: Option<usize>| k.and_then(|k| self.taps.get(k)).copied().unwrap_or(0.0);
                0.5 * (tap(Some(k)) + tap(k.checked_sub(1)))
            })
            .collect();
        let weights: Vec<f64> = (0..means.len() + count)
            .map(|k| {
                let from = k.saturating_sub(count);
                (from..means.len().min(k + 1)).map(|tap| means[tap] * answer(k - tap)).sum()
            })
            .collect();
        let of_reading = |held: &[f64]| held.iter().sum::<f64>().powi(2);
        // A reading may come at any of the samples: the mean over them.
        let of_phase = |phase: usize| {
            let (first, others) = weights.split_at(phase.min(weights.len()));
            of_reading(first) + others.chunks(self.held).map(of_reading).sum::<f64>()
        };
        self.variance * (0..self.held).map(of_phase).sum::<f64>() / self.held as f64
    }
}

/// Samples from one update to the next where these come regularly, else 1.
fn regular_interval(updates: &[usize]) -> usize {
    let intervals: Vec<f64> = updates.windows(2).map(|w| (w[1] - w[0]) as f64).collect();
    let count = intervals.len().max(1) as f64;
    let mean = intervals.iter().sum::<f64>() / count;
    let spread = (intervals.iter().map(|i| (i - mean).powi(2)).sum::<f64>() / count).sqrt();
    if spread < REGULAR * mean { (mean.round() as usize).max(1) } else { 1 }
}

/// Part of the variance of the voltage as the rotor follows it, beyond what goes with the command,
/// that is noise.
pub(super) fn noise_share(run: &Run<'_>, shape: Shape) -> f64 {
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

    /// Whole steps of a voltage that falls come at regular times and lie on a straight line.
    #[test]
    fn steps_of_a_converter_are_no_noise() {
        let raw: Vec<f64> = (0..600).map(|k| 12.0 - 0.1 * f64::from(k / 50)).collect();
        let noise = VoltageNoise::new(&raw, &vec![0; 600], vec![1.0], 0.01);
        assert!(noise.variance < 1e-20, "{}", noise.variance);
    }

    /// What a straight line in the command leaves: volts of 1, -1, -1, 1 about it.
    #[test]
    fn what_goes_with_the_command_is_no_variation_of_its_own() {
        let pairs = [(-3.0, -5.0), (-1.0, -3.0), (1.0, 1.0), (3.0, 7.0)];
        assert!((left_of_volts(&pairs) - 1.0).abs() < 1e-12);
    }
}
