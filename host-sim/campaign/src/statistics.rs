//! Statistics of counts.

use statrs::distribution::{Beta, Binomial, ContinuousCDF, DiscreteCDF};

/// A confidence interval of 95 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The exact interval of a share of which `hits` of `count` were seen (Clopper and Pearson, Biometrika 26, 1934).
pub fn exact_interval(hits: u64, count: u64) -> Interval {
    const TAIL: f64 = 0.025;
    let (hits, count) = (hits as f64, count as f64);
    let quantile =
        |a: f64, b: f64, p: f64| Beta::new(a, b).map(|beta| beta.inverse_cdf(p)).unwrap_or(f64::NAN);
    Interval {
        low: if hits > 0.0 { quantile(hits, count - hits + 1.0, TAIL) } else { 0.0 },
        high: if hits < count { quantile(hits + 1.0, count - hits, 1.0 - TAIL) } else { 1.0 },
    }
}

/// The exact p-value that two gains lose the craft equally often, of the draws that only one of them lost (McNemar, Psychometrika 12, 1947).
pub fn mcnemar_p_value(only_first: u64, only_second: u64) -> f64 {
    let count = only_first + only_second;
    let Ok(even) = Binomial::new(0.5, count) else { return 1.0 };
    (2.0 * even.cdf(only_first.min(only_second))).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy 1.17.1: binomtest(k, n).proportion_ci(0.95, 'exact').
    #[test]
    fn intervals_are_those_of_scipy() {
        for (hits, count, low, high) in [
            (0, 1000, 0.0, 0.003_682_083_896_639_526),
            (1, 10, 0.002_528_578_544_462_572_8, 0.445_016_117_028_195_43),
            (13, 200, 0.035_060_708_656_981_93, 0.108_587_236_503_817_87),
            (10, 10, 0.691_502_892_181_237_1, 1.0),
        ] {
            let found = exact_interval(hits, count);
            assert!(
                (found.low - low).abs() < 1e-9 && (found.high - high).abs() < 1e-9,
                "{hits} of {count}: {found:?}"
            );
        }
    }

    /// 2 (C(12,0) + C(12,1) + C(12,2)) / 2^12, and no draw that tells them apart.
    #[test]
    fn pairs_are_compared_on_the_draws_that_tell_them_apart() {
        assert!((mcnemar_p_value(2, 10) - 2.0 * 79.0 / 4096.0).abs() < 1e-12);
        assert_eq!(mcnemar_p_value(10, 2), mcnemar_p_value(2, 10));
        assert_eq!((mcnemar_p_value(5, 5), mcnemar_p_value(0, 0)), (1.0, 1.0));
    }
}
