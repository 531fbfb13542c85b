//! Fewer numbers, the same picture: lines without losing a peak, clouds as counts, spectra.

use report::bin_statistics;
use serde_json::{Value, json};
use sysid::fit::segments::Segments;

/// Part of a flight, and how many points it may take.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    /// Columns of pixels.
    pub(super) width: usize,
}

impl Window {
    /// Points across a screen.
    const WIDTHS: [usize; 2] = [10, 8000];

    /// The whole flight where nothing is said of the range.
    pub(super) fn new(from_s: Option<f64>, to_s: Option<f64>, width: Option<usize>) -> Self {
        let [least, most] = Self::WIDTHS;
        Self {
            from_s: from_s.unwrap_or(f64::NEG_INFINITY),
            to_s: to_s.unwrap_or(f64::INFINITY),
            width: width.unwrap_or(1200).clamp(least, most),
        }
    }

    /// First and last time of it in a flight.
    pub(super) fn within(self, time_s: &[f64]) -> [f64; 2] {
        let [first, last] = [time_s.first(), time_s.last()].map(|end| end.copied().unwrap_or(0.0));
        // A window beside the flight holds nothing of it.
        let from = self.from_s.max(first).min(last);
        [from, self.to_s.min(last).max(from)]
    }
}

/// Rows of several lines over one time.
#[derive(Debug, Default)]
pub(super) struct Rows {
    pub(super) t: Vec<f64>,
    /// Not a number where the line breaks; seven digits are more than any screen has rows.
    pub(super) lines: Vec<Vec<f32>>,
}

/// At most so many of the values, evenly picked.
pub(super) fn thinned<T: Copy>(values: &[T], most: usize) -> Vec<T> {
    values.iter().copied().step_by(values.len().div_ceil(most).max(1)).collect()
}

/// The rows of a window, where there are more than two a column of pixels the lowest and the highest of each, in their order.
pub(super) fn reduced(time_s: &[f64], lines: &[&[f64]], window: Window) -> Rows {
    let from = time_s.partition_point(|t| *t < window.from_s).saturating_sub(1);
    let to = (time_s.partition_point(|t| *t <= window.to_s) + 1).min(time_s.len());
    let mut rows = Rows { t: Vec::new(), lines: vec![Vec::new(); lines.len()] };
    if from >= to {
        return rows;
    }
    let longest_s = 3.0 * shortest_step(time_s);
    let each = (to - from).div_ceil(window.width.max(1));
    let mut start = from;
    while start < to {
        let end = (start + each).min(to);
        if start > from && time_s[start] - time_s[start - 1] > longest_s {
            rows.break_at(time_s[start]);
        }
        if each <= 2 {
            (start..end).for_each(|row| rows.push(time_s[row], |line| lines[line][row]));
        } else {
            let ends: Vec<[f64; 2]> =
                lines.iter().map(|line| lowest_and_highest(&line[start..end])).collect();
            rows.push(time_s[start], |line| ends[line][0]);
            rows.push(time_s[start.midpoint(end)], |line| ends[line][1]);
        }
        start = end;
    }
    rows
}

impl Rows {
    fn push(&mut self, t: f64, value: impl Fn(usize) -> f64) {
        self.t.push(t);
        for (line, values) in self.lines.iter_mut().enumerate() {
            values.push(value(line) as f32);
        }
    }

    fn break_at(&mut self, t: f64) {
        self.push(t, |_| f64::NAN);
    }
}

/// Values less those of another line at the same times, between whose samples a straight line goes; nothing where the other
/// has none. Angles in rad differ by half a turn at most.
pub(super) fn apart(
    time_s: &[f64],
    values: &[f64],
    other_s: &[f64],
    others: &[f64],
    are_angles: bool,
) -> Vec<f64> {
    let longest_s = 3.0 * shortest_step(other_s);
    let difference = |t: f64, value: f64| {
        let after = other_s.partition_point(|other| *other < t);
        if other_s.get(after).is_some_and(|other| *other == t) {
            return value - others[after];
        }
        if after == 0 || after == other_s.len() || other_s[after] - other_s[after - 1] > longest_s {
            return f64::NAN;
        }
        let share = (t - other_s[after - 1]) / (other_s[after] - other_s[after - 1]);
        value - (others[after - 1] + share * (others[after] - others[after - 1]))
    };
    let turned = |angle: f64| angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round();
    let differences = time_s.iter().zip(values).map(|(t, value)| difference(*t, *value));
    if are_angles { differences.map(turned).collect() } else { differences.collect() }
}

/// A row of one of two lines over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Row {
    First(usize),
    Second(usize),
}

impl Row {
    /// Its value, where these are the two lines.
    pub(super) fn of(self, first: &[f64], second: &[f64]) -> f64 {
        match self {
            Self::First(row) => first[row],
            Self::Second(row) => second[row],
        }
    }
}

/// Part of a step by which rows of the two must lie apart: then there is no break between them, and none looks like a shorter step.
const APART: f64 = 0.9;

/// All rows of the first line, and those of the second where the first has none, in the order of time.
pub(super) fn rows_of_both(first_s: &[f64], second_s: &[f64]) -> Vec<Row> {
    let least_s = APART * shortest_step(first_s).min(shortest_step(second_s));
    let is_free = |t: f64| {
        let after = first_s.partition_point(|first| *first < t);
        let before = after.checked_sub(1).map_or(f64::NEG_INFINITY, |before| first_s[before]);
        t - before >= least_s && first_s.get(after).copied().unwrap_or(f64::INFINITY) - t >= least_s
    };
    let free = (0..second_s.len()).filter(|row| is_free(second_s[*row])).map(Row::Second);
    let mut rows: Vec<Row> = (0..first_s.len()).map(Row::First).chain(free).collect();
    rows.sort_by(|a, b| a.of(first_s, second_s).total_cmp(&b.of(first_s, second_s)));
    rows
}

fn shortest_step(time_s: &[f64]) -> f64 {
    time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min)
}

/// Lowest and highest value in the order in which they come.
fn lowest_and_highest(values: &[f64]) -> [f64; 2] {
    let (mut low, mut high) = (0, 0);
    for (place, value) in values.iter().enumerate() {
        if *value < values[low] || values[low].is_nan() {
            low = place;
        }
        if *value > values[high] || values[high].is_nan() {
            high = place;
        }
    }
    [values[low.min(high)], values[low.max(high)]]
}

/// Cells along either axis of a cloud.
const CELLS: usize = 48;
/// Ranges in which means are taken.
const BINS: usize = 24;
/// Share of the points that may lie above and below the picture.
const OUTSIDE: f64 = 1e-3;

/// How many points lie in each cell, and mean and standard deviation along x.
pub(super) fn density(points: &[(f64, f64)]) -> Value {
    let x = edges(points.iter().map(|point| point.0).collect(), 0.0);
    let y = edges(points.iter().map(|point| point.1).collect(), OUTSIDE);
    let mut count = vec![vec![0_u32; CELLS]; CELLS];
    for (at, value) in points {
        if let (Some(column), Some(row)) = (cell(&x, *at), cell(&y, *value)) {
            count[row][column] += 1;
        }
    }
    let mean = |bin: &report::Bin| {
        json!({
            "x": bin.x,
            "mean": bin.mean,
            "low": bin.mean - bin.standard_deviation,
            "high": bin.mean + bin.standard_deviation,
            "count": bin.count,
        })
    };
    json!({
        "x": x,
        "y": y,
        "count": count,
        "mean": bin_statistics(points, BINS).iter().map(mean).collect::<Vec<_>>(),
    })
}

/// Edges of cells of equal width over all values but a share at either end.
fn edges(mut values: Vec<f64>, outside: f64) -> Vec<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let place = |share: f64| ((values.len().saturating_sub(1)) as f64 * share).round() as usize;
    let (Some(low), Some(high)) = (values.get(place(outside)), values.get(place(1.0 - outside))) else {
        return Vec::new();
    };
    let width = if high > low { (high - low) / CELLS as f64 } else { 1e-9 };
    (0..=CELLS).map(|edge| low + width * edge as f64).collect()
}

fn cell(edges: &[f64], value: f64) -> Option<usize> {
    let (first, last) = (edges.first()?, edges.last()?);
    let place = ((value - first) / (last - first) * CELLS as f64).floor();
    let is_inside = value >= *first && value <= *last;
    is_inside.then_some((place as usize).min(CELLS - 1))
}

/// Means of a value over cells of a plane.
pub(super) struct Cells {
    /// Edges, one more than columns.
    pub(super) x: Vec<f64>,
    /// Edges, one more than rows.
    pub(super) y: Vec<f64>,
    /// By row and column; none where there are too few.
    pub(super) mean: Vec<Vec<Option<f64>>>,
    pub(super) count: Vec<Vec<u32>>,
}

/// Means of the third of each three numbers in square cells over the first two; edges are multiples of the cell's side.
pub(super) fn mean_in_cells(points: &[[f64; 3]], side: f64, fewest: u32) -> Cells {
    let [x, y] = [0, 1].map(|place| multiples(points.iter().map(|point| point[place]), side));
    let (columns, rows) = (x.len().saturating_sub(1), y.len().saturating_sub(1));
    let mut count = vec![vec![0_u32; columns]; rows];
    let mut sum = vec![vec![0.0; columns]; rows];
    for [at, up, value] in points {
        let place = |edges: &[f64], value: f64| edges[1..].partition_point(|edge| *edge <= value);
        let (column, row) = (place(&x, *at).min(columns - 1), place(&y, *up).min(rows - 1));
        count[row][column] += 1;
        sum[row][column] += value;
    }
    let mean = |(sums, counts): (&Vec<f64>, &Vec<u32>)| {
        let cells = sums.iter().zip(counts);
        cells.map(|(sum, count)| (*count >= fewest).then(|| sum / f64::from(*count))).collect()
    };
    Cells { mean: sum.iter().zip(&count).map(mean).collect(), x, y, count }
}

/// Multiples of a length around all values.
fn multiples(values: impl Iterator<Item = f64> + Clone, side: f64) -> Vec<f64> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return Vec::new();
    }
    let first = (low / side).floor();
    let cells = ((high / side).floor() - first) as usize + 1;
    (0..=cells).map(|edge| (first + edge as f64) * side).collect()
}

/// Longest segment of a spectrum, samples.
const SEGMENT: usize = 1024;
/// Longest lag of an autocorrelation, s.
const LONGEST_LAG_S: f64 = 1.0;

/// Amplitude densities of what is measured and of what is left (Welch's method), and the autocorrelation of what is left with
/// the bound that white noise stays within 95 % of the time.
pub(super) fn spectrum(measured: &[f64], residual: &[f64], period_s: f64) -> Value {
    let lags = ((LONGEST_LAG_S / period_s) as usize).min(residual.len() / 4);
    let (frequency_hz, of_measured) = welch(measured, period_s);
    let (_, of_residual) = welch(residual, period_s);
    json!({
        "frequency_hz": frequency_hz,
        "measured": of_measured,
        "residual": of_residual,
        "lag_s": (0..=lags).map(|lag| lag as f64 * period_s).collect::<Vec<_>>(),
        "autocorrelation": autocorrelation(residual, lags),
        "bound": 1.96 / (residual.len().max(1) as f64).sqrt(),
    })
}

/// Frequencies in Hz and amplitude densities in the unit per square root of Hz; segments overlap by half, in a window of Hann's.
fn welch(values: &[f64], period_s: f64) -> (Vec<f64>, Vec<f64>) {
    let length = SEGMENT.min(values.len() / 4 * 2);
    if length < 8 {
        return (Vec::new(), Vec::new());
    }
    let of_length = Segments::new(length);
    let mut power = vec![0.0; length / 2 + 1];
    let mut segments = 0.0;
    for bins in of_length.of(values) {
        power.iter_mut().zip(&bins).for_each(|(sum, bin)| *sum += bin.norm_sqr());
        segments += 1.0;
    }
    // Both signs of a frequency in one; the power of the window taken out.
    let scale = 2.0 * period_s / (segments * of_length.power());
    let frequency = |k: usize| k as f64 / (length as f64 * period_s);
    (1..power.len()).map(|k| (frequency(k), (scale * power[k]).sqrt())).unzip()
}

fn autocorrelation(values: &[f64], lags: usize) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let about: Vec<f64> = values.iter().map(|value| value - mean).collect();
    let total: f64 = about.iter().map(|value| value * value).sum();
    let at = |lag: usize| about.iter().zip(&about[lag..]).map(|(a, b)| a * b).sum::<f64>() / total;
    (0..=lags).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Window = Window { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY, width: 100 };

    #[test]
    fn no_spike_is_lost_and_no_more_than_two_points_a_column_are_sent() {
        let t: Vec<f64> = (0..100_000).map(|k| f64::from(k) * 1e-3).collect();
        let mut values: Vec<f64> = t.iter().map(|t| t.sin()).collect();
        (values[54_321], values[54_400]) = (40.0, -40.0);
        let rows = reduced(&t, &[&values], ALL);
        assert!(rows.t.len() <= 200, "{}", rows.t.len());
        assert!(rows.lines[0].contains(&40.0_f32) && rows.lines[0].contains(&-40.0));
        assert!(rows.t.is_sorted());
    }

    #[test]
    fn a_short_window_has_its_samples_and_one_on_either_side() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        let window = Window { from_s: 2.005, to_s: 2.045, width: 100 };
        assert_eq!(reduced(&t, &[&t], window).lines[0], [2.0, 2.01, 2.02, 2.03, 2.04, 2.05]);
        let empty = reduced(&[], &[&[]], window);
        assert!(empty.t.is_empty() && empty.lines == [Vec::<f32>::new()]);
    }

    /// A part of a log has a grid of its own, and lacks some rows at its ends.
    #[test]
    fn what_one_line_lacks_comes_from_the_other_without_a_break() {
        let grid =
            |from: f64, count: u32| (0..count).map(|k| from + 0.01 * f64::from(k)).collect::<Vec<f64>>();
        let (part, whole) = ([grid(2.0043, 100), grid(4.0, 50)].concat(), grid(0.0, 600));
        let rows = rows_of_both(&part, &whole);
        let t: Vec<f64> = rows.iter().map(|row| row.of(&part, &whole)).collect();
        assert!(t.is_sorted() && (t[0], *t.last().unwrap()) == (0.0, 5.99));
        assert!(t.windows(2).all(|pair| (0.008..0.03).contains(&(pair[1] - pair[0]))), "{t:?}");
        assert_eq!(rows.iter().filter(|row| matches!(row, Row::First(_))).count(), 150);
        assert!(reduced(&t, &[&t], Window { width: 8000, ..ALL }).lines[0].iter().all(|y| y.is_finite()));
        assert_eq!(rows_of_both(&[], &whole[..3]), [0, 1, 2].map(Row::Second));
        assert_eq!(rows_of_both(&whole[..2], &[]), [0, 1].map(Row::First));
    }

    #[test]
    fn a_line_breaks_where_time_does() {
        let t: Vec<f64> = (0..20).map(|k| f64::from(k) * 0.1 + if k < 10 { 0.0 } else { 5.0 }).collect();
        let rows = reduced(&t, &[&t], ALL);
        let broken: Vec<usize> = (0..rows.t.len()).filter(|&k| rows.lines[0][k].is_nan()).collect();
        assert_eq!(broken, [10]);
    }

    #[test]
    fn flights_differ_where_both_have_samples() {
        let line = |t: &[f64]| -> Vec<f64> { t.iter().map(|t| 2.0 * t).collect() };
        // One begins at 1, breaks between 2 and 4, and ends at 5.
        let other: Vec<f64> =
            (0..41).map(|k| 1.0 + 0.1 * f64::from(k)).filter(|t| *t < 2.05 || *t > 3.95).collect();
        let own: Vec<f64> = (0..60).map(|k| 0.05 + 0.1 * f64::from(k)).collect();
        let higher: Vec<f64> = line(&own).iter().map(|value| value + 0.5).collect();
        let found = apart(&own, &higher, &other, &line(&other), false);
        for (t, difference) in own.iter().zip(&found) {
            let both = (1.0..=2.0).contains(t) || (4.0..=5.0).contains(t);
            assert_eq!(both, difference.is_finite(), "at {t}: {difference}");
            assert!(!both || (difference - 0.5).abs() < 1e-12, "at {t}: {difference}");
        }
        let turn = apart(&[0.0], &[3.1], &[0.0], &[-3.1], true);
        assert!((turn[0] - (6.2 - std::f64::consts::TAU)).abs() < 1e-12, "{turn:?}");
        assert!(apart(&[1.0], &[1.0], &[], &[], false)[0].is_nan());
    }

    #[test]
    fn every_point_but_a_thousandth_at_either_end_is_counted() {
        let points: Vec<(f64, f64)> = (0..10_000).map(|k| (f64::from(k % 100), f64::from(k / 100))).collect();
        let density = density(&points);
        let count: u64 = density["count"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|row| row.as_array().unwrap())
            .map(|n| n.as_u64().unwrap())
            .sum();
        assert_eq!(count, 10_000);
        assert_eq!(density["mean"].as_array().unwrap().len(), BINS);
    }

    /// Parseval: the power of a sine of amplitude 2 is 2, wherever its frequency lies.
    #[test]
    fn the_spectrum_holds_the_power_of_a_sine() {
        let period_s = 0.01;
        let values: Vec<f64> =
            (0..8192).map(|k| 2.0 * (std::f64::consts::TAU * 7.3 * f64::from(k) * period_s).sin()).collect();
        let (frequency, density) = welch(&values, period_s);
        let step = frequency[1] - frequency[0];
        let power: f64 = density.iter().map(|d| d * d * step).sum();
        assert!((power - 2.0).abs() < 0.01, "{power}");
        let (peak, _) = frequency.iter().zip(&density).max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
        assert!((peak - 7.3).abs() < step);
        assert!(welch(&[1.0; 5], period_s).0.is_empty());
    }

    #[test]
    fn a_sine_hangs_together_over_its_period() {
        let values: Vec<f64> =
            (0..4000).map(|k| (std::f64::consts::TAU * f64::from(k) / 50.0).sin()).collect();
        let found = autocorrelation(&values, 50);
        assert!((found[0] - 1.0).abs() < 1e-12 && found[25] < -0.98 && found[50] > 0.98, "{found:?}");
    }
}
