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
//! [`MATTERS_S`] may be wandering.
//!
//! **A clock or chance?** A slow motion follows the motors about as well at any lag within some 50 ms: where the largest correlation lies is
//! then chance, or the answer of the controller to what disturbs the craft. So one lag for the whole flight is held against a lag of
//! each piece: it leaves 1 - r^2 of the motion in a piece, with the correlation r at that lag. Clocks that wander by 20 to 30 ms leave
//! 1.9 times as much and more with one lag; flights on one clock whose lags scatter by more than [`MATTERS_S`], simulated and real, at most
//! 1.22 times.
//!
//! **Or noise?** Where the craft does not move, the gyro's noise is all the motion there is, and a controller answers it: commands that follow noise look
//! like motion some 20 ms behind the commands. Pieces in which the noise is a quarter of the motion and more show no lag.
//!
//! Where rotor speeds were measured, [`crate::fit::alignment`] looks more closely.

use model::{Adjustments, Vehicle};
use report::number::fixed;
use schemars::JsonSchema;
use serde::Serialize;

use crate::checks::under_sampled::noise_variance;
use crate::filter::sum_of_products;
use crate::prepare::{Prepared, Stretch};
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
/// With one lag for the whole flight this times as much must be left of the motion as with a lag of each piece, as a mean of logarithms.
const LEAVES: f64 = 1.5;
/// Largest part of a motion's variance that may be noise of the gyro.
const MOST_NOISE: f64 = 0.25;
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
    let clear = clear_pieces(flight, vehicle);
    let pieces: Vec<PieceLag> = clear.iter().map(Clear::lag).collect();
    let wanders = scatter_s(&pieces)? > MATTERS_S && left_by_one_lag(&clear)? > LEAVES;
    wanders.then_some(pieces)
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

/// How many times as much one lag for all pieces leaves of the motion as a lag of each, as a mean of logarithms; nothing without pieces.
fn left_by_one_lag(pieces: &[Clear]) -> Option<f64> {
    let of_axis = |axis: usize| {
        let peaks: Vec<&Peak> = pieces.iter().filter_map(|piece| piece.peaks[axis].as_ref()).collect();
        let one = median(&mut peaks.iter().map(|peak| peak.late_s).collect::<Vec<_>>());
        peaks.into_iter().filter_map(move |peak| Some(peak.left_by(one?).ln()))
    };
    mean((0..2).flat_map(of_axis)).map(f64::exp)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// A piece that shows its lag.
struct Clear {
    /// Middle of the piece, s.
    time_s: f64,
    /// In roll and in pitch, where it shows it.
    peaks: [Option<Peak>; 2],
}

impl Clear {
    fn lag(&self) -> PieceLag {
        PieceLag {
            time_s: self.time_s,
            late_s: self.peaks.each_ref().map(|peak| peak.as_ref().map(|p| p.late_s)),
        }
    }
}

/// How the correlation of motion and motors depends on the lag.
struct Peak {
    /// The lag of the largest, between samples by the parabola through it and its neighbours, s.
    late_s: f64,
    /// The correlations, from the smallest lag on, a sample apart.
    correlations: Vec<f64>,
    /// Sampling period, s, and the smallest lag, samples.
    period_s: f64,
    first: isize,
}

impl Peak {
    /// How many times as much of the motion a lag leaves as the best one does.
    fn left_by(&self, late_s: f64) -> f64 {
        let left = |late_s: f64| {
            let place = (late_s / self.period_s).round() as isize - self.first;
            let correlation = usize::try_from(place).ok().and_then(|k| self.correlations.get(k));
            correlation.map_or(1.0, |r| (1.0 - r * r).max(f64::MIN_POSITIVE))
        };
        left(late_s) / left(self.late_s)
    }
}

fn clear_pieces(flight: &Prepared, vehicle: &Vehicle) -> Vec<Clear> {
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
        let streams = streams(flight, vehicle, stretch, rows);
        let passed: f64 = flight.filter.derivative.iter().map(|tap| tap * tap).sum();
        let noise: [f64; 2] = std::array::from_fn(|axis| passed * noise_variance(&stretch.rate_rad_s[axis]));
        let margin = last.max(-first) as usize;
        for start in (margin..rows.saturating_sub(length + margin)).step_by(length) {
            let piece = start..start + length;
            let peaks = [0, 1].map(|axis: usize| {
                let [turning, pushing] = &streams[axis];
                let squares: f64 = turning[piece.clone()].iter().map(|value| value * value).sum();
                let is_motion = noise[axis] * length as f64 <= MOST_NOISE * squares;
                is_motion.then(|| peak(turning, pushing, piece.clone(), (first, last), period_s)).flatten()
            });
            if peaks.iter().any(Option::is_some) {
                pieces.push(Clear { time_s: stretch.time_s[half + start + length / 2], peaks });
            }
        }
    }
    pieces
}

/// Angular acceleration in roll and in pitch over a stretch, and what the motors push, both without slow parts.
fn streams(flight: &Prepared, vehicle: &Vehicle, stretch: &Stretch, rows: usize) -> [[Vec<f64>; 2]; 2] {
    let period_s = flight.period_s;
    let squares = stretch
        .rotors(vehicle, &Adjustments::default(), period_s, 0.0)
        .map(|r| r.mean_rad_s.iter().map(|w| w * w).collect::<Vec<f64>>());
    std::array::from_fn(|axis| {
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
    })
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

/// The largest correlation; nothing where none is clear or the largest is at the end of what was looked at.
fn peak(
    late: &[f64],
    early: &[f64],
    range: std::ops::Range<usize>,
    (first, last): (isize, isize),
    period_s: f64,
) -> Option<Peak> {
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
    let late_s = ((first + best as isize) as f64 + part) * period_s;
    Some(Peak { late_s, correlations: all, period_s, first })
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
            let found = 100.0 * peak(&late, &early, 100..500, (-10, 20), 0.01).unwrap().late_s;
            assert!((found - lag).abs() < 0.05, "{found} instead of {lag}");
        }
        // Beyond what is looked at there is no peak.
        let late: Vec<f64> = (0..600).map(|k| at(f64::from(k) - 24.0)).collect();
        assert!(peak(&late, &early, 100..500, (-10, 20), 0.01).is_none());
    }

    /// Correlations of 0.6 and 0.8 leave 0.64 and 0.36 of the motion; beyond what was looked at nothing is known of it.
    #[test]
    fn what_another_lag_leaves_is_by_the_correlations() {
        let peak = Peak { late_s: 0.01, correlations: vec![0.6, 0.0, 0.8, 0.6], period_s: 0.01, first: -1 };
        assert!((peak.left_by(-0.01) - 0.64 / 0.36).abs() < 1e-12);
        assert!((peak.left_by(0.002) - 1.0 / 0.36).abs() < 1e-12);
        assert_eq!(peak.left_by(0.014), 1.0);
        assert!(
            (peak.left_by(0.5) - 1.0 / 0.36).abs() < 1e-12 && (peak.left_by(-0.5) - 1.0 / 0.36).abs() < 1e-12
        );
    }

    /// Lags of 0, 20 and 40 ms: the middle one is right for one piece, and the geometric mean of 1, 4 and 4 is left.
    #[test]
    fn one_lag_for_all_pieces_is_their_median() {
        let of = |late: usize, next: f64| {
            let mut correlations = vec![0.0; 5];
            correlations[2] = next;
            correlations[late] = 0.75_f64.sqrt();
            let peak = Peak { late_s: 0.01 * late as f64, correlations, period_s: 0.01, first: 0 };
            Clear { time_s: 0.0, peaks: [Some(peak), None] }
        };
        let sharp = left_by_one_lag(&[of(0, 0.0), of(2, 0.0), of(4, 0.0)]).unwrap();
        assert!((sharp - 16f64.cbrt()).abs() < 1e-12, "{sharp}");
        let broad = left_by_one_lag(&[of(0, 0.85), of(2, 0.85), of(4, 0.85)]).unwrap();
        assert!((broad - ((1.0 - 0.85_f64.powi(2)) / 0.25).powi(2).cbrt()).abs() < 1e-12 && broad < LEAVES);
        assert_eq!(left_by_one_lag(&[]), None);
    }

    #[test]
    fn unrelated_signals_have_no_lag() {
        for seed in 1..6 {
            let (a, b) = (noise(seed, 600), noise(seed + 100, 600));
            assert!(peak(&a, &b, 100..500, (-10, 20), 0.01).is_none(), "seed {seed}");
        }
        assert!(peak(&[0.0; 50], &[0.0; 50], 20..30, (-10, 10), 0.01).is_none());
    }

    /// One flight hovers in the noise of its gyro, which its controller answers; another moves.
    #[test]
    fn a_craft_that_hovers_in_the_noise_of_its_gyro_shows_no_lag() {
        let still = prepared(3000, |time_s, row| {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64((100.0 * time_s).round() as u64);
            let felt = 0.02 * (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
            row.rate_rad_s[0] += felt;
            for (command, sign) in row.command.iter_mut().zip(SIGNS[0]) {
                *command -= 300.0 * sign * felt;
            }
        });
        assert!(clear_pieces(&still, &Vehicle::thesis()).is_empty());
        let moving = crate::testing::fly(&crate::testing::truth(), 50, 30.0, &crate::testing::ORDINARY);
        let moving = Prepared::new(&moving, &Vehicle::thesis()).unwrap();
        assert!(clear_pieces(&moving, &Vehicle::thesis()).len() >= FEWEST_LAGS);
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
