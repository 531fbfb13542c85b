//! Timers of the detectors: for how long something has held, and for how long a stream has been
//! silent.
//!
//! They are ages in microseconds that grow by the time since the tick before and stay at the
//! greatest number. No clock is kept, so a clock that wraps (every 71.6 minutes) disturbs none.

use crate::safety::limits::SilenceLimits;

/// How long a condition has held, in us.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Held(u32);

impl Held {
    /// It does not hold.
    pub(crate) const NOT: Self = Self(0);

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_holds_counts_after_its_time_and_begins_anew() {
        let mut held = Held::default();
        let steps = [true, true, true, false, true, true, true];
        let counted = steps.map(|now| held.step(now, 10, 30));
        assert_eq!(counted, [false, false, true, false, false, false, true]);
        let mut long = Held(u32::MAX - 5);
        assert!(long.step(true, 10, u32::MAX), "an age stays at the greatest number");
    }

    const LIMITS: SilenceLimits = SilenceLimits { late_us: 100, lost_us: 300, good_us: 80 };

    #[test]
    fn a_stream_is_late_after_its_time_without_an_item() {
        let mut stream = Silence::GOOD;
        for k in 1..=9 {
            stream.step(false, 10, &LIMITS);
            assert_eq!((stream.age_us, stream.late), (10 * k, false));
        }
        stream.step(false, 10, &LIMITS);
        assert!(stream.late);
        stream.step(false, u32::MAX, &LIMITS);
        assert_eq!(stream.age_us, u32::MAX);
    }

    #[test]
    fn a_late_stream_needs_good_items_for_a_while() {
        let mut stream = Silence::NEVER;
        let late = [10; 8].map(|elapsed_us| {
            stream.step(true, elapsed_us, &LIMITS);
            stream.late
        });
        assert_eq!(late, [true, true, true, true, true, true, true, false]);
        // One item in a gap longer than half the time that is late brings nothing back.
        let mut stream = Silence::NEVER;
        for _ in 0..100 {
            stream.step(true, 10, &LIMITS);
            (0..6).for_each(|_| stream.step(false, 10, &LIMITS));
            assert!(stream.late);
        }
    }
}

/// Ages at every boundary of 2^32, and time that passes as long: against wide integers.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::residues::{FEW, residues};

    const MOST: u64 = u32::MAX as u64;

    fn later(age_us: u32, elapsed_us: u32) -> u64 {
        (u64::from(age_us) + u64::from(elapsed_us)).min(MOST)
    }

    #[test]
    fn what_has_held_goes_on_to_the_greatest_number() {
        for (age_us, elapsed_us) in
            residues().into_iter().flat_map(|a| residues().into_iter().map(move |b| (a, b)))
        {
            for for_us in FEW {
                let mut held = Held(age_us);
                let want = later(age_us, elapsed_us);
                assert_eq!(held.step(true, elapsed_us, for_us), want >= for_us.into());
                assert_eq!(u64::from(held.0), want);
                assert!(!held.step(false, elapsed_us, for_us) && held == Held::NOT);
            }
        }
    }

    /// One step of every stream, by the words of [`Silence`].
    #[test]
    fn a_silence_is_as_long_as_it_is() {
        let ages = || FEW.into_iter().chain([99, 100, 101, 49, 50, 51]);
        let limits = || FEW.into_iter().flat_map(|late_us| FEW.map(move |good_us| (late_us, good_us)));
        for (age_us, good_us) in ages().flat_map(|a| ages().map(move |b| (a, b))) {
            for elapsed_us in ages() {
                for (late_us, good_for_us) in limits().chain([(100, 80)]) {
                    for (late, came) in [(false, false), (false, true), (true, false), (true, true)] {
                        let mut stream = Silence { age_us, good_us, late };
                        stream.step(
                            came,
                            elapsed_us,
                            &SilenceLimits { late_us, lost_us: 0, good_us: good_for_us },
                        );
                        let age = if came { 0 } else { later(age_us, elapsed_us) };
                        assert_eq!(u64::from(stream.age_us), age);
                        let (gap, silent) = (2 * age > late_us.into(), age >= late_us.into());
                        let good = if gap { 0 } else { later(good_us, elapsed_us) };
                        let want =
                            if late { silent || gap || good < good_for_us.into() } else { silent && !came };
                        assert_eq!(
                            stream.late, want,
                            "{late} {came} {age} of {late_us}, {good} of {good_for_us}"
                        );
                    }
                }
            }
        }
    }
}
