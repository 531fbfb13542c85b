//! The ground's clock, by what the ground says of it: how long ago was a pose taken?
//!
//! The ground sends its time again and again ([`proto::Timer`]), and each pose with the time at
//! which it was taken. The message that came fastest shows the difference of the two clocks best,
//! so the greatest difference counts; it is let go at 100 parts in a million, more than two crystals
//! differ by. An age is therefore too young by what the fastest message takes, and never too old.
//!
//! A ground station that starts anew has another zero, and a session of its own: with that, what is
//! known of the clock before is forgotten. Within a session, what is off by more than a second counts
//! once it has been so for a second. Before the first time of the ground no age is known.

/// Clocks this far apart are another start of the ground, us.
const OTHER_START_US: u32 = 1_000_000;
/// So many us of craft's time are one of difference that is let go: 100 parts in a million.
const LET_GO_US: u32 = 10_000;

/// What is known of the ground's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct GroundClock {
    /// Ground's time less craft's, modulo 2^32, us, and the craft's time up to which it was let go.
    ahead: Option<(u32, u32)>,
    /// Since when, by the craft, the ground has said something else altogether.
    other_since_us: Option<u32>,
}

impl GroundClock {
    /// The ground's time has come at this time of the craft.
    pub(crate) fn hear(&mut self, ground_us: u32, craft_us: u32) {
        let ahead_us = ground_us.wrapping_sub(craft_us);
        let Some((kept_us, let_go_at_us)) = self.ahead else {
            self.ahead = Some((ahead_us, craft_us));
            return;
        };
        let periods = craft_us.wrapping_sub(let_go_at_us) / LET_GO_US;
        let kept_us = kept_us.wrapping_sub(periods);
        let let_go_at_us = let_go_at_us.wrapping_add(periods * LET_GO_US);
        let faster_us = ahead_us.wrapping_sub(kept_us).cast_signed();
        if faster_us.unsigned_abs() < OTHER_START_US {
            self.other_since_us = None;
            self.ahead = Some((kept_us.wrapping_add_signed(faster_us.max(0)), let_go_at_us));
            return;
        }
        let since_us = *self.other_since_us.get_or_insert(craft_us);
        if craft_us.wrapping_sub(since_us) >= OTHER_START_US {
            *self = Self { ahead: Some((ahead_us, craft_us)), other_since_us: None };
        } else {
            self.ahead = Some((kept_us, let_go_at_us));
        }
    }

    /// How long ago at this time of the craft something of that time of the ground was, us, at
    /// least; 0 if nobody knows.
    #[inline]
    pub(crate) fn age_us(&self, ground_us: u32, craft_us: u32) -> u32 {
        let Some((ahead_us, _)) = self.ahead else { return 0 };
        let age_us = craft_us.wrapping_add(ahead_us).wrapping_sub(ground_us).cast_signed();
        age_us.max(0).unsigned_abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times of the ground 50 ms apart, 3 to 9 ms on their way, to a craft that booted 7 s later
    /// and whose clock wraps meanwhile.
    fn heard(times: u32) -> (GroundClock, u32) {
        let mut clock = GroundClock::default();
        let boot_us = 0_u32.wrapping_sub(1_000_000);
        for k in 0..times {
            clock.hear(7_000_000 + 50_000 * k, boot_us.wrapping_add(50_000 * k + 3_000 + 1_000 * (k % 7)));
        }
        (clock, boot_us)
    }

    #[test]
    fn an_age_is_exact_but_for_the_fastest_message() {
        let (clock, boot_us) = heard(100);
        for age_us in [0_u32, 20_000, 150_000, 5_000_000] {
            let now_us = boot_us.wrapping_add(5_000_000);
            let taken_us = 12_000_000 - age_us;
            // 3 ms of way, and 5 to 35 us of difference that was let go.
            let want = age_us.saturating_sub(3_000);
            assert!(
                clock.age_us(taken_us, now_us).abs_diff(want) < 100,
                "{}",
                clock.age_us(taken_us, now_us)
            );
        }
        assert_eq!(GroundClock::default().age_us(1, 5_000_000), 0, "nobody knows");
        assert_eq!(clock.age_us(20_000_000, boot_us), 0, "out of the future");
    }

    /// Two clocks 80 parts in a million apart for an hour.
    #[test]
    fn clocks_may_drift() {
        for drift in [-80_i64, 80] {
            let mut clock = GroundClock::default();
            for k in 0..if cfg!(miri) { 500 } else { 36_000_i64 } {
                let craft_us = 100_000 * k;
                let ground_us = craft_us + craft_us * drift / 1_000_000;
                clock.hear(ground_us as u32, craft_us as u32);
                assert!(clock.age_us((ground_us - 50_000) as u32, craft_us as u32).abs_diff(50_000) < 200);
            }
        }
    }

    /// One time that is wrong moves nothing; a ground that starts anew is believed after a second.
    #[test]
    fn another_start_of_the_ground_counts_after_a_second() {
        let (mut clock, boot_us) = heard(100);
        let at = |k: u32| boot_us.wrapping_add(5_000_000 + 50_000 * k);
        clock.hear(0, at(0));
        assert!(clock.age_us(11_900_000, at(0)).abs_diff(97_000) < 100);
        clock.hear(12_050_000, at(1).wrapping_add(3_000));
        for k in 2..30 {
            clock.hear(50_000 * k, at(k));
            let known = clock.age_us(50_000 * k, at(k)) < 100;
            assert_eq!(known, k >= 22, "{k}");
        }
    }
}

/// Both clocks from every residue of 2^32 with a boundary, steps of any size that two messages can be
/// apart, and ages of up to half a turn either way: against wide integers that never wrap.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::residues::{FEW, TURN, residues};

    /// The head of this file in times that go on.
    #[derive(Debug, Clone, Copy)]
    struct Wide {
        ahead: i128,
        let_go_at: i128,
        other_since: Option<i128>,
    }

    impl Wide {
        /// Whether the ground is believed to have begun anew.
        fn hear(&mut self, ground: i128, craft: i128) -> bool {
            let (ahead, period) = (ground - craft, i128::from(LET_GO_US));
            let periods = (craft - self.let_go_at) / period;
            (self.ahead, self.let_go_at) = (self.ahead - periods, self.let_go_at + periods * period);
            let faster = ahead - self.ahead;
            if faster.abs() < i128::from(OTHER_START_US) {
                (self.ahead, self.other_since) = (self.ahead + faster.max(0), None);
            } else if craft - *self.other_since.get_or_insert(craft) >= i128::from(OTHER_START_US) {
                *self = Self { ahead, let_go_at: craft, other_since: None };
                return true;
            }
            false
        }

        fn agrees(&self, clock: &GroundClock) {
            let ahead = (self.ahead.rem_euclid(TURN) as u32, self.let_go_at.rem_euclid(TURN) as u32);
            let other_since_us = self.other_since.map(|since| since.rem_euclid(TURN) as u32);
            assert_eq!(*clock, GroundClock { ahead: Some(ahead), other_since_us }, "{self:?}");
        }
    }

    /// Times that pass between two messages, and how far the second is off, us.
    const APART: [i128; 8] = [0, 1, 9_999, 10_000, 999_999, 1_000_000, 3_000_000, 1 << 30];
    const OFF: [i128; 9] =
        [0, 1, -1, 999_999, -999_999, 1_000_000, -1_000_000, (1 << 31) - 1_000_000, 1_000_000 - (1 << 31)];

    /// Three messages after the first, each as far apart and off as any other.
    #[test]
    fn what_is_known_of_the_ground_is_what_was_said() {
        let mut begun_anew = 0;
        for (ground, craft) in FEW.iter().flat_map(|a| FEW.map(|b| (i128::from(*a), i128::from(b)))) {
            let steps = || APART.into_iter().flat_map(|apart| OFF.map(|off| (apart, off)));
            for (first, second) in steps().flat_map(|first| steps().map(move |second| (first, second))) {
                let mut clock = GroundClock::default();
                clock.hear(ground as u32, craft as u32);
                let mut wide = Wide { ahead: ground - craft, let_go_at: craft, other_since: None };
                let mut now = craft;
                for (apart, off) in [first, second, (1_000_000, second.1)] {
                    now += apart;
                    let said = now + ground - craft + off;
                    begun_anew += u32::from(wide.hear(said, now));
                    clock.hear(said.rem_euclid(TURN) as u32, now.rem_euclid(TURN) as u32);
                    wide.agrees(&clock);
                }
            }
        }
        assert!(begun_anew > 1000, "{begun_anew}");
    }

    /// What is out of the future, or of more than half a turn ago, is of now.
    #[test]
    fn an_age_is_the_time_that_has_passed() {
        for (ground, craft) in residues().into_iter().flat_map(|a| FEW.map(|b| (a, b))) {
            let mut clock = GroundClock::default();
            clock.hear(ground, craft);
            for age in residues() {
                let taken = i128::from(ground) - i128::from(age);
                let want = if i128::from(age) < TURN / 2 { age } else { 0 };
                assert_eq!(
                    clock.age_us(taken.rem_euclid(TURN) as u32, craft),
                    want,
                    "{ground} {craft} {age}"
                );
            }
        }
    }
}
