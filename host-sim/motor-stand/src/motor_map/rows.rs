//! Rows of the least squares: the terms of a map after the rotor's lag, at the times at which the
//! tachometer measured, and how they change with lag and clock.

use model::rotor_lag::RotorLag;

use super::craft_log::{CraftLog, lagged};
use super::terms::Terms;

/// Time constants after which it does not matter any more how a rotor began.
const SETTLED: f64 = 5.0;
/// Speeds under this part of the largest are a rotor that stands.
const STANDING: f64 = 0.05;

/// What is not linear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub(super) lag: f64,
    pub(super) offset_s: f64,
    pub(super) skew: f64,
}

/// A speed that was measured, and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) time_s: f64,
    pub(super) speed: f64,
}

/// Speeds that were measured on a rotor that turned.
pub(super) fn points_of(times: &[f64], speeds: &[f64]) -> Vec<Point> {
    let largest = speeds.iter().copied().filter(|w| w.is_finite()).fold(0.0, f64::max);
    let all = times.iter().zip(speeds).map(|(&time_s, &speed)| Point { time_s, speed });
    all.filter(|p| p.speed > STANDING * largest).collect()
}

/// Rows of one motor at a shape.
pub(super) struct Rows {
    /// Which points they are.
    pub(super) points: Vec<usize>,
    /// Features after the lag, one vector a term.
    pub(super) features: Vec<Vec<f64>>,
    /// Their derivatives by the lag.
    pub(super) by_lag: Vec<Vec<f64>>,
    /// By the time.
    pub(super) by_time: Vec<Vec<f64>>,
}

pub(super) fn rows(
    craft: &CraftLog,
    motor: usize,
    terms: Terms,
    points: &[Point],
    shape: Shape,
    middle_s: f64,
) -> Rows {
    let features = craft.features(motor, terms);
    let step = 1e-4 * shape.lag;
    let settled_s = SETTLED / shape.lag;
    let at: Vec<(usize, f64, usize)> = points
        .iter()
        .enumerate()
        .filter_map(|(index, p)| {
            let time_s = p.time_s + shape.offset_s + shape.skew * (p.time_s - middle_s);
            let k = craft.holding(time_s)?;
            let begun_s = craft.t[craft.since[k]];
            (time_s - begun_s > settled_s).then_some((k, time_s - craft.t[k], index))
        })
        .collect();
    let read = |feature: &[f64], lag: RotorLag| -> Vec<f64> {
        let states = lagged(craft, feature, lag);
        at.iter().map(|&(k, since_s, _)| lag.response(states[k], feature[k], since_s)).collect()
    };
    let mut found = Rows {
        points: at.iter().map(|(.., index)| *index).collect(),
        features: Vec::new(),
        by_lag: Vec::new(),
        by_time: Vec::new(),
    };
    for feature in &features {
        let here = read(feature, RotorLag::new(shape.lag));
        let faster = read(feature, RotorLag::new(shape.lag + step));
        found.by_lag.push(faster.iter().zip(&here).map(|(b, a)| (b - a) / step).collect());
        found.by_time.push(at.iter().zip(&here).map(|(&(k, ..), a)| shape.lag * (feature[k] - a)).collect());
        found.features.push(here);
    }
    found
}

/// Weighted sums of columns.
pub(super) fn combined(columns: &[Vec<f64>], weights: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; columns.first().map_or(0, Vec::len)];
    for (column, weight) in columns.iter().zip(weights) {
        sum.iter_mut().zip(column).for_each(|(s, c)| *s += weight * c);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stand::{Motor, Stand};

    const LAG: f64 = 20.0;

    /// A command that steps from 1 to 3 at 1 s, at 12 V.
    fn step() -> CraftLog {
        let craft_s: Vec<f64> = (0..300).map(|k| 0.01 * f64::from(k)).collect();
        let command = craft_s.iter().map(|t| if *t < 0.995 { 1.0 } else { 3.0 }).collect();
        let motor = Motor { number: 1, command, speed_rad_s: Vec::new() };
        let battery_v = vec![12.0; craft_s.len()];
        CraftLog::new(&Stand { craft_s, battery_v, rotor_s: Vec::new(), motors: vec![motor] })
    }

    /// Times between the rows of the craft's log, after the step.
    fn points() -> Vec<Point> {
        (0..20).map(|k| Point { time_s: 1.003 + 0.0077 * f64::from(k), speed: 0.0 }).collect()
    }

    fn rows_at(shape: Shape) -> Rows {
        rows(&step(), 0, Terms::Command, &points(), shape, 1.1)
    }

    /// The answer is 3 - 2 exp(-lag t), t since the step.
    #[test]
    fn features_and_their_slopes_are_those_of_the_exponential() {
        let found = rows_at(Shape { lag: LAG, offset_s: 0.0, skew: 0.0 });
        assert_eq!(found.points, (0..20).collect::<Vec<_>>());
        for (k, point) in points().iter().enumerate() {
            let since_s = point.time_s - 1.0;
            let left = 2.0 * (-LAG * since_s).exp();
            assert!((found.features[0][k] - (3.0 - left)).abs() < 1e-12);
            assert!((found.by_time[0][k] - LAG * left).abs() < 1e-10);
            // A difference over a ten thousandth of the lag: wrong by half of that times lag * t.
            assert!((found.by_lag[0][k] - since_s * left).abs() < 1e-3 * since_s * left + 1e-9);
        }
    }

    #[test]
    fn an_offset_reads_the_answer_later() {
        let early = rows_at(Shape { lag: LAG, offset_s: 0.0, skew: 0.0 });
        let late = rows_at(Shape { lag: LAG, offset_s: 0.05, skew: 0.0 });
        for (early, late) in early.features[0].iter().zip(&late.features[0]) {
            // What is left of the step decays by exp(-lag * offset).
            assert!(((3.0 - late) / (3.0 - early) - (-LAG * 0.05_f64).exp()).abs() < 1e-9);
        }
    }

    /// Its time constant is 0.5 s here: before 2.5 s, the rotor's speed at the log's start matters.
    #[test]
    fn points_before_a_slow_rotor_has_settled_give_no_rows() {
        assert!(rows_at(Shape { lag: 2.0, offset_s: 0.0, skew: 0.0 }).points.is_empty());
    }

    #[test]
    fn a_rotor_that_stands_is_left_out() {
        let kept = points_of(&[0.0, 1.0, 2.0, 3.0], &[600.0, 3.0, f64::NAN, 590.0]);
        assert_eq!(kept.iter().map(|p| p.time_s).collect::<Vec<_>>(), [0.0, 3.0]);
    }
}
