//! How old a packet is at most when it comes, although neither side knows the other's clock.
//!
//! Each packet carries its sender's clock s and the newest s' that its sender had heard from the
//! other side. Both are under the tag, and give the receiver, whose clock is r, two bounds:
//!
//! ```text
//! echo     r - s'                          the packet was made after s' was heard, which was sent at s'
//! clocks   a0 + (r - r0) - (s - s0) + drift    it was made s - s0 after one that was at most a0 old at r0
//! ```
//!
//! The lesser of both holds. The first needs no clock but the receiver's own, and is renewed with
//! each packet that gets through the other way. The second carries on where none does: drift is a
//! fiftieth of s - s0, more than a clock that is out of order is off (thesis chapter 6: 1 %), so a
//! side that hears nothing at all is believed for most of a minute, and where the clocks agree for longer.
//!
//! A bound is never less than the true age: what somebody has withheld for longer than [`OLDEST_MS`]
//! is refused. Clocks are ms modulo 2^32; a session that is silent ends long before they wrap.

use crate::packet::Refused;

/// A packet may be this old by its receiver's clock, ms: less than two seconds by a clock that is out
/// of order, too.
pub const OLDEST_MS: u32 = 1900;

/// Two clocks differ in pace by less than one part of so many.
const DRIFT: i64 = 50;

/// What is known of the other side's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Age {
    /// Our clock when the newest packet that was accepted came.
    pub(crate) heard_ms: u32,
    /// Its sender's clock when it was made.
    pub(crate) their_ms: u32,
    /// The newest packet whose echo said more than the clocks: both clocks, and how old it was at
    /// most.
    anchor: (u32, u32, i64),
    /// How old the newest packet was at most.
    bound_ms: i64,
}

impl Age {
    /// The first packet of a session: its echo alone says how old it is.
    ///
    /// # Errors
    /// [`Refused::Old`].
    pub(crate) fn first(now_ms: u32, their_ms: u32, echo_ms: u32) -> Result<Self, Refused> {
        let bound_ms = since(now_ms, echo_ms);
        Self { heard_ms: now_ms, their_ms, anchor: (now_ms, their_ms, bound_ms), bound_ms }.checked()
    }

    /// The next packet.
    ///
    /// # Errors
    /// [`Refused::Old`].
    pub(crate) fn next(&self, now_ms: u32, their_ms: u32, echo_ms: u32) -> Result<Self, Refused> {
        let (then_ms, then_their_ms, then_bound_ms) = self.anchor;
        let (ours, theirs) = (since(now_ms, then_ms), since(their_ms, then_their_ms));
        // Both clocks count whole ms.
        let by_clocks = then_bound_ms + ours - theirs + theirs / DRIFT + 1;
        let by_echo = since(now_ms, echo_ms);
        let bound_ms = by_echo.min(by_clocks).max(0);
        let anchor = if by_echo <= by_clocks { (now_ms, their_ms, by_echo) } else { self.anchor };
        Self { heard_ms: now_ms, their_ms, anchor, bound_ms }.checked()
    }

    fn checked(self) -> Result<Self, Refused> {
        if self.bound_ms > i64::from(OLDEST_MS) {
            return Err(Refused::Old { age_ms: u32::try_from(self.bound_ms).unwrap_or(u32::MAX) });
        }
        Ok(self)
    }
}

/// From one time to another, ms; an echo of the future, which nobody genuine sends, is as old as can
/// be.
fn since(now_ms: u32, then_ms: u32) -> i64 {
    i64::from(now_ms.wrapping_sub(then_ms))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_echo_bounds_the_age_and_clocks_carry_on_without_one() {
        let first = Age::first(10_000, 500, 9_000).unwrap();
        assert_eq!(first.bound_ms, 1000);
        assert_eq!(Age::first(10_000, 500, 7_999), Err(Refused::Old { age_ms: 2001 }));
        assert!(Age::first(10_000, 500, 10_001).is_err(), "an echo of the future");
        // 10 ms later by both clocks, with a fresh echo and with none.
        assert_eq!(first.next(10_010, 510, 10_000).unwrap().bound_ms, 10);
        let carried = first.next(10_010, 510, 9_000).unwrap();
        assert_eq!(carried.bound_ms, 1001);
        // Withheld for 0.88 s more, and for a second more.
        assert_eq!(carried.next(10_900, 520, 9_000).unwrap().bound_ms, 1881);
        assert!(carried.next(11_030, 520, 9_000).is_err());
        // And across the wrap of both clocks.
        let late = Age::first(u32::MAX - 5, u32::MAX - 2, u32::MAX - 20).unwrap();
        assert_eq!(late.next(4, 7, u32::MAX - 20).unwrap().bound_ms, 16);
    }

    /// However its sender's clock is off, a side that is heard is believed for as long as it speaks;
    /// one that does not hear us is for most of a minute.
    #[test]
    fn clocks_that_are_off_refuse_nothing_that_is_new() {
        for pace in [0.988, 1.0, 1.012] {
            for hears in [true, false] {
                let mut age = Age::first(0, 0, 0).unwrap();
                let lasts_ms: u32 = if hears { 3_600_000 } else { 55_000 };
                for now_ms in (0..lasts_ms).step_by(if cfg!(miri) { 1000 } else { 10 }) {
                    let echo_ms = if hears { now_ms.saturating_sub(25) } else { 0 };
                    age = age.next(now_ms, (f64::from(now_ms) * pace) as u32, echo_ms).unwrap();
                }
            }
        }
    }
}

/// Both clocks from every residue of 2^32 with a boundary, each with steps of any size, against wide
/// integers that never wrap.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::residues::{FEW, residues};

    /// What an age is by the head of this file, of times that go on.
    #[derive(Debug, Clone, Copy)]
    struct Wide {
        anchor: [i128; 3],
        bound_ms: i128,
    }

    impl Wide {
        fn first(ours: i128, theirs: i128, echo: i128) -> Self {
            Self { anchor: [ours, theirs, ours - echo], bound_ms: ours - echo }
        }

        fn next(&self, ours: i128, theirs: i128, echo: i128) -> Self {
            let [then, their_then, bound_ms] = self.anchor;
            let by_clocks = bound_ms + (ours - then) - (theirs - their_then) + (theirs - their_then) / 50 + 1;
            let by_echo = ours - echo;
            let anchor = if by_echo <= by_clocks { [ours, theirs, by_echo] } else { self.anchor };
            Self { anchor, bound_ms: by_echo.min(by_clocks).max(0) }
        }
    }

    /// The age and its error are those of the wide numbers.
    fn agree(age: Result<Age, Refused>, wide: &Wide, at: [i128; 2]) {
        let old = wide.bound_ms > i128::from(OLDEST_MS);
        match age {
            Ok(age) => {
                assert!(!old, "{age:?} {wide:?}");
                assert_eq!(i128::from(age.bound_ms), wide.bound_ms, "{wide:?}");
                assert_eq!([age.heard_ms, age.their_ms], at.map(|ms| ms as u32));
            }
            Err(refused) => {
                let age_ms = u32::try_from(wide.bound_ms).unwrap_or(u32::MAX);
                assert!(old, "{refused} {wide:?}");
                assert_eq!(refused, Refused::Old { age_ms });
            }
        }
    }

    #[test]
    fn the_first_packets_age_is_its_echos() {
        for now_ms in residues() {
            for echo_age_ms in residues() {
                let (now, age) = (i128::from(now_ms) + (1 << 32), i128::from(echo_age_ms));
                let echo_ms = (now - age) as u32;
                agree(Age::first(now_ms, 7, echo_ms), &Wide::first(now, 7, now - age), [now, 7]);
            }
        }
    }

    /// Ages and steps about the limits, and those that are far beyond.
    const STEPS: [u32; 12] = [0, 1, 10, 49, 50, 51, 1000, 1899, 1900, 1901, 95_000, 1 << 31];

    #[test]
    fn later_packets_ages_are_the_lesser_of_two_bounds() {
        let mut refused = 0;
        for (ours, theirs) in FEW.iter().flat_map(|a| FEW.map(|b| (*a, b))) {
            let (ours, theirs) = (i128::from(ours) + (1 << 40), i128::from(theirs) + (1 << 40));
            for first_age in [0, 1, 50, 1899, 1900] {
                let first = Wide::first(ours, theirs, ours - first_age);
                let age = Age::first(ours as u32, theirs as u32, (ours - first_age) as u32).unwrap();
                for (our_step, their_step, echo_age) in
                    STEPS.iter().flat_map(|a| STEPS.iter().flat_map(move |b| STEPS.map(|c| (*a, *b, c))))
                {
                    let at = [ours + i128::from(our_step), theirs + i128::from(their_step)];
                    let echo = at[0] - i128::from(echo_age);
                    let wide = first.next(at[0], at[1], echo);
                    let next = age.next(at[0] as u32, at[1] as u32, echo as u32);
                    agree(next, &wide, at);
                    refused += u32::from(next.is_err());
                    // And one more, by whichever anchor there is now.
                    let Ok(next) = next else { continue };
                    let then = [at[0] + 10, at[1] + 10];
                    let again = next.next(then[0] as u32, then[1] as u32, echo as u32);
                    agree(again, &wide.next(then[0], then[1], echo), then);
                }
            }
        }
        assert!(refused > 50_000, "{refused}");
    }
}
