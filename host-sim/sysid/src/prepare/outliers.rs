//! Gross outliers: single samples that no neighbour knows of.
//!
//! A tracker swaps two markers for a frame, a bus garbles a word: one sample in a hundred, or in twenty, is off by ten or a
//! thousand times the noise. Least squares squares that. Such a sample is recognised by its six neighbours: it is far from the
//! line through them (Theil 1950 and Sen 1968: medians, which one or two further spikes among the six do not move), by the
//! noise of the channel there and by how well all of them but one lie on the line. So a quick turn, which no neighbour lies on a
//! line with, is no spike, and nor is a step, which half of the neighbours share, or the corner that an estimator's correction or
//! an interpolated log leaves: there two neighbours are off the line as well. (With the neighbours' median instead, one sample in
//! ten of real brisk flights was taken for a spike, of channels whose noise is rare corners on a smooth curve.)
//!
//! The noise is that of the second around the sample or of the whole channel, whichever is more: a craft is restless for a while
//! and quiet for another, and the quiet part says nothing about what is gross in the restless one.
//!
//! Where spikes come in a crowd, four among seven, that line is lost. There a sample is held against the parabola that most of its
//! neighbourhood agrees on (least median of squares' idea, Rousseeuw 1984; found as RANSAC does, but over all triples): it
//! must be more than half of all, so a step still has none.
//!
//! What is found is missing from then on and bridged as missing values are. Errors of several samples in a row are
//! `channels_check.rs`' to find: jumps and frozen trackers.

use std::borrow::Cow;
use std::ops::Range;

use flights::Column;

use crate::statistics::median;

/// A value that was taken for a gross outlier and is missing from then on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Row of the log, or sample of a stretch; from zero.
    pub row: usize,
    /// Its time, s.
    pub t_s: f64,
    /// Which value of the row.
    pub column: Column,
    /// As logged, in the unit of the column; an angle unwrapped.
    pub value: f64,
}

/// Neighbours on each side, where there are as many.
const REACH: usize = 3;
/// A spike is off the line through its neighbours by this many times the usual distance from it. Six would be one in 10^8 of
/// Gaussian noise; the noise of real channels has longer tails, and what is less than ten times the noise is not gross.
const OF_NOISE: f64 = 10.0;
/// And by this many times what all its neighbours but one are off it: a parabola through all seven has 0.8 times.
const OF_NEIGHBOURS: f64 = 6.0;
/// A next neighbour within so many usual distances of the sample shows a value that was there for two samples: an excursion,
/// which is not this file's. Two spikes side by side are that much alike once in a hundred times.
const ALIKE: f64 = 2.0;
/// Both are this many times as much at the ends, where the neighbours are on one side: a line's end is 3.5 samples from its
/// middle, and a parabola leaves it by 4 times what it does at the middle.
const DRAWN_OUT: f64 = 3.0;
/// A sample that far between its two neighbours, in usual distances, is looked at.
const LOOKED_AT: f64 = 3.0;
/// The median distance of a normal deviation of one.
const MIDDLE_OF_NORMAL: f64 = 0.6745;
/// A quantile that the scale of a whole channel is taken from as well, and the distance there: where a channel is quiet for more
/// than half of the time (on an even slope, say) the median says nothing about the rest. One sample in twenty that is a
/// spike spoils one distance in seven.
const UPPER: f64 = 0.8;
const UPPER_OF_NORMAL: f64 = 1.2816;
/// Samples over which the noise is taken to be one; it is taken from as many on either side as well: 1.5 s at 100 Hz.
const RESTLESS: usize = 50;
/// Part of the samples beyond which it is no noise with outliers but a channel of another kind (one that is held, say).
const MOST: f64 = 0.15;

/// Spikes among the six next neighbours, found ones included, that make a crowd.
const CROWD: usize = 2;
/// Neighbours on each side of a sample in a crowd.
const CROWD_REACH: usize = 6;
/// Samples of the neighbourhood that must agree on a parabola: more than there are on one side.
const AGREE: usize = CROWD_REACH + 1;

/// As many of them at least before the sample, and after it: what a drift and its correction leave is no spike.
const ON_EACH_SIDE: usize = 3;
/// A sample within so many usual distances of the parabola is on it.
const ON_PARABOLA: f64 = 6.0;
/// A spike in a crowd, like its companions, is off the parabola by this many usual distances. Real sensors have restless moments
/// in which samples are off by anything up to that, and belong there:
const GROSS: f64 = 20.0;
/// where more than this many neighbours are neither on the parabola nor gross, nothing is said.
const DOUBTFUL: usize = 1;

/// Part of the samples that are spikes by all of this from which on a channel is known to have them, and these are asked of the
/// rest: what most neighbours are off the line counts, for one of them in four has a spike beside it; what is beyond Gaussian
/// noise is one, and so are two in a row that happen to be alike. Of real flights without a spiking sensor, no channel comes to a third of that.
const SPIKING: f64 = 0.01;
const OF_NOISE_AMONG_SPIKES: f64 = 6.0;
const OF_MOST_NEIGHBOURS: f64 = 8.0;

/// Part of the samples that are spikes from which on crowds are looked for: where one in a hundred is, four of seven never
/// are by chance, and what looks like it is the craft.
const FREQUENT: f64 = 0.02;

/// Looks at a channel: two spikes among the neighbours hide a third, until they are gone.
const PASSES: usize = 5;

/// Makes the spikes of a channel missing; which samples they were, in order. `channel` is copied only if there are any. `time` is in periods;
/// neighbours across one of `gaps`, the first sample after each, are none. `crowds` says whether the channel is smooth enough for a
/// parabola over a tenth of a second; a rotor, which a command kicks, is not.
pub(crate) fn take_out(channel: &mut Cow<[f64]>, time: &[f64], gaps: &[usize], crowds: bool) -> Vec<usize> {
    let most = (MOST * channel.len() as f64) as usize;
    let mut all: Vec<usize> = Vec::new();
    // A good sample among bad ones looks like a bad one, until these are gone. It is given back for good.
    let mut given_back: Vec<usize> = Vec::new();
    let mut cleaned: Cow<[f64]> = Cow::Borrowed(&**channel);
    for _ in 0..2 * PASSES {
        let part = all.len() as f64 / channel.len().max(1) as f64;
        let in_crowds = crowds && part > FREQUENT;
        let among = Among { spikes: part > SPIKING, crowds: in_crowds };
        let mut noise = Noise::of(&cleaned);
        let starts = std::iter::once(0).chain(gaps.iter().copied());
        let ends = gaps.iter().copied().chain([channel.len()]);
        let mut found: Vec<usize> = Vec::new();
        for (start, end) in starts.zip(ends) {
            let piece = Piece { channel: &cleaned[start..end], time: &time[start..end], start };
            found.extend(piece.spikes(&mut noise, among));
        }
        found.retain(|k| !given_back.contains(k));
        let mut belongs = |k: usize| {
            let (start, end) = piece_of(k, gaps, channel.len());
            let usual = noise.usual(k);
            let expected = expected_in_a_crowd(&cleaned[start..end], &time[start..end], k - start, usual);
            expected.is_some_and(|(expected, _)| (channel[k] - expected).abs() < ON_PARABOLA * usual)
        };
        let wronged: Vec<usize> = all.iter().copied().filter(|&k| in_crowds && belongs(k)).collect();
        if found.is_empty() && wronged.is_empty() {
            break;
        }
        let values = cleaned.to_mut();
        found.iter().for_each(|&k| values[k] = f64::NAN);
        wronged.iter().for_each(|&k| values[k] = channel[k]);
        all.extend(found);
        all.retain(|k| !wronged.contains(k));
        given_back.extend(wronged);
    }
    if all.is_empty() || all.len() > most {
        return Vec::new();
    }
    let values = channel.to_mut();
    all.iter().for_each(|&k| values[k] = f64::NAN);
    all.sort_unstable();
    all
}

/// What is known of a channel so far.
#[derive(Debug, Clone, Copy)]
struct Among {
    /// It has spikes, more than a few.
    spikes: bool,
    /// It has so many that they come in crowds.
    crowds: bool,
}

/// From which sample on and up to which there is no gap around a sample.
fn piece_of(k: usize, gaps: &[usize], length: usize) -> (usize, usize) {
    let next = gaps.partition_point(|&gap| gap <= k);
    let start = if next == 0 { 0 } else { gaps[next - 1] };
    (start, gaps.get(next).copied().unwrap_or(length))
}

/// Samples of a channel without a gap among them.
struct Piece<'a> {
    channel: &'a [f64],
    time: &'a [f64],
    /// Its first sample's number in the channel.
    start: usize,
}

impl Piece<'_> {
    /// The samples that are spikes as far as their neighbours can tell, by their numbers in the channel.
    fn spikes(&self, noise: &mut Noise, among: Among) -> Vec<usize> {
        let Self { channel, time, start } = *self;
        let mut found = Vec::new();
        if noise.of_all <= 0.0 || channel.is_empty() {
            return found;
        }
        let last = channel.len() - 1;
        for first in (0..channel.len()).step_by(RESTLESS) {
            let block = first..(first + RESTLESS).min(channel.len());
            let is_end = block.contains(&0) || block.contains(&last);
            if !is_end && noise.are_all_near(start + block.start..start + block.end) {
                continue;
            }
            for k in block {
                // Next to a missing value, and at the ends, there is no telling this way.
                let near = k > 0 && k < last && noise.is_near(start + k);
                let mut is_spike = || is_spike(channel, time, k, noise.usual(start + k), among) == Some(true);
                if !near && channel[k].is_finite() && is_spike() {
                    found.push(start + k);
                }
            }
        }
        found
    }
}

/// How far the samples of a channel usually are from the mean of their neighbours.
struct Noise {
    /// Of each sample; not a number at the ends and beside a missing value.
    distances: Vec<f64>,
    /// The standard deviation over the whole channel, by quantiles: spikes do not count. Zero where nothing moves.
    of_all: f64,
    /// The larger of that and of the one about each [`RESTLESS`] samples, once it has been asked for: few blocks hold anything to look at.
    of_blocks: Vec<Option<f64>>,
}

impl Noise {
    fn of(channel: &[f64]) -> Self {
        let mut distances = vec![f64::NAN; channel.len()];
        if let [_, inner @ .., _] = &mut distances[..] {
            let neighbours = channel.iter().zip(&channel[1..]).zip(&channel[2..]);
            for (distance, ((before, own), after)) in inner.iter_mut().zip(neighbours) {
                *distance = (own - 0.5 * (before + after)).abs();
            }
        }
        // Spikes that happen to crowd in a second may be one in ten there: only the median stands that.
        let [middle, upper] = quantiles(&distances, [0.5, UPPER]);
        let of_all = f64::max(middle / MIDDLE_OF_NORMAL, upper / UPPER_OF_NORMAL);
        let of_blocks = vec![None; channel.len().div_ceil(RESTLESS)];
        Self { distances, of_all, of_blocks }
    }

    /// At a sample, the larger of that around it and of the whole channel; zero where nothing moves.
    fn usual(&mut self, k: usize) -> f64 {
        let Self { distances, of_all, of_blocks } = self;
        if *of_all <= 0.0 {
            return 0.0;
        }
        let block = k / RESTLESS;
        *of_blocks[block].get_or_insert_with(|| {
            let from = (block * RESTLESS).saturating_sub(RESTLESS);
            let to = ((block + 2) * RESTLESS).min(distances.len());
            let [middle] = quantiles(&distances[from..to], [0.5]);
            of_all.max(middle / MIDDLE_OF_NORMAL)
        })
    }

    /// Whether a sample is too near its neighbours' mean to be looked at.
    fn is_near(&mut self, k: usize) -> bool {
        let distance = self.distances[k];
        distance < LOOKED_AT * self.of_all || distance < LOOKED_AT * self.usual(k)
    }

    /// Whether all are, by the noise of the whole channel: that of any part counts only where it is more.
    fn are_all_near(&self, samples: Range<usize>) -> bool {
        let near = LOOKED_AT * self.of_all;
        // Without leaving early, which is quicker.
        self.distances[samples].iter().fold(true, |all, distance| all & (*distance < near))
    }
}

/// Quantiles of what is finite and not zero, ascending; zeros of fewer than ten values. A distance of exactly zero is that of a held or
/// coarsely rounded value and tells nothing of noise.
fn quantiles<const N: usize>(values: &[f64], parts: [f64; N]) -> [f64; N] {
    // Bits of positive numbers are in the numbers' order, and integers are compared at once.
    let mut bits = Vec::with_capacity(values.len());
    bits.extend(
        values.iter().filter(|value| value.is_finite() && **value > 0.0).map(|value| value.to_bits()),
    );
    let count = bits.len();
    let mut found = [0.0; N];
    if count < 10 {
        return found;
    }
    // Below a quantile that is found are all that a smaller one can be.
    let mut left = &mut bits[..];
    for (found, part) in found.iter_mut().zip(parts).rev() {
        let at = (part * count as f64) as usize;
        *found = f64::from_bits(*left.select_nth_unstable(at).1);
        left = &mut left[..=at];
    }
    found
}

/// Nothing where there are too few neighbours to tell.
fn is_spike(channel: &[f64], time: &[f64], k: usize, usual: f64, among: Among) -> Option<bool> {
    let mut neighbours = [(0.0, 0.0); 2 * REACH];
    let mut count = 0;
    // At an end, all of them are on one side.
    let first = k.saturating_sub(REACH).min(channel.len().saturating_sub(2 * REACH + 1));
    for (j, value) in channel.iter().enumerate().skip(first).take(2 * REACH + 1) {
        if j != k && value.is_finite() {
            neighbours[count] = (time[j] - time[k], *value);
            count += 1;
        }
    }
    let neighbours = &neighbours[..count];
    if count < REACH + 1 {
        // So many of its neighbours were spikes, or are missing.
        return among.crowds.then(|| is_spike_in_a_crowd(channel, time, k, usual));
    }
    let mut slopes = [0.0; REACH * (2 * REACH - 1)];
    let mut pairs = 0;
    for (i, (t, value)) in neighbours.iter().enumerate() {
        for (other_t, other) in &neighbours[..i] {
            slopes[pairs] = (value - other) / (t - other_t);
            pairs += 1;
        }
    }
    let slope = median(&mut slopes[..pairs])?;
    let mut levels = [0.0; 2 * REACH];
    levels.iter_mut().zip(neighbours).for_each(|(level, (t, value))| *level = value - slope * t);
    let level = median(&mut levels[..count])?;
    let off = channel[k] - level;
    let own = off.abs();
    // From one side the line is drawn out to where it is not known as well.
    let reach = if k - first == REACH { 1.0 } else { DRAWN_OUT };
    let of_noise = if among.spikes { OF_NOISE_AMONG_SPIKES } else { OF_NOISE };
    if own <= reach * of_noise * usual || !among.spikes && stays(channel, k, usual) {
        return Some(false);
    }
    levels[..count].iter_mut().for_each(|value| *value = (*value - level).abs());
    levels[..count].sort_unstable_by(f64::total_cmp);
    let alone = match among.spikes {
        true => own > reach * OF_MOST_NEIGHBOURS * levels[(count - 1) / 2],
        false => own > reach * OF_NEIGHBOURS * levels[count - 2],
    };
    Some(alone || (among.crowds && is_spike_in_a_crowd(channel, time, k, usual)))
}

/// Whether a next neighbour has the same value but for the noise.
fn stays(channel: &[f64], k: usize, usual: f64) -> bool {
    let alike = |j: Option<usize>| {
        j.and_then(|j| channel.get(j)).is_some_and(|value| (value - channel[k]).abs() < ALIKE * usual)
    };
    alike(k.checked_sub(1)) || alike(Some(k + 1))
}

/// Whether enough of the neighbourhood lies on a parabola, and the sample does not.
fn is_spike_in_a_crowd(channel: &[f64], time: &[f64], k: usize, usual: f64) -> bool {
    expected_in_a_crowd(channel, time, k, usual).is_some_and(|(expected, companions)| {
        companions >= CROWD && (channel[k] - expected).abs() > GROSS * usual
    })
}

/// What the parabola that enough of the neighbourhood lies on has at a sample, and how many of the next neighbours are missing or far off
/// it.
fn expected_in_a_crowd(channel: &[f64], time: &[f64], k: usize, usual: f64) -> Option<(f64, usize)> {
    if k < CROWD_REACH || k + CROWD_REACH >= channel.len() {
        return None;
    }
    let mut around = [(0.0, 0.0); 2 * CROWD_REACH];
    let mut count = 0;
    for j in (k - CROWD_REACH..=k + CROWD_REACH).filter(|&j| j != k && channel[j].is_finite()) {
        around[count] = (time[j] - time[k], channel[j]);
        count += 1;
    }
    let around = &around[..count];
    let missing = (k - REACH..=k + REACH).filter(|&j| !channel[j].is_finite()).count();
    let mut best = (0, (0, 0), 0, 0.0);
    for a in 0..count {
        for b in 0..a {
            for c in 0..b {
                let curve = parabola(around[a], around[b], around[c]);
                let (mut agree, mut beside, mut companions) = (0, 0, missing);
                let mut sides = (0, 0);
                for (t, value) in around {
                    let off = (value - curve(*t)).abs();
                    if off < ON_PARABOLA * usual {
                        agree += 1;
                        *(if *t < 0.0 { &mut sides.0 } else { &mut sides.1 }) += 1;
                    } else if off < GROSS * usual {
                        beside += 1;
                    } else if t.abs() < REACH as f64 + 0.5 {
                        companions += 1;
                    }
                }
                if beside <= DOUBTFUL && agree > best.0 {
                    best = (agree, sides, companions, curve(0.0));
                }
            }
        }
    }
    let (agree, sides, companions, expected) = best;
    (agree >= AGREE && sides.0.min(sides.1) >= ON_EACH_SIDE).then_some((expected, companions))
}

/// The parabola through three points (Newton's divided differences).
fn parabola(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> impl Fn(f64) -> f64 {
    let ab = (b.1 - a.1) / (b.0 - a.0);
    let bc = (c.1 - b.1) / (c.0 - b.0);
    let abc = (bc - ab) / (c.0 - a.0);
    move |t| a.1 + (t - a.0) * (ab + (t - b.0) * abc)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// A craft that turns as hard as crafts turn, seen with noise.
    fn flown(rng: &mut Pcg64Mcg, noise: f64) -> Vec<f64> {
        let wave = |k: usize, hz: f64| (std::f64::consts::TAU * hz * 0.01 * k as f64).sin();
        (0..3000)
            .map(|k| {
                // Nearly normal, and six deviations off at most.
                let e: f64 = (0..12).map(|_| rng.random::<f64>() - 0.5).sum();
                0.8 * wave(k, 0.4) + 0.05 * wave(k, 3.1) + 0.01 * wave(k, 7.3) + noise * e
            })
            .collect()
    }

    fn taken_out(channel: &[f64]) -> Vec<usize> {
        let mut cleaned = Cow::Borrowed(channel);
        let time: Vec<f64> = (0..channel.len()).map(|k| k as f64).collect();
        let gone = take_out(&mut cleaned, &time, &[], true);
        assert_eq!(gone, (0..channel.len()).filter(|&k| cleaned[k].is_nan()).collect::<Vec<_>>());
        gone
    }

    #[test]
    fn every_gross_outlier_is_found_and_nothing_else() {
        let mut missed = 0;
        for seed in 0..20 {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let clean = flown(&mut rng, 0.001);
            // Of 3000 samples none is six deviations off.
            assert_eq!(taken_out(&clean), [0_usize; 0], "seed {seed}");
            let mut spiky = clean.clone();
            let hit: Vec<usize> = (0..3000).filter(|_| rng.random_bool(0.05)).collect();
            for &k in &hit {
                spiky[k] += if rng.random_bool(0.5) { 1.0 } else { -1.0 } * rng.random_range(0.05..0.5);
            }
            let found = taken_out(&spiky);
            let wrong = found.iter().filter(|k| !hit.contains(k)).count();
            // Where three of seven are hit a good one may look like the one that is off: some of a thousand.
            assert!(wrong <= 2, "seed {seed}: {wrong}");
            missed += hit.iter().filter(|k| !found.contains(k)).count();
        }
        // Of 3000: one at an end, with others beside it, cannot be told.
        assert!(missed <= 3, "{missed}");
    }

    /// Five of eight samples of a gyro were off, and the one good one among the first four was taken for the spike.
    #[test]
    fn a_good_sample_among_bad_ones_is_given_back() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let mut channel = flown(&mut rng, 0.004);
        // Spikes are frequent enough for crowds to be looked for.
        let singles: Vec<usize> = (20..2900).step_by(35).filter(|k| !(1200..1300).contains(k)).collect();
        singles.iter().for_each(|&k| channel[k] += 0.7);
        let crowd = [1258, 1259, 1260, 1262, 1265];
        for (k, off) in crowd.into_iter().zip([-5.7, -4.7, 1.2, -1.7, -5.7]) {
            channel[k] += off;
        }
        let mut bad: Vec<usize> = singles.into_iter().chain(crowd).collect();
        bad.sort_unstable();
        assert_eq!(taken_out(&channel), bad);
    }

    #[test]
    fn motion_without_noise_steps_and_held_values_are_no_spikes() {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        assert_eq!(taken_out(&flown(&mut rng, 0.0)), [0_usize; 0]);
        let step: Vec<f64> =
            flown(&mut rng, 0.001).iter().enumerate().map(|(k, v)| v + f64::from(k > 900)).collect();
        assert_eq!(taken_out(&step), [0_usize; 0]);
        let held: Vec<f64> = (0..3000).map(|k| (f64::from(k / 7) * 0.37).sin()).collect();
        assert_eq!(taken_out(&held), [0_usize; 0]);
        assert_eq!(taken_out(&[0.0; 500]), [0_usize; 0]);
    }

    /// What an estimator logs: a smooth curve that a correction moves every third of a second, and the corner which linear
    /// interpolation to the log's rate makes of it. Of these channels one sample in twenty was called an outlier.
    #[test]
    fn corners_of_an_estimators_corrections_are_no_spikes() {
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        let mut moved = 0.0;
        let mut curve = flown(&mut rng, 0.0002);
        for (k, value) in curve.iter_mut().enumerate() {
            if k % 35 == 17 {
                moved += rng.random_range(-0.02..0.02);
            }
            *value += moved;
        }
        let logged: Vec<f64> = (0..3000)
            .map(|k| {
                let at = 0.93 * k as f64;
                let (whole, part) = (at as usize, at.fract());
                curve[whole] + part * (curve[whole + 1] - curve[whole])
            })
            .collect();
        assert_eq!(taken_out(&logged), [0_usize; 0]);
    }

    /// A hover, then a second of quick turns with fifty times the noise: each part has its own.
    /// In a channel with a spike in every twenty samples, two in a row of the same size are spikes too.
    #[test]
    fn two_alike_spikes_are_spikes_where_there_are_many() {
        let mut rng = Pcg64Mcg::seed_from_u64(6);
        let mut channel = flown(&mut rng, 0.0002);
        let mut spikes: Vec<usize> = (10..channel.len() - 10).step_by(20).collect();
        for (i, &k) in spikes.iter().enumerate() {
            channel[k] += if i % 2 == 0 { 0.2 } else { -0.15 };
        }
        channel[1015] += 0.115;
        channel[1016] += 0.115;
        spikes.extend([1015, 1016]);
        spikes.sort_unstable();
        assert_eq!(taken_out(&channel), spikes);
    }

    #[test]
    fn what_is_gross_in_a_hover_is_noise_in_a_brisk_manoeuvre() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut channel: Vec<f64> = (0..2000)
            .map(|k| {
                let noise: f64 = (0..12).map(|_| rng.random::<f64>() - 0.5).sum();
                if (900..1100).contains(&k) { 0.5 * noise } else { 0.01 * noise }
            })
            .collect();
        assert_eq!(taken_out(&channel), [0_usize; 0]);
        channel[400] += 0.5;
        channel[1000] += 20.0;
        assert_eq!(taken_out(&channel), [400, 1000]);
    }
}
