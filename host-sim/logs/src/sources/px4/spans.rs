//! When the craft flew, and when its estimator was not sure of itself.

use crate::log::Log;
use crate::recording::Span;

use super::rows::Rows;
use super::topics::topic;

/// When the craft was armed, s; empty where it never was, none where the log does not say.
pub(super) fn armed(log: &Log) -> Option<Vec<Span>> {
    const ARMED: [(&str, &str, f64); 2] =
        [("vehicle_status", "arming_state", 2.0), ("actuator_armed", "armed", 1.0)];
    let mut said = None;
    for (name, column, value) in ARMED {
        let spans = states(log, name, column, |state| state == value);
        if said.as_ref().is_none_or(Vec::is_empty) {
            said = spans.or(said);
        }
    }
    said
}

/// When the craft was armed and not on the ground, s, within a span of the log.
pub(super) fn airborne(log: &Log, [first, last]: Span) -> Vec<Span> {
    let whole = || vec![[first, last]];
    let armed = armed(log).unwrap_or_else(whole);
    let off_ground =
        states(log, "vehicle_land_detected", "landed", |landed| landed == 0.0).unwrap_or_else(whole);
    both(&both(&armed, &off_ground), &whole())
}

/// When a state held. It holds from its row on, the first one from the beginning, the last one to the end.
fn states(log: &Log, name: &str, column: &str, holds: impl Fn(f64) -> bool) -> Option<Vec<Span>> {
    let table = topic(log, name)?;
    let rows = Rows::of_events(table);
    let values = rows.pick(table.column(column)?);
    let mut times = rows.times_s();
    *times.first_mut()? = f64::NEG_INFINITY;
    times.push(f64::INFINITY);
    let held = values.iter().zip(times.windows(2)).filter(|(value, _)| holds(**value));
    Some(joined(held.map(|(_, pair)| [pair[0], pair[1]]).collect()))
}

/// Spans in order, those that touch joined.
pub(super) fn joined(mut spans: Vec<Span>) -> Vec<Span> {
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut all: Vec<Span> = Vec::new();
    for span in spans {
        match all.last_mut() {
            Some(last) if span[0] <= last[1] => last[1] = last[1].max(span[1]),
            _ => all.push(span),
        }
    }
    all
}

/// What lies in both of two lists of spans in order.
pub(super) fn both(a: &[Span], b: &[Span]) -> Vec<Span> {
    let mut shared = Vec::new();
    let (mut at_a, mut at_b) = (0, 0);
    while let (Some(&[start_a, end_a]), Some(&[start_b, end_b])) = (a.get(at_a), b.get(at_b)) {
        let (start, end) = (start_a.max(start_b), end_a.min(end_b));
        if start < end {
            shared.push([start, end]);
        }
        if end_a <= end_b { at_a += 1 } else { at_b += 1 }
    }
    shared
}

/// Which times lie in spans; all where there are no spans.
pub(super) fn within(t: &[f64], spans: &[Span]) -> Vec<bool> {
    let mut span = 0;
    t.iter()
        .map(|&t| {
            while spans.get(span).is_some_and(|[_, end]| *end < t) {
                span += 1;
            }
            spans.is_empty() || spans.get(span).is_some_and(|[start, _]| *start <= t)
        })
        .collect()
}

/// Median rate of times within spans, Hz.
pub(super) fn rate_hz(t: &[f64], spans: &[Span]) -> Option<f64> {
    let inside = within(t, spans);
    let pairs = t.windows(2).zip(inside.windows(2)).filter(|(_, inside)| inside[0] && inside[1]);
    let mut steps: Vec<f64> = pairs.map(|(t, _)| t[1] - t[0]).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, step, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(1.0 / *step)
}
