//! Which parts of a log become flights.

use crate::recording::Span;

/// Parts that are closer than this are one, s.
const MERGED_S: f64 = 1.0;

/// Parts shorter than this are no flights, s.
pub(super) const SHORTEST_S: f64 = 2.0;

/// Parts in the air, those next to one another joined; all of the log where it does not say when it flew.
pub(super) fn airborne(spans: &[Span], log: Span) -> Vec<Span> {
    if spans.is_empty() {
        return vec![log];
    }
    let mut sorted: Vec<Span> = spans.iter().map(|[from, to]| [from.max(log[0]), to.min(log[1])]).collect();
    sorted.retain(|[from, to]| to > from);
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut parts: Vec<Span> = Vec::new();
    for span in sorted {
        match parts.last_mut() {
            Some(last) if span[0] - last[1] < MERGED_S => last[1] = last[1].max(span[1]),
            _ => parts.push(span),
        }
    }
    parts
}

/// Whether a moment lies in one of the spans.
pub(super) fn within(spans: &[Span], time: f64) -> bool {
    spans.iter().any(|[from, to]| (*from..=*to).contains(&time))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_touch_are_one_and_stay_within_the_log() {
        let spans = [[30.0, 40.0], [-5.0, 3.0], [3.5, 9.0], [39.0, 70.0], [90.0, 95.0]];
        assert_eq!(airborne(&spans, [0.0, 60.0]), [[0.0, 9.0], [30.0, 60.0]]);
    }

    #[test]
    fn a_log_that_does_not_say_when_it_flew_is_taken_whole() {
        assert_eq!(airborne(&[], [2.0, 60.0]), [[2.0, 60.0]]);
    }
}
