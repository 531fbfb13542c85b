//! Rate and loss of a stream of packets or frames.

use std::collections::VecDeque;

/// Rates and losses are averaged over this, us.
const AVERAGE_US: u64 = 2_000_000;

/// Rate and loss of a stream over the last seconds, from counts that only grow.
#[derive(Debug, Clone, Default)]
pub(super) struct StreamRate {
    /// Times, counts that came and counts that did not.
    marks: VecDeque<(u64, u64, u64)>,
}

impl StreamRate {
    pub(super) fn mark(&mut self, now_us: u64, came: u64, lost: u64) {
        self.marks.push_back((now_us, came, lost));
        while self.marks.front().is_some_and(|(at, ..)| at + AVERAGE_US < now_us) {
            self.marks.pop_front();
        }
    }

    /// In a second, and the part that was lost.
    pub(super) fn rate_and_loss(&self) -> (f64, f64) {
        let (Some(first), Some(last)) = (self.marks.front(), self.marks.back()) else { return (0.0, 0.0) };
        let (came, lost) = (last.1.saturating_sub(first.1) as f64, last.2.saturating_sub(first.2) as f64);
        let elapsed_s = last.0.saturating_sub(first.0) as f64 * 1e-6;
        let rate = if elapsed_s > 0.0 { came / elapsed_s } else { 0.0 };
        (rate, if lost > 0.0 { lost / (came + lost) } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_and_rates_are_those_of_the_last_seconds() {
        let mut average = StreamRate::default();
        let mut lost = 0;
        for k in 0..1000_u64 {
            // A fifth is lost in the second half.
            lost += u64::from(k >= 500 && k % 4 == 0);
            average.mark(k * 10_000, k, lost);
        }
        let (rate, loss) = average.rate_and_loss();
        assert!((rate - 100.0).abs() < 1.0 && (loss - 0.2).abs() < 0.01, "{rate} {loss}");
        assert_eq!(StreamRate::default().rate_and_loss(), (0.0, 0.0));
    }
}
