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
