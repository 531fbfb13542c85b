//! Normal distributions that reach beyond what can be simulated: they are truncated, and it is said.

use model::Model;
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::ContinuousCDF;

use crate::definition::{Normal, Spread, Unknown, limits};

/// Share of a normal distribution beyond what can be simulated from which on it is said, percent.
const SAID_PERCENT: f64 = 0.01;
/// Largest such share that can be drawn, percent: with more, what is drawn is hardly a normal distribution.
const MOST_PERCENT: f64 = 90.0;

/// A normal distribution that reaches beyond what can be simulated. Values there are drawn again.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Truncation {
    /// Key of the definition.
    pub quantity: String,
    /// Mean before the truncation.
    pub mean: f64,
    /// Standard deviation before the truncation.
    pub deviation: f64,
    /// Between which ends it is drawn.
    pub ends: [f64; 2],
    /// Share of the distribution beyond these, percent.
    pub beyond_percent: f64,
}

impl Unknown {
    /// The normal distributions that are truncated noticeably for a craft.
    pub(crate) fn truncations(&self, model: &Model) -> Vec<Truncation> {
        let one = |(name, spread): (&str, Option<Spread>)| {
            let Some(Spread::Normal(normal @ Normal { mean, deviation })) = spread else { return None };
            let ends = limits(name, model);
            let beyond_percent = 100.0 * share_beyond(normal, ends);
            (beyond_percent >= SAID_PERCENT).then(|| Truncation {
                quantity: name.to_owned(),
                mean,
                deviation,
                ends,
                beyond_percent,
            })
        };
        self.spreads().into_iter().filter_map(one).collect()
    }
}

/// Why a normal distribution that reaches far beyond its ends cannot be drawn.
pub(crate) fn refused(normal: Normal, ends: [f64; 2]) -> Option<String> {
    let percent = 100.0 * share_beyond(normal, ends);
    (percent > MOST_PERCENT).then(|| {
        let [low, high] = ends.map(|end| report::significant(end, 3));
        format!(
            "{} % of a normal distribution with deviation {} lies outside {low} to {high}; give a smaller deviation, or a range [low, high]",
            report::significant(percent, 2),
            normal.deviation
        )
    })
}

/// Share of a normal distribution outside of two ends.
fn share_beyond(normal: Normal, [least, most]: [f64; 2]) -> f64 {
    // Without a deviation there is only the mean, which is inside.
    statrs::distribution::Normal::new(normal.mean, normal.deviation)
        .map_or(0.0, |own| own.cdf(least) + own.sf(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2.275 % of a normal distribution lies beyond two standard deviations on one side, and half of it beyond its mean.
    #[test]
    fn the_share_beyond_is_that_of_the_tables() {
        let of = |mean, deviation, ends| share_beyond(Normal { mean, deviation }, ends);
        assert!((of(1.0, 0.5, [0.0, 100.0]) - 0.022_750_131_948).abs() < 1e-9);
        assert!((of(0.0, 0.02, [0.0, 0.5]) - 0.5).abs() < 1e-9);
        assert_eq!(of(0.3, 0.0, [0.0, 0.5]), 0.0);
    }

    #[test]
    fn what_hardly_ever_happens_is_not_said() {
        let normal = |mean, deviation| Some(Spread::Normal(Normal { mean, deviation }));
        let unknown = Unknown {
            noise: normal(1.0, 0.2),
            dead_time_s: normal(0.01, 0.01),
            wind_m_s: normal(0.0, 0.5),
            ..Unknown::default()
        };
        let found = unknown.truncations(&Model::thesis());
        let [dead_time] = &found[..] else { panic!("{found:?}") };
        assert_eq!((dead_time.quantity.as_str(), dead_time.ends), ("dead_time_s", [0.0, 0.5]));
        // One standard deviation.
        assert!((dead_time.beyond_percent - 15.865_5).abs() < 1e-3, "{dead_time:?}");
    }
}
