//! Stretches without gaps on an even grid: missing values bridged, jitter interpolated away.

use std::borrow::Cow;
use std::ops::Range;

use flights::{GAP_PERIODS, interpolated};

use crate::prepare::columns::{BATTERY, COMMAND};

/// Missing values in a row that are bridged.
const BRIDGED_SAMPLES: usize = 3;

/// Missing battery voltages in a row that are bridged.
const BRIDGED_BATTERY_SAMPLES: usize = 200;

/// Steps that differ from the period by more than this part are jitter to be interpolated away.
const JITTER: f64 = 0.02;
/// Standard errors by which the lateness of rows may be more than their steps show.
const CERTAIN: f64 = 2.0;
/// Where rows are off an even grid by much more than each is late by itself, their times walk: the loop runs unevenly.
const SHARE_OF_A_WALK: f64 = 0.5;

/// Bridges runs of up to [`BRIDGED_SAMPLES`] missing values: along cubic arcs, as a straight line
/// under a turn would be low by more than the noise; the battery and commands, which are held, by a
/// straight line. Nothing but the battery is bridged across a gap in time. Returns the number of
/// values filled in, the battery's aside.
pub(crate) fn bridge(t: &[f64], columns: &mut [Cow<[f64]>], period_s: f64) -> usize {
    let has_gap = |rows: &[usize]| (rows[0]..rows[1]).any(|k| t[k + 1] - t[k] > GAP_PERIODS * period_s);
    let mut count = 0;
    for (index, column) in columns.iter_mut().enumerate() {
        // A battery is slow and often logged at a tenth of the rate.
        let longest = if index == BATTERY { BRIDGED_BATTERY_SAMPLES } else { BRIDGED_SAMPLES };
        // Without leaving early, which is quicker where all are there.
        if column.iter().fold(true, |all, v| all & v.is_finite()) {
            continue;
        }
        let there: Vec<usize> = (0..column.len()).filter(|&k| column[k].is_finite()).collect();
        let (times, values): (Vec<f64>, Vec<f64>) = there.iter().map(|&k| (t[k], column[k])).unzip();
        let straight = (COMMAND..=BATTERY).contains(&index);
        let column = column.to_mut();
        for (at, ends) in there.windows(2).enumerate() {
            let missing = ends[1] - ends[0] - 1;
            if missing == 0 || missing > longest || (index != BATTERY && has_gap(ends)) {
                continue;
            }
            for k in ends[0] + 1..ends[1] {
                column[k] = if straight {
                    let part = (t[k] - times[at]) / (times[at + 1] - times[at]);
                    values[at] + (values[at + 1] - values[at]) * part
                } else {
                    interpolated(&times, &values, at, t[k])
                };
                count += usize::from(index != BATTERY);
            }
        }
    }
    count
}

/// Ranges of samples without gaps in time and without missing values.
pub(crate) fn unbroken(t: &[f64], columns: &[Cow<[f64]>], period_s: f64) -> Vec<Range<usize>> {
    let mut complete = vec![true; t.len()];
    for column in columns {
        complete.iter_mut().zip(column.iter()).for_each(|(all, v)| *all &= v.is_finite());
    }
    let mut ranges = Vec::new();
    let mut start = None;
    for k in 0..t.len() {
        let gap = k > 0 && t[k] - t[k - 1] > GAP_PERIODS * period_s;
        if let Some(from) = start
            && (gap || !complete[k])
        {
            ranges.push(from..k);
            start = None;
        }
        if complete[k] && start.is_none() {
            start = Some(k);
        }
    }
    if let Some(from) = start {
        ranges.push(from..t.len());
    }
    ranges
}

pub(crate) struct EvenGrid {
    pub(crate) time_s: Vec<f64>,
    /// Standard deviation of the samples' times about the grid, s.
    pub(crate) jitter_s: f64,
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) measured: Vec<bool>,
}

impl EvenGrid {
    /// Columns from `first` on, moved out.
    pub(crate) fn take<const N: usize>(&mut self, first: usize) -> [Vec<f64>; N] {
        std::array::from_fn(|i| std::mem::take(&mut self.columns[first + i]))
    }
}

/// The samples on an even grid: as they are when the log is even, else interpolated (commands are
/// held, the rest runs along cubic Hermite arcs).
pub(crate) fn even_grid(
    t: &[f64],
    columns: &[Cow<[f64]>],
    measured: &[bool],
    range: Range<usize>,
    period_s: f64,
    notes: &mut Vec<String>,
) -> EvenGrid {
    let times = &t[range.clone()];
    let uneven = times.windows(2).filter(|w| ((w[1] - w[0]) / period_s - 1.0).abs() > JITTER).count();
    if uneven == 0 {
        return EvenGrid {
            time_s: times.to_vec(),
            jitter_s: 0.0,
            columns: columns.iter().map(|c| c[range.clone()].to_vec()).collect(),
            measured: measured[range].to_vec(),
        };
    }
    notes.push(format!("{uneven} uneven sampling steps interpolated to {:.1} Hz", 1.0 / period_s));
    let (start, deviation_s) = grid_start(times, period_s);
    let jitter_s = deviation_s.min(lateness_s(times, period_s));
    let walks = jitter_s < SHARE_OF_A_WALK * deviation_s;
    let count = ((times[times.len() - 1] - start) / period_s).floor() as usize + 1;
    let grid: Vec<f64> = (0..count).map(|k| start + k as f64 * period_s).collect();
    // The sample before each moment of the grid.
    let mut at = 0;
    let before: Vec<usize> = grid
        .iter()
        .map(|&time| {
            while at + 2 < times.len() && times[at + 1] <= time {
                at += 1;
            }
            at
        })
        .collect();
    let measured = before.iter().map(|&at| {
        let lost_rows = times[at + 1] - times[at] > 1.5 * period_s;
        !lost_rows && measured[range.start + at] && measured[range.start + at + 1]
    });
    let measured = measured.collect();
    let columns = columns.iter().enumerate().map(|(index, column)| {
        let values = &column[range.clone()];
        let held = (COMMAND..BATTERY).contains(&index);
        let at_time = |(&time, &at): (&f64, &usize)| {
            if held && walks {
                mean_held(times, values, at, time..time + period_s)
            } else if held {
                // A row that is a little late tells of a command that has already been there.
                values[at + usize::from(times[at + 1] - time < 0.5 * period_s)]
            } else {
                interpolated(times, values, at, time)
            }
        };
        grid.iter().zip(&before).map(at_time).collect()
    });
    EvenGrid { time_s: grid.clone(), jitter_s, columns: columns.collect(), measured }
}

/// Where an even grid starts that lies in the middle of jittering times: one that began at a late
/// row would be late throughout, and every command on it. With the standard deviation of the times
/// about it.
fn grid_start(times: &[f64], period_s: f64) -> (f64, f64) {
    let off = |t: &f64| {
        let periods = (t - times[0]) / period_s;
        periods - periods.round()
    };
    let count = times.len() as f64;
    let mean = times.iter().map(off).sum::<f64>() / count;
    let variance = times.iter().map(|t| (off(t) - mean).powi(2)).sum::<f64>() / count;
    let start = times[0] + period_s * mean;
    (if start < times[0] { start + period_s } else { start }, period_s * variance.sqrt())
}

/// Standard deviation, s, of how late single rows are against an even process behind them, at most.
///
/// A row that is late by itself makes the step before it longer and the one after it shorter: the covariance of steps side by side is
/// less the variance of that lateness. Steps that are uneven each by itself are a loop that runs so: its rows are where they say.
fn lateness_s(times: &[f64], period_s: f64) -> f64 {
    let off = |w: &[f64]| {
        let step = w[1] - w[0];
        step - period_s * (step / period_s).round()
    };
    let steps: Vec<f64> = times.windows(2).map(off).collect();
    let count = steps.len() as f64;
    let mean = steps.iter().sum::<f64>() / count;
    let variance = steps.iter().map(|step| (step - mean).powi(2)).sum::<f64>() / count;
    let covariance = steps.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f64>() / count;
    (CERTAIN * variance / count.sqrt() - covariance).max(0.0).sqrt()
}

/// The mean of a held command over a time that begins behind row `at`.
fn mean_held(times: &[f64], values: &[f64], at: usize, time: Range<f64>) -> f64 {
    let (mut from, mut sum) = (time.start, 0.0);
    let rows = values.iter().zip(times.iter().skip(1).chain([&f64::INFINITY]));
    for (value, next) in rows.skip(at) {
        let until = next.min(time.end).max(from);
        sum += value * (until - from);
        from = until;
        if from >= time.end {
            break;
        }
    }
    sum / (time.end - time.start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prepare::columns::{BATTERY, COMMAND, OPTIONAL, POSITION, RATE};

    /// Every value that can be missing comes back: a cubic's in the middle of four even samples, a
    /// parabola's anywhere, a straight line's of what is held.
    #[test]
    fn missing_values_come_back() {
        let even: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        let uneven: Vec<f64> = even.iter().map(|t| t + 0.002 * (700.0 * t).sin()).collect();
        let cubic = |t: f64| 1.0 + t * (3.0 + t * (20.0 - 90.0 * t));
        let parabola = |t: f64| 1.0 + t * (3.0 - 20.0 * t);
        let line = |t: f64| 1.0 - 3.0 * t;
        let check = |t: &[f64], column: usize, missing: &[usize], curve: &dyn Fn(f64) -> f64| {
            let mut columns: Vec<Cow<[f64]>> = vec![Cow::Owned(t.to_vec()); OPTIONAL];
            let with_holes = |(k, t): (usize, &f64)| if missing.contains(&k) { f64::NAN } else { curve(*t) };
            columns[column] = t.iter().enumerate().map(with_holes).collect::<Vec<f64>>().into();
            let filled = bridge(t, &mut columns, 0.01);
            assert_eq!(filled, if column == BATTERY { 0 } else { missing.len() });
            for (value, t) in columns[column].iter().zip(t) {
                assert!((value - curve(*t)).abs() < 1e-12, "column {column}, {t} s: {value}");
            }
        };
        check(&even, POSITION, &[7, 20, 30], &cubic);
        check(&uneven, RATE, &[7, 8, 9, 20, 30, 31], &parabola);
        check(&uneven, COMMAND, &[7, 8, 20], &line);
        check(&uneven, BATTERY, &[7, 8, 20, 21, 22, 23, 24, 25], &line);
    }

    #[test]
    fn nothing_is_bridged_across_a_gap_or_over_four_values() {
        let mut t: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        t[20..].iter_mut().for_each(|t| *t += 2.0);
        let mut columns: Vec<Cow<[f64]>> = vec![Cow::Owned(t.clone()); OPTIONAL];
        for k in [5, 6, 7, 8, 19] {
            columns[RATE].to_mut()[k] = f64::NAN;
        }
        assert_eq!(bridge(&t, &mut columns, 0.01), 0);
        assert_eq!(columns[RATE].iter().filter(|v| v.is_nan()).count(), 5);
    }

    /// Even numbers between -1 and 1, in no order: the multiples of the golden ratio's fraction, hashed.
    fn scattered(k: u32) -> f64 {
        let mixed =
            (k.wrapping_mul(0x9E37_79B9) ^ (k.wrapping_mul(0x85EB_CA6B) >> 13)).wrapping_mul(0xC2B2_AE35);
        f64::from(mixed) / f64::from(u32::MAX) * 2.0 - 1.0
    }

    /// Rows that are late by up to 2 ms, each by itself: 2 / sqrt(12) ms. Steps of 9 to 11 ms whose rows are where they say: no lateness,
    /// though in the end they are anywhere against an even grid (10 / sqrt(12) ms).
    #[test]
    fn a_loop_that_runs_unevenly_is_not_late() {
        let late: Vec<f64> = (0..4000).map(|k| 0.01 * f64::from(k) + 0.001 * (1.0 + scattered(k))).collect();
        let mut time = 0.0;
        let walks: Vec<f64> = (0..4000)
            .map(|k| {
                time += 0.01 + 0.001 * scattered(k);
                time
            })
            .collect();
        let expected_s = 0.002 / 12_f64.sqrt();
        let (found_s, deviation_s) = (lateness_s(&late, 0.01), grid_start(&late, 0.01).1);
        assert!((deviation_s / expected_s - 1.0).abs() < 0.05, "{deviation_s}");
        assert!((0.95..1.1).contains(&(found_s / expected_s)), "{found_s}");
        let (found_s, deviation_s) = (lateness_s(&walks, 0.01), grid_start(&walks, 0.01).1);
        assert!(found_s < 2e-4 && deviation_s > 2e-3, "{found_s} {deviation_s}");
    }

    /// A command that is held from row to row of a loop that runs unevenly: each step of the grid has its mean, sums done by hand.
    #[test]
    fn a_held_command_counts_for_its_time() {
        let (times, values) = ([0.0, 0.009, 0.020, 0.029], [1.0, 2.0, 5.0, 7.0]);
        let mean = |at, from: f64| mean_held(&times, &values, at, from..from + 0.01);
        for (at, from, want) in [
            (0, 0.0, 0.9 * 1.0 + 0.1 * 2.0),
            (1, 0.010, 2.0),
            (1, 0.015, 0.5 * 2.0 + 0.5 * 5.0),
            (2, 0.020, 0.9 * 5.0 + 0.1 * 7.0),
            (3, 0.030, 7.0),
        ] {
            assert!((mean(at, from) - want).abs() < 1e-9, "{from}: {}", mean(at, from));
        }
    }
}
