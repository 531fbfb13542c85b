//! Normal distributions that reach beyond what can be simulated: they are truncated, and it is said.

use model::Model;
use schemars::JsonSchema;
use serde::Serialize;

use crate::definition::{Spread, Unknown, limits};
use crate::normal::Normal;

/// Share of a normal distribution beyond what can be simulated from which on it is said, percent.
const SAID_PERCENT: f64 = 0.01;

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
            let beyond_percent = 100.0 * normal.share_beyond(ends);
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

#[cfg(test)]
mod tests {
    use super::*;

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
