//! Does the clock of the motor commands keep pace with that of the motion, all flight long?
//!
//! Loggers on a radio link stamp commands when they are sent and motion when it arrives, and the time between the two may
//! change by several samples within a flight. There is no offset to take out of such a log, and no rotation to fit to it:
//! it is to be named, before a regression answers with motors that push the wrong way.
//!
//! **Without a model.** Rotor thrusts with the signs of their places are what rolls and pitches the craft (a speed that
//! was measured, or a command through the vehicle file's map and lag). In pieces of [`PIECE_S`] the time by which the angular
//! acceleration follows them is where their correlation is largest, for roll and for pitch by itself. Slow parts, in which
//! airflow and controller hide the motors, are taken out.
//!
//! **A clock or the motors?** A lag of the motors is the same in all pieces: in simulated flights of noise up to twice the
//! usual the lags of a flight scatter by a few milliseconds, with an effect that hides the motors by up to 8 ms, in logs of a radio
//! link by 7 to 30 ms. A scatter of more than
//! [`MATTERS_S`] is called wandering. Where rotor speeds were measured, [`crate::fit::alignment`] looks more closely.

use model::{Adjustments, Vehicle};
use report::number::fixed;
use schemars::JsonSchema;
use serde::Serialize;

use crate::filter::sum_of_products;
use crate::prepare::Prepared;
use crate::statistics::median;

/// Length of a piece, s.
pub const PIECE_S: f64 = 4.0;
/// Lags that are looked at, s.
const LAGS_S: (f64, f64) = (-0.10, 0.20);
/// Parts slower than this are taken out, s.
const SLOW_S: f64 = 1.2;
/// Correlation from which on a piece shows its lag.
const CLEAR: f64 = 0.6;
/// Fewest lags of a flight, roll and pitch counted apart, that say something about wandering.
const FEWEST_LAGS: usize = 5;
/// Lags must scatter by this, s, for a clock to wander.
pub const MATTERS_S: f64 = 0.010;
/// Signs of the places' roll and pitch moments.
const SIGNS: [[f64; 4]; 2] = [[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]];

/// How late the motion follows the motors in a piece of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct PieceLag {
    /// Middle of the piece, s.
    pub time_s: f64,
    /// Of the angular acceleration in roll and in pitch, s, where the piece shows it.
    pub late_s: [Option<f64>; 2],
}

/// The pieces of a flight whose clock wanders; nothing where it keeps pace or where the flight does not tell.
pub fn check(flight: &Prepared, vehicle: &Vehicle) -> Option<Vec<PieceLag>> {
    if flight.has_rotor_speeds() {
        return None;
    }
    let pieces = pieces(flight, vehicle);
    (scatter_s(&pieces)? > MATTERS_S).then_some(pieces)
}

/// For people.
pub fn sentence(pieces: &[PieceLag]) -> String {
    let of = |piece: &PieceLag| -> Option<String> {
        let late = mean(piece.late_s.iter().flatten().copied())?;
        Some(format!("{} ms at {} s", fixed(1e3 * late, 0), fixed(piece.time_s, 0)))
    };
    let listed: Vec<String> = pieces.iter().filter_map(of).collect();
    format!(
        "the clock of the motor commands drifts relative to that of the motion, which lags the commands by {}: no rotation \
         can be fitted to such a flight; log commands and motion on one clock",
        listed.join(", ")
    )
}

/// Scatter of the lags about their median in roll and that in pitch, by the median of the absolute deviations: a piece that
/// shows another lag than the rest is no wandering clock. Nothing where there are too few.
fn scatter_s(pieces: &[PieceLag]) -> Option<f64> {
    /// Standard deviation of normal deviates over the median of their absolute values.
    const NORMAL: f64 = 1.4826;
    let mut deviations: Vec<f64> = Vec::new();
    for axis in 0..2 {
        let lags: Vec<f64> = pieces.iter().filter_map(|p| p.late_s[axis]).collect();
        let Some(middle) = median(&mut lags.clone()) else { continue };
        deviations.extend(lags.iter().map(|lag| (lag - middle).abs()));
    }
    (deviations.len() >= FEWEST_LAGS).then(|| median(&mut deviations).map(|m| NORMAL * m)).flatten()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn pieces(flight: &Prepared, vehicle: &Vehicle) -> Vec<PieceLag> {
    let period_s = flight.period_s;
    let (first, last) = ((LAGS_S.0 / period_s).round() as isize, (LAGS_S.1 / period_s).round() as isize);
    let length = (PIECE_S / period_s).round() as usize;
    let mut pieces = Vec::new();
    for stretch in &flight.stretches {
        let half = flight.filter.half();
        let rows = stretch.time_s.len().saturating_sub(2 * half + 1);
        if rows <= length {
            continue;
        }
        let squares = stretch
            .rotors(vehicle, &Adjustments::default(), period_s, 0.0)
            .map(|r| r.mean_rad_s.iter().map(|w| w * w).collect::<Vec<f64>>());
        let streams: [[Vec<f64>; 2]; 2] = std::array::from_fn(|axis| {
            let turning = (0..rows)
                .map(|k| sum_of_products(&stretch.rate_rad_s[axis][k..], &flight.filter.derivative))
                .collect();
            let pushing = (0..rows)
                .map(|k| {
                    let of =
                        |i: usize| SIGNS[axis][i] * sum_of_products(&squares[i][k..], &flight.filter.between);
                    (0..4).map(of).sum()
                })
                .collect();
            [turning, pushing].map(|signal: Vec<f64>| without_slow_parts(&signal, period_s))
        });
        let margin = last.max(-first) as usize;
        for start in (margin..rows.saturating_sub(length + margin)).step_by(length) {
            let late = streams.each_ref().map(|[turning, pushing]| {
                lag_samples(turning, pushing, start..start + length, (first, last))
            });
            if late.iter().any(Option::is_some) {
                let time_s = stretch.time_s[half + start + length / 2];
                pieces
                    .push(PieceLag { time_s, late_s: late.map(|lag| lag.map(|samples| samples * period_s)) });
            }
        }
    }
    pieces
}

/// The signal less its mean over [`SLOW_S`] about each sample.
fn without_slow_parts(signal: &[f64], period_s: f64) -> Vec<f64> {
    let half = (0.5 * SLOW_S / period_s).round() as usize;
    let mut sums = vec![0.0];
    sums.extend(signal.iter().scan(0.0, |sum, v| {
        *sum += v;
        Some(*sum)
    }));
    let mean = |k: usize| {
        let (from, to) = (k.saturating_sub(half), (k + half + 1).min(signal.len()));
        (sums[to] - sums[from]) / (to - from) as f64
    };
    signal.iter().enumerate().map(|(k, v)| v - mean(k)).collect()
}

/// The lag of the largest correlation, between samples by the parabola through it and its neighbours; nothing where none is
/// clear or the largest is at the end of what was looked at.
fn lag_samples(
    late: &[f64],
    early: &[f64],
    range: std::ops::Range<usize>,
    (first, last): (isize, isize),
) -> Option<f64> {
    let correlation = |lag: isize| {
        let (mut product, mut squares) = (0.0, [0.0; 2]);
        for k in range.clone() {
            let (a, b) = (late[k], early[(k as isize - lag) as usize]);
            product += a * b;
            squares = [squares[0] + a * a, squares[1] + b * b];
        }
        product / (squares[0] * squares[1]).sqrt().max(f64::MIN_POSITIVE)
    };
    let all: Vec<f64> = (first..=last).map(correlation).collect();
    let best = (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b]))?;
    if all[best] < CLEAR || best == 0 || best + 1 == all.len() {
        return None;
    }
    let (a, b, c) = (all[best - 1], all[best], all[best + 1]);
    let part = 0.5 * (a - c) / (a - 2.0 * b + c).min(-f64::MIN_POSITIVE);
    Some((first + best as isize) as f64 + part)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::prepared;

    fn piece(time_s: f64, roll: Option<f64>, pitch: Option<f64>) -> PieceLag {
        PieceLag { time_s, late_s: [roll, pitch] }
    }

    fn noise(seed: u64, count: usize) -> Vec<f64> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        (0..count).map(|_| rng.random::<f64>() - 0.5).collect()
    }

    /// Deviations from the median 0.02 are 0.02, 0.01, 0, 0.01, 0.02, whose median is 0.01.
    #[test]
    fn the_scatter_is_that_of_normal_deviates_with_the_same_median() {
        let pieces: Vec<PieceLag> =
            (0..5).map(|k| piece(f64::from(k), Some(0.01 * f64::from(k)), None)).collect();
        assert!((scatter_s(&pieces).unwrap() - 0.014826).abs() < 1e-12);
    }

    #[test]
    fn four_lags_tell_nothing_and_one_odd_piece_is_no_wandering_clock() {
        let four: Vec<PieceLag> = (0..2).map(|k| piece(f64::from(k), Some(0.0), Some(0.1))).collect();
        assert_eq!(scatter_s(&four), None);
        assert_eq!(scatter_s(&[]), None);
        let mut pieces: Vec<PieceLag> = (0..6).map(|k| piece(f64::from(k), Some(0.04), None)).collect();
        pieces[3].late_s[0] = Some(0.19);
        assert_eq!(scatter_s(&pieces), Some(0.0));
    }

    #[test]
    fn roll_and_pitch_may_differ_for_good() {
        let pieces: Vec<PieceLag> = (0..4).map(|k| piece(f64::from(k), Some(0.02), Some(0.08))).collect();
        assert_eq!(scatter_s(&pieces), Some(0.0));
    }

    #[test]
    fn the_sentence_lists_the_mean_lag_of_each_piece_in_milliseconds() {
        let pieces = [piece(2.0, Some(0.02), Some(0.04)), piece(6.0, None, Some(-0.012))];
        assert_eq!(
            sentence(&pieces),
            "the clock of the motor commands drifts relative to that of the motion, which lags the commands by \
             30 ms at 2 s, -12 ms at 6 s: no rotation can be fitted to such a flight; log commands and \
             motion on one clock"
        );
    }

    #[test]
    fn a_lag_is_found_to_parts_of_a_sample_with_its_sign() {
        // A band-limited signal, moved by parts of a sample.
        let waves: Vec<f64> = noise(7, 12);
        let at = |x: f64| -> f64 {
            waves.iter().enumerate().map(|(i, a)| a * ((0.05 + 0.03 * i as f64) * x + 9.0 * a).sin()).sum()
        };
        let early: Vec<f64> = (0..600).map(|k| at(f64::from(k))).collect();
        for lag in [0.0, 3.0, -4.0, 6.4, -2.3] {
            let late: Vec<f64> = (0..600).map(|k| at(f64::from(k) - lag)).collect();
            let found = lag_samples(&late, &early, 100..500, (-10, 20)).unwrap();
            assert!((found - lag).abs() < 0.05, "{found} instead of {lag}");
        }
        // Beyond what is looked at there is no peak.
        let late: Vec<f64> = (0..600).map(|k| at(f64::from(k) - 24.0)).collect();
        assert_eq!(lag_samples(&late, &early, 100..500, (-10, 20)), None);
    }

    #[test]
    fn unrelated_signals_have_no_lag() {
        for seed in 1..6 {
            let (a, b) = (noise(seed, 600), noise(seed + 100, 600));
            assert_eq!(lag_samples(&a, &b, 100..500, (-10, 20)), None, "seed {seed}");
        }
        assert_eq!(lag_samples(&[0.0; 50], &[0.0; 50], 20..30, (-10, 10)), None);
    }

    #[test]
    fn slow_parts_go_and_fast_ones_stay() {
        let fast = |k: usize| (20.0 * 0.01 * k as f64).sin();
        let signal: Vec<f64> = (0..1000).map(|k| 5.0 + 0.01 * k as f64 + fast(k)).collect();
        let left = without_slow_parts(&signal, 0.01);
        for (k, value) in left.iter().enumerate().skip(100).take(800) {
            // The mean over 1.21 s of a sine of 20 rad/s is under 2 / (20 * 1.21) of it.
            assert!((value - fast(k)).abs() < 0.085, "{k}: {value}");
        }
        assert!(without_slow_parts(&[], 0.01).is_empty());
    }

    #[test]
    fn measured_rotor_speeds_and_flights_without_motion_are_left_alone() {
        let mut flight = prepared(1500, |_, _| {});
        assert_eq!(check(&flight, &Vehicle::thesis()), None);
        for stretch in &mut flight.stretches {
            stretch.logged_rotor_rad_s = Some(std::array::from_fn(|_| vec![600.0; stretch.time_s.len()]));
        }
        assert_eq!(check(&flight, &Vehicle::thesis()), None);
    }
}
