//! The transmission delay of thesis 5.5: a first-in-first-out line of whole samples.

use std::collections::VecDeque;

/// Hands every value back a fixed number of samples later; before the line has filled, the first
/// value.
#[derive(Debug, Clone)]
pub(crate) struct Delay<T> {
    samples: usize,
    line: VecDeque<T>,
}

impl<T: Copy> Delay<T> {
    /// A line of `samples`; 0 hands values straight through.
    pub(crate) fn new(samples: usize) -> Self {
        Self { samples, line: VecDeque::with_capacity(samples + 1) }
    }

    /// Takes the newest value and gives that of `samples` ago.
    #[inline]
    pub(crate) fn push(&mut self, value: T) -> T {
        if self.samples == 0 {
            return value;
        }
        while self.line.len() < self.samples {
            self.line.push_back(value);
        }
        self.line.push_back(value);
        self.line.pop_front().unwrap_or(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_after_exactly_the_delay() {
        for samples in [0, 1, 2, 7] {
            let mut line = Delay::new(samples);
            for k in 0..50_usize {
                assert_eq!(line.push(k), k.saturating_sub(samples), "delay {samples}, sample {k}");
            }
        }
    }
}
