//! A normal distribution, and how much of it lies beyond what can be simulated.

use serde::{Deserialize, Serialize};
use statrs::distribution::ContinuousCDF;

/// Largest share beyond its ends that can be drawn, percent: with more, what is drawn is hardly a normal distribution.
const MOST_PERCENT: f64 = 90.0;

/// A normal distribution.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normal {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

impl Normal {
    /// Share of it outside of two ends.
    pub(crate) fn share_beyond(self, [least, most]: [f64; 2]) -> f64 {
        // Without a deviation there is only the mean, which is inside.
        statrs::distribution::Normal::new(self.mean, self.deviation)
            .map_or(0.0, |own| own.cdf(least) + own.sf(most))
    }

    /// Why it cannot be drawn between two ends: it reaches far beyond them.
    pub(crate) fn refused(self, ends: [f64; 2]) -> Option<String> {
        let percent = 100.0 * self.share_beyond(ends);
        (percent > MOST_PERCENT).then(|| {
            let [low, high] = ends.map(|end| report::significant(end, 3));
            format!(
                "{} % of a normal distribution with deviation {} lies outside {low} to {high}; give a smaller deviation, or a range [low, high]",
                report::significant(percent, 2),
                self.deviation
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2.275 % of a normal distribution lies beyond two standard deviations on one side, and half of it beyond its mean.
    #[test]
    fn the_share_beyond_is_that_of_the_tables() {
        let of = |mean, deviation, ends| Normal { mean, deviation }.share_beyond(ends);
        assert!((of(1.0, 0.5, [0.0, 100.0]) - 0.022_750_131_948).abs() < 1e-9);
        assert!((of(0.0, 0.02, [0.0, 0.5]) - 0.5).abs() < 1e-9);
        assert_eq!(of(0.3, 0.0, [0.0, 0.5]), 0.0);
    }
}
