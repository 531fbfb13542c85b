//! Flights that share samples: the same flight saved again in another format, or a piece cut out of another.
//!
//! A flight that was fitted on cannot judge the fit, whatever its file is called. Noise of a gyro never repeats: where
//! forty rates and commands in a row are those of another flight to the last digits that were kept, they are the same
//! samples.

use crate::prepare::{Prepared, Stretch};

/// Samples that are compared at once.
const PROBE: usize = 40;
/// Places of a stretch from which samples are looked for in the other flight, s apart.
const PROBE_EVERY_S: f64 = 2.0;
/// Places that have to be found: one alone may be a step that a noise-free simulation flew twice.
const LEAST_PROBES: usize = 2;
/// Differences that another format makes: part of the motion, and of a rate in rad/s at three digits.
const ROUNDING: f64 = 0.02;
const ROUNDING_RAD_S: f64 = 6e-4;
/// Motion that tells one moment from another, rad/s.
const LEAST_MOTION_RAD_S: f64 = 0.01;

/// Whether `one` and `other` have samples in common.
pub fn share_samples(one: &Prepared, other: &Prepared) -> bool {
    has_piece_of(one, other) || has_piece_of(other, one)
}

/// Whether a piece of `other` is in `whole`.
fn has_piece_of(whole: &Prepared, other: &Prepared) -> bool {
    if (whole.period_s / other.period_s - 1.0).abs() > 0.05 {
        return false;
    }
    let step = ((PROBE_EVERY_S / other.period_s) as usize).max(1);
    let probes = other.stretches.iter().flat_map(|piece| {
        (0..piece.time_s.len().saturating_sub(PROBE)).step_by(step).map(move |from| (piece, from))
    });
    let found = probes.filter(|(piece, from)| whole.stretches.iter().any(|s| is_in(s, piece, *from)));
    found.take(LEAST_PROBES).count() == LEAST_PROBES
}

fn is_in(stretch: &Stretch, piece: &Stretch, from: usize) -> bool {
    let probe: [Vec<f64>; 3] = piece.rate_rad_s.each_ref().map(|r| about_mean(&r[from..from + PROBE]));
    let motion = (probe.iter().flatten().map(|v| v * v).sum::<f64>() / PROBE as f64).sqrt();
    if motion < LEAST_MOTION_RAD_S {
        return false;
    }
    let slack = ROUNDING * motion + ROUNDING_RAD_S;
    let last = stretch.time_s.len().saturating_sub(PROBE);
    // The bias that was taken out differs from file to file, so steps are compared first and the rest about its mean.
    let quick = |at: usize| {
        let step = |r: &[f64], k: usize| r[k + 1] - r[k];
        (0..3).all(|i| {
            let (there, here) = (&stretch.rate_rad_s[i][at..], &probe[i]);
            (step(there, 0) - step(here, 0)).abs() < 2.0 * slack
                && (step(there, 7) - step(here, 7)).abs() < 2.0 * slack
        })
    };
    (0..last).filter(|&at| quick(at)).any(|at| {
        let same_rates = (0..3).all(|i| {
            let there = about_mean(&stretch.rate_rad_s[i][at..at + PROBE]);
            there.iter().zip(&probe[i]).all(|(a, b)| (a - b).abs() < slack)
        });
        same_rates && (0..4).all(|i| same_commands(&stretch.command[i][at..], &piece.command[i][from..]))
    })
}

fn same_commands(a: &[f64], b: &[f64]) -> bool {
    let size = b[..PROBE].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(&b[..PROBE]).all(|(a, b)| (a - b).abs() <= 2e-3 * size)
}

fn about_mean(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|v| v - mean).collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::prepared;

    /// Twelve seconds of rates that wave with the noise of a gyro, the same for the same seed.
    fn noisy(seed: u64) -> Prepared {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut flight = prepared(1200, |_, row| {
            row.wave();
        });
        let values = flight.stretches[0].rate_rad_s.iter_mut().flatten();
        values.for_each(|value| *value += 0.05 * (rng.random::<f64>() - 0.5));
        flight
    }

    fn cut(flight: &Prepared, range: std::ops::Range<usize>) -> Prepared {
        let mut piece = flight.clone();
        piece.stretches[0] = flight.stretches[0].part(range);
        piece
    }

    #[test]
    fn a_piece_shares_the_samples_of_the_flight_it_was_cut_from_whichever_is_named_first() {
        let whole = noisy(1);
        let piece = cut(&whole, 333..800);
        assert!(share_samples(&whole, &piece) && share_samples(&piece, &whole));
        assert!(share_samples(&whole, &whole));
    }

    #[test]
    fn three_digits_and_another_gyro_bias_do_not_hide_a_flight_saved_again() {
        let whole = noisy(2);
        let mut again = cut(&whole, 100..900);
        for (i, rate) in again.stretches[0].rate_rad_s.iter_mut().enumerate() {
            let saved = |value: f64| (1e3 * (value + 0.02 * i as f64)).round() / 1e3;
            rate.iter_mut().for_each(|value| *value = saved(*value));
        }
        assert!(share_samples(&whole, &again));
    }

    #[test]
    fn the_same_manoeuvre_flown_twice_is_another_flight() {
        for seed in 1..5 {
            assert!(!share_samples(&noisy(seed), &noisy(seed + 10)), "seed {seed}");
        }
    }

    #[test]
    fn other_commands_or_another_sampling_are_another_flight() {
        let whole = noisy(3);
        let mut commanded = whole.clone();
        commanded.stretches[0].command[2].iter_mut().for_each(|c| *c += 20.0);
        assert!(!share_samples(&whole, &commanded));
        let mut slower = whole.clone();
        slower.period_s = 0.012;
        assert!(!share_samples(&whole, &slower));
    }

    #[test]
    fn a_craft_that_stands_still_tells_no_moment_from_another() {
        let still = prepared(1200, |_, _| {});
        assert!(!share_samples(&still, &still));
    }

    #[test]
    fn a_flight_shorter_than_two_probes_says_nothing() {
        let whole = noisy(4);
        assert!(!share_samples(&whole, &cut(&whole, 0..40)));
        let mut none = whole.clone();
        none.stretches.clear();
        assert!(!share_samples(&whole, &none) && !share_samples(&none, &none));
    }
}
