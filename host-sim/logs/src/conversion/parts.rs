//! Which parts of a log become flights.

use crate::recording::Span;
use crate::spans::joined_over;

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
    joined_over(sorted, MERGED_S)
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
