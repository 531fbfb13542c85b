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
                for now_ms in (0..lasts_ms).step_by(10) {
                    let echo_ms = if hears { now_ms.saturating_sub(25) } else { 0 };
                    age = age.next(now_ms, (f64::from(now_ms) * pace) as u32, echo_ms).unwrap();
                }
            }
        }
    }
}
