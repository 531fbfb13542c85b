//! Stretches of time.

use crate::recording::Span;
use crate::statistics::median;

/// Spans in order, those that touch joined.
pub(crate) fn joined(spans: Vec<Span>) -> Vec<Span> {
    joined_over(spans, 0.0)
}

/// Spans in order, those that are no further apart than a gap joined.
pub(crate) fn joined_over(mut spans: Vec<Span>, gap_s: f64) -> Vec<Span> {
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
pub(crate) fn both(a: &[Span], b: &[Span]) -> Vec<Span> {
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
pub(crate) fn length_s(spans: &[Span]) -> f64 {
    spans.iter().map(|[start, end]| end - start).sum()
}

/// Stretches of rows that a condition holds for, joined over gaps; rows further apart than the gap are not.
pub(crate) fn where_holds(t: &[f64], holds: impl Fn(usize) -> bool, gap_s: f64) -> Vec<Span> {
    joined_over(t.iter().enumerate().filter(|(row, _)| holds(*row)).map(|(_, &t)| [t, t]).collect(), gap_s)
}

/// Spans with what lies so long before and after them, s.
pub(crate) fn widened(spans: &[Span], [before, after]: Span) -> Vec<Span> {
    spans.iter().map(|[start, end]| [start - before, end + after]).collect()
}

/// Which rising times lie in spans in order, their ends among them.
pub(crate) fn within(t: &[f64], spans: &[Span]) -> Vec<bool> {
    let mut span = 0;
    t.iter()
        .map(|&t| {
            while spans.get(span).is_some_and(|[_, end]| *end < t) {
                span += 1;
            }
            spans.get(span).is_some_and(|[start, _]| *start <= t)
        })
        .collect()
}

/// Whether something of spans in order lies between two moments.
pub(crate) fn any_between(spans: &[Span], from: f64, to: f64) -> bool {
    let first = spans.partition_point(|[_, end]| *end <= from);
    spans.get(first).is_some_and(|[start, _]| *start < to)
}

/// Median rate of times within spans in order, Hz; of all times where there are no spans.
pub(crate) fn rate_hz(t: &[f64], spans: &[Span]) -> Option<f64> {
    let inside = if spans.is_empty() { vec![true; t.len()] } else { within(t, spans) };
    let pairs = t.windows(2).zip(inside.windows(2)).filter(|(_, inside)| inside[0] && inside[1]);
    median(pairs.map(|(t, _)| t[1] - t[0])).map(|step_s| 1.0 / step_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_join_meet_and_hold() {
        let spans = joined(vec![[5.0, 6.0], [1.0, 2.0], [1.5, 3.0]]);
        assert_eq!(spans, [[1.0, 3.0], [5.0, 6.0]]);
        assert_eq!(both(&spans, &[[2.0, 5.5]]), [[2.0, 3.0], [5.0, 5.5]]);
        assert_eq!(within(&[0.5, 1.0, 3.0, 4.0, 5.5, 7.0], &spans), [false, true, true, false, true, false]);
        let between = |from, to| any_between(&spans, from, to);
        assert!(between(0.0, 1.1) && between(2.0, 2.1) && between(4.0, 9.0) && !between(3.0, 5.0));
        assert_eq!(rate_hz(&[0.0, 1.0, 1.5, 2.0, 2.5, 5.0, 5.25], &spans), Some(2.0));
        assert_eq!((rate_hz(&[1.0, 5.5], &[]), rate_hz(&[1.0], &[])), (Some(1.0 / 4.5), None));
    }
}
