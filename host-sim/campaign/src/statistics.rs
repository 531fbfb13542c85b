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

/// Standard deviations of a normal distribution in an interval of 95 %.
const WITHIN: f64 = 1.959_963_984_540_054;
/// Halvings of an interval: all digits of a share.
const HALVINGS: usize = 60;

/// The score interval of the difference between two shares of the same draws, of which so many were hit by the first alone and by the
/// second alone (Tango, Statistics in Medicine 17, 1998).
pub fn paired_interval(only_first: u64, only_second: u64, count: u64) -> Interval {
    let [b, c, n] = [only_first, only_second, count].map(|number| number as f64);
    // By how many standard deviations the counts depart from a difference.
    let score = |difference: f64| {
        let linear = (2.0 * n - b + c) * difference - b - c;
        let constant = -c * difference * (1.0 - difference);
        let share = ((linear * linear - 8.0 * n * constant).max(0.0).sqrt() - linear) / (4.0 * n);
        let variance = n * (2.0 * share + difference * (1.0 - difference));
        (b - c - n * difference) / variance.max(f64::MIN_POSITIVE).sqrt()
    };
    let end = |far: f64| {
        let (mut inside, mut outside) = ((b - c) / n, far);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if score(middle).abs() > WITHIN { outside = middle } else { inside = middle }
        }
        0.5 * (inside + outside)
    };
    if count == 0 {
        return Interval { low: -1.0, high: 1.0 };
    }
    Interval { low: end(-1.0), high: end(1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// Without a hit, the ends are those of the closed form, z^2 / (n + z^2); of many draws, those of the normal approximation; the
    /// interval of the difference the other way round is the same with the other sign.
    #[test]
    fn the_interval_of_a_difference_is_that_of_closed_forms() {
        let z2 = WITHIN * WITHIN;
        for count in [10, 100, 1000] {
            let Interval { low, high } = paired_interval(0, 0, count);
            let expected = z2 / (count as f64 + z2);
            assert!((high - expected).abs() < 1e-9 && (low + expected).abs() < 1e-9, "{low} {high}");
        }
        // Agresti's ratings of a prime minister: 150 and 86 of 1600 changed their minds, 0.0400 +- 1.96 x 0.0095.
        let Interval { low, high } = paired_interval(150, 86, 1600);
        assert!((low - 0.021).abs() < 1e-3 && (high - 0.059).abs() < 1e-3, "{low} {high}");
        let other = paired_interval(86, 150, 1600);
        assert!((other.low + high).abs() < 1e-9 && (other.high + low).abs() < 1e-9);
    }

    /// Of 4000 intervals of known shares, 95 % hold the difference, to four standard errors of that count and what is discrete.
    #[test]
    fn intervals_of_differences_hold_as_often_as_they_say() {
        let seed = 5;
        println!("seed {seed}");
        let mut generator = Pcg64::seed_from_u64(seed);
        for [first, second] in [[0.2, 0.05], [0.03, 0.03], [0.6, 0.1]] {
            let held = (0..4000).filter(|_| {
                let (mut b, mut c) = (0, 0);
                for _ in 0..80 {
                    let at: f64 = generator.random();
                    b += u64::from(at < first);
                    c += u64::from(at >= first && at < first + second);
                }
                let Interval { low, high } = paired_interval(b, c, 80);
                (low..=high).contains(&(first - second))
            });
            let share = held.count() as f64 / 4000.0;
            assert!((0.935..0.975).contains(&share), "{first} {second}: {share}");
        }
    }

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
