//! Timers of the detectors: for how long something has held, and for how long a stream has been silent.
//!
//! They are ages in microseconds that grow by the time since the tick before and stay at the greatest number. No clock is kept, so
//! a clock that wraps (every 71.6 minutes) disturbs none.

use crate::safety::limits::SilenceLimits;

/// How long a condition has held, in us.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Held(u32);

impl Held {
    /// Has it held for so long?
    #[inline]
    pub(crate) fn step(&mut self, now: bool, elapsed_us: u32, for_us: u32) -> bool {
        if !now {
            self.0 = 0;
            return false;
        }
        self.0 = self.0.saturating_add(elapsed_us);
        self.0 >= for_us
    }
}

/// A stream that may fall silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Silence {
    /// Since the last good item, us.
    pub(crate) age_us: u32,
    /// For how long good items have come again, us.
    good_us: u32,
    pub(crate) late: bool,
}

impl Silence {
    /// A stream that has never been heard.
    pub(crate) const NEVER: Self = Self { age_us: u32::MAX, good_us: 0, late: true };
    /// A stream that is in good order.
    pub(crate) const GOOD: Self = Self { age_us: 0, good_us: 0, late: false };

    #[inline]
    pub(crate) fn step(&mut self, came: bool, elapsed_us: u32, limits: &SilenceLimits) {
        if came && !self.late {
            self.age_us = 0;
        } else {
            self.silent(came, elapsed_us, limits);
        }
    }

    /// Nothing came, or not for long enough yet.
    #[cold]
    fn silent(&mut self, came: bool, elapsed_us: u32, limits: &SilenceLimits) {
        self.age_us = if came { 0 } else { self.age_us.saturating_add(elapsed_us) };
        // Gaps of half the time that is late are no good stream: a single item brings nothing back.
        if self.age_us > limits.late_us / 2 {
            self.good_us = 0;
        }
        if self.age_us >= limits.late_us {
            self.late = true;
        } else if self.late && self.age_us <= limits.late_us / 2 {
            self.good_us = self.good_us.saturating_add(elapsed_us);
            self.late = self.good_us < limits.good_us;
        }
    }
}
