//! Stretches of time.

use crate::recording::Span;

/// Spans in order, those that touch joined.
pub(in crate::sources) fn joined(spans: Vec<Span>) -> Vec<Span> {
    joined_over(spans, 0.0)
}

/// Spans in order, those that are no further apart than a gap joined.
pub(in crate::sources) fn joined_over(mut spans: Vec<Span>, gap_s: f64) -> Vec<Span> {
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut all: Vec<Span> = Vec::new();
    for span in spans {
        match all.last_mut() {
            Some(last) if span[0] <= last[1] + gap_s => last[1] = last[1].max(span[1]),
            _ => all.push(span),
        }
    }
    all
}

/// What lies in both of two lists of spans in order.
pub(in crate::sources) fn both(a: &[Span], b: &[Span]) -> Vec<Span> {
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

/// Length of all spans, s.
pub(in crate::sources) fn length_s(spans: &[Span]) -> f64 {
    spans.iter().map(|[start, end]| end - start).sum()
}

/// Stretches of rows that a condition holds for, joined over gaps; rows further apart than the gap are not.
pub(in crate::sources) fn where_holds(t: &[f64], holds: impl Fn(usize) -> bool, gap_s: f64) -> Vec<Span> {
    joined_over(t.iter().enumerate().filter(|(row, _)| holds(*row)).map(|(_, &t)| [t, t]).collect(), gap_s)
}

/// Median rate of rising times, Hz; gaps of more than a second are none of its steps.
pub(in crate::sources) fn rate_hz(t: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        t.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| (0.0..1.0).contains(step)).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, step, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(1.0 / *step)
}
