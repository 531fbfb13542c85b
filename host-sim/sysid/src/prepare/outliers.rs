//! Gross outliers: single samples that no neighbour knows of.
//!
//! A tracker swaps two markers for a frame, a bus garbles a word: one sample in a hundred, or in twenty, is off by ten or a
//! thousand times the noise. Least squares squares that. Such a sample is recognised by its six neighbours: it is far from the
//! line through them (Theil 1950 and Sen 1968: medians, which one or two further spikes among the six do not move), by the
//! noise of the channel and by how well the line fits the neighbours themselves. So a quick turn, which no neighbour lies on a
//! line with, is no spike, and nor is a step, which half of the neighbours share.
//!
//! Where spikes come in a crowd, four among seven, that line is lost. There a sample is held against the parabola that most of its
//! neighbourhood agrees on (least median of squares' idea, Rousseeuw 1984; found as RANSAC does, but over all triples): it
//! must be more than half of all, so a step still has none.
//!
//! What is found is missing from then on and bridged as missing values are. Errors of several samples in a row are
//! `channels_check.rs`' to find: jumps and frozen trackers.

use std::borrow::Cow;

use crate::statistics::median;

/// Neighbours on each side, where there are as many.
const REACH: usize = 3;
/// A spike is off the line through its neighbours by this many times the usual distance from it: one in 10^8 of Gaussian
/// noise.
const OF_NOISE: f64 = 6.0;
/// And by this many times the neighbours' own median distance from it: a parabola through all seven has 1.6 times.
const OF_NEIGHBOURS: f64 = 8.0;
/// Both are this many times as much at the ends, where the neighbours are on one side: a line's end is 3.5 samples from its
/// middle, and a parabola leaves it by 4 times what it does at the middle.
const DRAWN_OUT: f64 = 3.0;
/// A sample that far between its two neighbours, in usual distances, is looked at.
const LOOKED_AT: f64 = 3.0;
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
/// A spike in a crowd, like its companions, is off the parabola by this many usual distances. Real sensors have restless moments
/// in which samples are off by anything up to that, and belong there:
const GROSS: f64 = 20.0;
/// where more than this many neighbours are neither on the parabola nor gross, nothing is said.
const DOUBTFUL: usize = 1;

/// Part of the samples that are spikes from which on crowds are looked for: where one in a hundred is, four of seven never
/// are by chance, and what looks like it is the craft.
const FREQUENT: f64 = 0.02;

/// Looks at a channel: two spikes among the neighbours hide a third, until they are gone.
const PASSES: usize = 5;

/// Makes the spikes of a channel missing; how many there were. `channel` is copied only if there are any. `time` is in periods;
/// neighbours across one of `gaps`, the first sample after each, are none. `crowds` says whether the channel is smooth enough for a
/// parabola over a tenth of a second; a rotor, which a command kicks, is not.
pub(crate) fn take_out(channel: &mut Cow<[f64]>, time: &[f64], gaps: &[usize], crowds: bool) -> usize {
    let most = (MOST * channel.len() as f64) as usize;
    let mut all: Vec<usize> = Vec::new();
    // A good sample among bad ones looks like a bad one, until these are gone. It is given back for good.
    let mut given_back: Vec<usize> = Vec::new();
    let mut cleaned: Cow<[f64]> = Cow::Borrowed(&**channel);
    for _ in 0..2 * PASSES {
        let in_crowds = crowds && all.len() as f64 > FREQUENT * channel.len() as f64;
        let usual = usual_distance(&cleaned);
        let starts = std::iter::once(0).chain(gaps.iter().copied());
        let ends = gaps.iter().copied().chain([channel.len()]);
        let found: Vec<usize> = starts
            .zip(ends)
            .flat_map(|(start, end)| {
                let piece = spikes(&cleaned[start..end], &time[start..end], usual, in_crowds);
                piece.into_iter().map(move |k| start + k)
            })
            .filter(|k| !given_back.contains(k))
            .collect();
        let belongs = |&k: &usize| {
            let (start, end) = piece_of(k, gaps, channel.len());
            let expected = expected_in_a_crowd(&cleaned[start..end], &time[start..end], k - start, usual);
            expected.is_some_and(|(expected, _)| (channel[k] - expected).abs() < OF_NOISE * usual)
        };
        let wronged: Vec<usize> = all.iter().copied().filter(|k| in_crowds && belongs(k)).collect();
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
    if all.len() > most {
        return 0;
    }
    if !all.is_empty() {
        let values = channel.to_mut();
        all.iter().for_each(|&k| values[k] = f64::NAN);
    }
    all.len()
}

/// From which sample on and up to which there is no gap around a sample.
fn piece_of(k: usize, gaps: &[usize], length: usize) -> (usize, usize) {
    let next = gaps.partition_point(|&gap| gap <= k);
    let start = if next == 0 { 0 } else { gaps[next - 1] };
    (start, gaps.get(next).copied().unwrap_or(length))
}

/// The samples of a channel that are spikes as far as their neighbours can tell.
fn spikes(channel: &[f64], time: &[f64], usual: f64, crowds: bool) -> Vec<usize> {
    if !(usual > 0.0) || channel.is_empty() {
        return Vec::new();
    }
    let last = channel.len() - 1;
    let is_off = |&k: &usize| {
        // Next to a missing value, and at the ends, there is no telling this way.
        let near = k > 0
            && k < last
            && (channel[k] - 0.5 * (channel[k - 1] + channel[k + 1])).abs() < LOOKED_AT * usual;
        !near && channel[k].is_finite()
    };
    (0..channel.len())
        .filter(is_off)
        .filter(|&k| is_spike(channel, time, k, usual, crowds) == Some(true))
        .collect()
}

/// Standard deviation of a sample about the mean of its neighbours, by the median: spikes do not count.
fn usual_distance(channel: &[f64]) -> f64 {
    let mut distances: Vec<f64> = channel
        .windows(3)
        .map(|w| (w[1] - 0.5 * (w[0] + w[2])).abs())
        .filter(|distance| distance.is_finite())
        .collect();
    if distances.len() < 10 {
        return 0.0;
    }
    let middle = distances.len() / 2;
    // The median of |x| is 0.6745 of a normal deviation.
    *distances.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745
}

/// Nothing where there are too few neighbours to tell.
fn is_spike(channel: &[f64], time: &[f64], k: usize, usual: f64, crowds: bool) -> Option<bool> {
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
        return crowds.then(|| is_spike_in_a_crowd(channel, time, k, usual));
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
    levels[..count].iter_mut().for_each(|value| *value = (*value - level).abs());
    let own = (channel[k] - level).abs();
    // From one side the line is drawn out to where it is not known as well.
    let reach = if k - first == REACH { 1.0 } else { DRAWN_OUT };
    let of_noise = reach * OF_NOISE * usual;
    let of_neighbours = reach * OF_NEIGHBOURS * median(&mut levels[..count])?;
    Some(own > of_noise && (own > of_neighbours || (crowds && is_spike_in_a_crowd(channel, time, k, usual))))
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
                    if off < OF_NOISE * usual {
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
        let count = take_out(&mut cleaned, &time, &[], true);
        let gone: Vec<usize> = (0..channel.len()).filter(|&k| cleaned[k].is_nan()).collect();
        assert_eq!(gone.len(), count);
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
}
