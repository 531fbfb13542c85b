//! A signal at the times of another: averaged where it is faster, along arcs where it is slower, and nothing across gaps.

use flights::{GAP_PERIODS, interpolated, median_step};

use crate::recording::Span;
use crate::spans::any_between;

/// Signals of less than this part of the grid's period are averaged over it, not sampled.
const FASTER: f64 = 0.67;

/// How a signal goes on between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Smooth: a sensor, an estimate, a rotor's speed.
    Smooth,
    /// Held until the next sample: a command.
    Held,
    /// Slow, and logged as rarely as it likes: the battery.
    Slow,
}

/// Times at which signals are wanted, and how far apart they lie.
pub(super) struct Grid<'a> {
    /// Rising, s.
    pub(super) t: &'a [f64],
    /// Median step, s.
    pub(super) period_s: f64,
    /// What nothing runs on across, in order, s.
    pub(super) dropouts: &'a [Span],
}

impl Grid<'_> {
    /// Whether a signal does not go on between two moments.
    fn is_gap(&self, from: f64, to: f64, longest_s: f64) -> bool {
        to - from > longest_s || any_between(self.dropouts, from, to)
    }
}

/// The values of a signal with samples at `t` on the grid; NaN in gaps and beyond its ends.
pub(super) fn resampled(t: &[f64], values: &[f64], grid: &Grid<'_>, kind: Kind) -> Vec<f64> {
    let (t, values) = finite(t, values);
    if t.is_empty() {
        return vec![f64::NAN; grid.t.len()];
    }
    if kind == Kind::Slow {
        return grid.t.iter().map(|&time| straight(&t, &values, time)).collect();
    }
    let own_period_s = if t.len() > 1 { median_step(&t) } else { grid.period_s };
    let longest_s = GAP_PERIODS * own_period_s.max(grid.period_s);
    let is_faster = own_period_s < FASTER * grid.period_s;
    let area =
        is_faster.then(|| running_integral(&t, &values, kind, |from, to| grid.is_gap(from, to, longest_s)));
    let half_s = 0.5 * grid.period_s;
    let at_time = |&time: &f64| {
        let at = t.partition_point(|own| *own <= time);
        let Some(at) = at.checked_sub(1) else { return f64::NAN };
        if t[at] == time && !is_faster {
            return values[at];
        }
        let is_gap = t.get(at + 1).is_none_or(|next| grid.is_gap(t[at], *next, longest_s));
        match (&area, kind) {
            // A command is held: what acts from this row to the next is its mean from here on.
            (Some(area), Kind::Held) => area.mean(time, time + grid.period_s),
            (Some(area), _) => area.mean(time - half_s, time + half_s),
            (None, Kind::Held) if !grid.is_gap(t[at], time, longest_s) => values[at],
            (None, Kind::Held) => f64::NAN,
            _ if is_gap => f64::NAN,
            (None, _) => interpolated(&t, &values, at, time),
        }
    };
    grid.t.iter().map(at_time).collect()
}

/// The samples that have a value.
fn finite(t: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    t.iter().zip(values).filter(|(_, value)| value.is_finite()).unzip()
}

/// Along a straight line, held beyond the ends.
fn straight(t: &[f64], values: &[f64], time: f64) -> f64 {
    let after = t.partition_point(|own| *own <= time);
    let (Some(before), true) = (after.checked_sub(1), after < t.len()) else {
        return if after == 0 { values[0] } else { values[t.len() - 1] };
    };
    let part = (time - t[before]) / (t[after] - t[before]);
    values[before] + part * (values[after] - values[before])
}

/// The integral of a signal from its first sample, with the times without gaps beside it.
struct RunningIntegral<'a> {
    t: &'a [f64],
    values: &'a [f64],
    area: Vec<f64>,
    covered_s: Vec<f64>,
    kind: Kind,
}

fn running_integral<'a>(
    t: &'a [f64],
    values: &'a [f64],
    kind: Kind,
    is_gap: impl Fn(f64, f64) -> bool,
) -> RunningIntegral<'a> {
    let (mut area, mut covered_s) = (vec![0.0], vec![0.0]);
    for (w, v) in t.windows(2).zip(values.windows(2)) {
        let step = if is_gap(w[0], w[1]) { 0.0 } else { w[1] - w[0] };
        let height = if kind == Kind::Held { v[0] } else { 0.5 * (v[0] + v[1]) };
        area.push(area[area.len() - 1] + step * height);
        covered_s.push(covered_s[covered_s.len() - 1] + step);
    }
    RunningIntegral { t, values, area, covered_s, kind }
}

impl RunningIntegral<'_> {
    /// Integral and time without gaps up to a moment.
    fn until(&self, time: f64) -> (f64, f64) {
        let after = self.t.partition_point(|own| *own <= time);
        let Some(at) = after.checked_sub(1) else { return (0.0, 0.0) };
        if after == self.t.len() || self.covered_s[after] == self.covered_s[at] {
            return (self.area[at], self.covered_s[at]);
        }
        let step = time - self.t[at];
        let part = step / (self.t[after] - self.t[at]);
        let here = self.values[at];
        let there = if self.kind == Kind::Held { here } else { here + part * (self.values[after] - here) };
        (self.area[at] + 0.5 * (here + there) * step, self.covered_s[at] + step)
    }

    /// Mean between two moments, if there is a signal for more than half of the time between.
    fn mean(&self, from: f64, to: f64) -> f64 {
        let ((before, from_s), (after, to_s)) = (self.until(from), self.until(to));
        let covered_s = to_s - from_s;
        if covered_s > 0.5 * (to - from) { (after - before) / covered_s } else { f64::NAN }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(period_s: f64, count: usize) -> Vec<f64> {
        (0..count).map(|k| k as f64 * period_s).collect()
    }

    fn on(grid: &[f64], period_s: f64, t: &[f64], values: &[f64], kind: Kind) -> Vec<f64> {
        resampled(t, values, &Grid { t: grid, period_s, dropouts: &[] }, kind)
    }

    #[test]
    fn a_signal_at_its_own_times_stays_as_it_is() {
        let t = times(0.01, 50);
        let values: Vec<f64> = t.iter().map(|t| (40.0 * t).sin()).collect();
        for kind in [Kind::Smooth, Kind::Held, Kind::Slow] {
            assert_eq!(on(&t, 0.01, &t, &values, kind), values);
        }
    }

    /// The mean of a straight line about a moment is its value there; that of a step is where it lies in the window.
    #[test]
    fn a_faster_signal_is_averaged_over_the_period() {
        let t = times(0.001, 1000);
        let line: Vec<f64> = t.iter().map(|t| 3.0 - 2.0 * t).collect();
        let grid = times(0.01, 90);
        for (time, value) in grid.iter().zip(on(&grid, 0.01, &t, &line, Kind::Smooth)).skip(1) {
            assert!((value - (3.0 - 2.0 * time)).abs() < 1e-12, "{time}: {value}");
        }
        let step: Vec<f64> = t.iter().map(|t| f64::from(u8::from(*t > 0.2035))).collect();
        let held = on(&grid, 0.01, &t, &step, Kind::Held);
        assert_eq!((held[19], held[21]), (0.0, 1.0));
        assert!((held[20] - 0.6).abs() < 1e-9, "held from 0.204 on: {}", held[20]);
    }

    /// Arcs through a slower signal: exact for a parabola, where straight lines between samples would be low.
    #[test]
    fn a_slower_signal_runs_along_arcs_and_commands_are_held() {
        let t = times(0.04, 50);
        let values: Vec<f64> = t.iter().map(|t| t * t).collect();
        let grid = times(0.01, 180);
        // Between the first two there is no slope to go by but the line's.
        for (time, value) in grid.iter().zip(on(&grid, 0.01, &t, &values, Kind::Smooth)).skip(4) {
            assert!((value - time * time).abs() < 1e-12, "{time}: {value}");
        }
        let held = on(&grid, 0.01, &t, &values, Kind::Held);
        assert_eq!(held[8..12], [values[2]; 4]);
    }

    #[test]
    fn nothing_is_made_up_in_gaps_and_beyond_the_ends() {
        let t: Vec<f64> = times(0.01, 100).into_iter().filter(|t| !(0.3..0.5).contains(t)).collect();
        let values = vec![1.0; t.len()];
        let grid: Vec<f64> = (-5..110).map(|k| 0.0101 * f64::from(k)).collect();
        for (time, value) in grid.iter().zip(on(&grid, 0.0101, &t, &values, Kind::Smooth)) {
            let is_there = (0.0..=0.29).contains(time) || (0.5..=0.99).contains(time);
            assert_eq!(value.is_finite(), is_there, "{time}: {value}");
        }
        let fast = on(&grid, 0.0101, &times(0.001, 100), &[2.0; 100], Kind::Smooth);
        assert!(fast[..5].iter().chain(&fast[16..]).all(|v| v.is_nan()));
        assert!(fast[6..14].iter().all(|v| (v - 2.0).abs() < 1e-12));
    }

    /// A dropout that is shorter than a gap, and one within a signal that is averaged.
    #[test]
    fn nothing_runs_on_across_a_dropout() {
        let grid = times(0.01, 100);
        for (period_s, kind) in [
            (0.01, Kind::Smooth),
            (0.01, Kind::Held),
            (0.04, Kind::Smooth),
            (0.04, Kind::Held),
            (0.001, Kind::Smooth),
        ] {
            let dropout = [0.502, 0.522];
            let t: Vec<f64> =
                times(period_s, 1000).into_iter().filter(|t| !(dropout[0]..dropout[1]).contains(t)).collect();
            let grid = Grid { t: &grid, period_s: 0.01, dropouts: &[dropout] };
            let values = resampled(&t, &vec![1.0; t.len()], &grid, kind);
            for (time, value) in grid.t.iter().zip(values).skip(1) {
                assert!(
                    value.is_nan() || !(dropout[0]..dropout[1]).contains(time),
                    "{period_s} {kind:?} {time}"
                );
                let far = (time - 0.512).abs() > 0.01 + period_s.max(0.01);
                assert!(value == 1.0 || !far, "{period_s} {kind:?} {time}: {value}");
            }
        }
    }

    #[test]
    fn a_battery_is_read_as_rarely_as_it_likes_and_a_signal_without_values_is_none() {
        let grid = [0.0, 5.0, 10.0, 15.0, 20.0];
        assert_eq!(on(&grid, 5.0, &[5.0, 15.0], &[12.0, 11.0], Kind::Slow), [12.0, 12.0, 11.5, 11.0, 11.0]);
        assert!(on(&grid, 5.0, &[], &[], Kind::Smooth).iter().all(|v| v.is_nan()));
        assert!(on(&grid, 5.0, &[0.0, 5.0], &[f64::NAN; 2], Kind::Held).iter().all(|v| v.is_nan()));
    }
}
