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
