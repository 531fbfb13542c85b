//! The last values of a signal.

/// So many of the last values as there is room for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Recent<T, const N: usize> {
    values: [T; N],
    /// How many there have been: modulo `N`, where the next one goes, over the oldest.
    next: usize,
}

impl<T, const N: usize> Recent<T, N> {
    /// These, the oldest first.
    pub(crate) const fn of(values: [T; N]) -> Self {
        Self { values, next: 0 }
    }

    /// The next value; the oldest is forgotten.
    #[inline]
    pub(crate) fn push(&mut self, value: T) {
        if let Some(oldest) = self.values.get_mut(self.next % N) {
            *oldest = value;
        }
        self.next = self.next.wrapping_add(1);
    }

    /// All that are kept, the newest first.
    pub(crate) fn newest_first(&self) -> impl Iterator<Item = &T> {
        let (newer, older) = self.values.split_at(self.next % N);
        newer.iter().rev().chain(older.iter().rev())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After any number of values the last four, whatever the ring's turn.
    #[test]
    fn the_last_values_come_newest_first() {
        let mut recent = Recent::of([-4, -3, -2, -1]);
        for value in 0..11 {
            let kept: Vec<i32> = recent.newest_first().copied().collect();
            assert_eq!(kept, [value - 1, value - 2, value - 3, value - 4]);
            recent.push(value);
        }
    }
}
