//! How much of what the voltage does is noise of the voltmeter. A fit takes such noise for variation,
//! and finds a coefficient that is too small by its part of the variance.

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
    pub(super) fn after_lag(&self, lag_rad_s: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole steps of a voltage that falls come at regular times and lie on a straight line.
    #[test]
    fn steps_of_a_converter_are_no_noise() {
        let raw: Vec<f64> = (0..600).map(|k| 12.0 - 0.1 * f64::from(k / 50)).collect();
        let noise = VoltageNoise::new(&raw, &vec![0; 600], vec![1.0], 0.01);
        assert!(noise.variance < 1e-20, "{}", noise.variance);
    }
}
