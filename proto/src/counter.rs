//! Packet numbers that never come twice, not even after a restart, and that go on at once after
//! one.
//!
//! A sender takes numbers only from a stretch that its store holds as used already, so after a
//! crash it goes on behind it. A receiver accepts only growing numbers, and only under a limit that
//! its store holds already, so after a restart it refuses everything it may have accepted before.
//! Both ask for the next stretch when half of one is left: the store may be slow, and is never
//! waited for in a control loop.
//!
//! After a restart a receiver's limit is above the other side's numbers, but by no more than
//! [`RESERVE`]: it asks for a stretch only once a genuine packet has come, and from that packet's
//! number on. Nobody has to wait for the numbers to catch up:
//!
//! - a sender that starts anew begins [`LEAP`] ahead of what its store holds, above any limit of
//!   the other side;
//! - who sees numbers leap by [`LEAP`] or more knows that the other side has started anew, and goes
//!   on with its own numbers [`RESERVE`] ahead, above the other's limit
//!   ([`Sealer::follow`](crate::Sealer::follow)). That is less than a leap, so it is not answered
//!   with another one;
//! - a sender that is behind a restarted receiver hears
//!   [`accepts_from`](crate::Identity::accepts_from) and skips ahead, where the receiver does not
//!   speak before it has heard somebody.
//!
//! So a killed program is as good as one that ended: nothing has to be stored at the end. A restart
//! costs a few thousand of 2^64 numbers.

/// Length of a stretch of numbers.
pub const RESERVE: u64 = 1024;

/// How far ahead a sender begins that starts anew: a stretch for the other side's limit, and one
/// more, so that nobody takes its following ([`SendCounter::follow`]) for a new start.
pub const LEAP: u64 = 2 * RESERVE;

/// Keeps one number through a restart. Storing has to be done (on the disk, in the flash) when it
/// returns.
pub trait CounterStore {
    /// What can go wrong.
    type Error;

    /// The number as it was stored last; 0 if there is none.
    ///
    /// # Errors
    /// It cannot be read. Then no number is safe.
    fn load(&mut self) -> Result<u64, Self::Error>;

    /// Stores a number, greater than all before.
    ///
    /// # Errors
    /// It cannot be stored. Then the stretch must not be used.
    fn store(&mut self, number: u64) -> Result<(), Self::Error>;
}

/// Numbers for a sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SendCounter {
    next: u64,
    reserved: Reserved,
}

impl SendCounter {
    /// Starts anew: `stored` is what the store holds. Numbers come once a stretch is reserved.
    pub fn resume(stored: u64) -> Self {
        Self { next: stored.saturating_add(LEAP), reserved: Reserved { end: stored } }
    }

    /// Numbers from 0 on that no store holds: for links without a key.
    pub fn volatile() -> Self {
        Self { next: 0, reserved: Reserved { end: u64::MAX } }
    }

    /// What has to be stored next, if it is time; then call [`SendCounter::reserved`].
    pub fn to_reserve(&self) -> Option<u64> {
        self.reserved.due(self.next)
    }

    /// The store holds `number`.
    pub fn reserved(&mut self, number: u64) {
        self.reserved.extend(number);
    }

    /// Stores what has to be stored.
    ///
    /// # Errors
    /// The store's.
    pub fn keep<S: CounterStore>(&mut self, store: &mut S) -> Result<(), S::Error> {
        if let Some(number) = self.to_reserve() {
            store.store(number)?;
            self.reserved(number);
        }
        Ok(())
    }

    /// The receiver accepts numbers from here on.
    pub fn skip_to(&mut self, number: u64) {
        self.next = self.next.max(number);
    }

    /// The other side has started anew: goes on above its limit.
    pub fn follow(&mut self) {
        self.next = self.next.saturating_add(RESERVE);
    }

    /// The next number; none if nothing is reserved.
    pub fn take(&mut self) -> Option<u64> {
        let number = self.next;
        if number >= self.reserved.end {
            return None;
        }
        self.next = number + 1;
        Some(number)
    }
}

/// Numbers set aside: the store holds that none from `end` on has been used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Reserved {
    end: u64,
}

impl Reserved {
    /// What has to be stored for numbers from `base` on, if it is time.
    fn due(&self, base: u64) -> Option<u64> {
        (self.end.saturating_sub(base) < RESERVE / 2).then(|| base.saturating_add(RESERVE))
    }

    /// The store holds `number`.
    fn extend(&mut self, number: u64) {
        self.end = self.end.max(number);
    }
}

/// What a receiver makes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Accepted; `lost` numbers before it never came.
    Fresh { lost: u64 },
    /// Received before, or could have been.
    Replayed { accepts_from: u64 },
    /// Beyond what is reserved: will be accepted once more is reserved.
    NotYet,
}

/// Numbers that a receiver has seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReplayGuard {
    accepts_from: u64,
    reserved: Reserved,
    /// One more than the greatest genuine number that lay beyond the reserved stretch.
    wanted: u64,
    /// No genuine number above the limit has come since the start.
    silent: bool,
    /// Nothing has been accepted since the start: a gap before the first one is no loss.
    fresh: bool,
    /// The other side has started anew, and nobody has asked for it yet.
    leapt: bool,
    /// No store and no key: a sender that starts anew at 0 is let in.
    volatile: bool,
}

impl ReplayGuard {
    /// Goes on after a restart: `stored` is what the store holds.
    pub fn resume(stored: u64) -> Self {
        Self {
            accepts_from: stored,
            reserved: Reserved { end: stored },
            wanted: stored,
            silent: true,
            fresh: true,
            leapt: false,
            volatile: false,
        }
    }

    /// Order only: for links without a key.
    pub fn volatile() -> Self {
        Self { reserved: Reserved { end: u64::MAX }, volatile: true, ..Self::resume(0) }
    }

    /// Least number that will be accepted.
    pub fn accepts_from(&self) -> u64 {
        self.accepts_from
    }

    /// Where the numbers go on from, as far as they have been heard.
    fn base(&self) -> u64 {
        self.accepts_from.max(self.wanted)
    }

    /// What has to be stored next, if it is time; then call [`ReplayGuard::reserved`].
    pub fn to_reserve(&self) -> Option<u64> {
        // Otherwise each start without a word from the other side would move the limit farther away
        // from it.
        self.reserved.due(self.base()).filter(|_| !self.silent)
    }

    /// Has the other side started anew since this was asked last?
    pub fn take_leap(&mut self) -> bool {
        core::mem::take(&mut self.leapt)
    }

    /// The store holds `number`.
    pub fn reserved(&mut self, number: u64) {
        self.reserved.extend(number);
    }

    /// Stores what has to be stored.
    ///
    /// # Errors
    /// The store's.
    pub fn keep<S: CounterStore>(&mut self, store: &mut S) -> Result<(), S::Error> {
        if let Some(number) = self.to_reserve() {
            store.store(number)?;
            self.reserved(number);
        }
        Ok(())
    }

    /// Judges the number of a packet that is genuine.
    pub(crate) fn judge(&mut self, number: u64) -> Verdict {
        let began_anew = self.volatile && number.saturating_add(RESERVE) < self.accepts_from;
        if number < self.accepts_from && !began_anew {
            return Verdict::Replayed { accepts_from: self.accepts_from };
        }
        self.silent = false;
        if number >= self.reserved.end {
            self.wanted = self.wanted.max(number.saturating_add(1));
            return Verdict::NotYet;
        }
        let gap = if self.fresh || began_anew { 0 } else { number - self.accepts_from };
        self.leapt |= gap >= LEAP && !self.volatile;
        (self.accepts_from, self.fresh) = (number + 1, false);
        // Numbers that were left out are not lost.
        Verdict::Fresh { lost: if gap < RESERVE { gap } else { 0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A store that can be made to fail.
    #[derive(Default)]
    struct Store {
        number: u64,
        broken: bool,
    }

    impl CounterStore for Store {
        type Error = ();

        fn load(&mut self) -> Result<u64, ()> {
            Ok(self.number)
        }

        fn store(&mut self, number: u64) -> Result<(), ()> {
            assert!(number > self.number, "stored numbers grow");
            if self.broken {
                return Err(());
            }
            self.number = number;
            Ok(())
        }
    }

    #[test]
    fn a_sender_never_takes_a_number_twice_however_often_it_crashes() {
        let mut store = Store::default();
        let mut last = None;
        for crash_after in [0_u32, 1, 3, 500, 511, 512, 513, 1023, 1024, 1025, 5000] {
            let mut counter = SendCounter::resume(store.load().unwrap());
            assert_eq!(counter.take(), None, "nothing is reserved yet");
            for _ in 0..crash_after {
                counter.keep(&mut store).unwrap();
                let number = counter.take().unwrap();
                assert!(last.is_none_or(|last| number > last), "{last:?} {number}");
                last = Some(number);
            }
        }
    }

    #[test]
    fn without_a_store_the_numbers_end() {
        let mut store = Store { broken: true, ..Store::default() };
        let mut counter = SendCounter::resume(0);
        assert!(counter.keep(&mut store).is_err());
        assert_eq!(counter.take(), None);
        counter.reserved(LEAP + 3);
        assert_eq!([0, 1, 2, 3].map(|_| counter.take()), [Some(LEAP), Some(LEAP + 1), Some(LEAP + 2), None]);
    }

    #[test]
    fn a_restarted_receiver_refuses_everything_it_accepted() {
        let mut store = Store::default();
        let mut seen = Vec::new();
        for from in [0, 10_000, 10_500, u64::MAX - 3000] {
            let mut guard = ReplayGuard::resume(store.load().unwrap());
            for number in &seen {
                assert!(matches!(guard.judge(*number), Verdict::Replayed { .. }), "{number} after a restart");
            }
            let from = guard.accepts_from().max(from);
            for number in from..from + 700 {
                guard.keep(&mut store).unwrap();
                if guard.judge(number) == Verdict::NotYet {
                    guard.keep(&mut store).unwrap();
                    assert!(matches!(guard.judge(number), Verdict::Fresh { .. }), "{number}");
                }
                assert!(matches!(guard.judge(number), Verdict::Replayed { .. }), "{number} twice");
                seen.push(number);
            }
        }
    }

    #[test]
    fn gaps_are_counted_and_order_is_kept() {
        let mut guard = ReplayGuard::resume(0);
        guard.reserved(1000);
        assert_eq!(guard.judge(100), Verdict::Fresh { lost: 0 });
        assert_eq!(guard.judge(101), Verdict::Fresh { lost: 0 });
        assert_eq!(guard.judge(105), Verdict::Fresh { lost: 3 });
        assert_eq!(guard.judge(104), Verdict::Replayed { accepts_from: 106 }, "late is too late");
        assert_eq!(guard.judge(1000), Verdict::NotYet);
    }

    #[test]
    fn a_new_start_of_the_other_side_is_seen_and_following_it_is_not_taken_for_one() {
        let heard = |numbers: &[u64]| {
            let mut guard = ReplayGuard::resume(0);
            guard.reserved(u64::MAX);
            let verdicts: Vec<_> = numbers.iter().map(|number| guard.judge(*number)).collect();
            (verdicts.last().copied().unwrap(), guard.take_leap(), guard.take_leap())
        };
        let mut sender = SendCounter::resume(700);
        sender.reserved(u64::MAX);
        let first = sender.take().unwrap();
        assert_eq!(heard(&[699, first]), (Verdict::Fresh { lost: 0 }, true, false));
        sender.follow();
        let after = sender.take().unwrap();
        assert_eq!(heard(&[first, after]), (Verdict::Fresh { lost: 0 }, false, false));
        assert_eq!(heard(&[first]), (Verdict::Fresh { lost: 0 }, false, false), "nothing to leap from");
        let mut open = ReplayGuard::volatile();
        open.judge(0);
        open.judge(1 << 40);
        assert!(!open.take_leap(), "who needs no key cannot use numbers up");
    }

    /// However often a receiver starts without a word from the sender, its limit stays where the
    /// sender can reach it.
    #[test]
    fn a_limit_does_not_run_away() {
        let mut store = Store::default();
        let mut guard = ReplayGuard::resume(0);
        guard.judge(4999);
        guard.keep(&mut store).unwrap();
        for _ in 0..10 {
            let mut again = ReplayGuard::resume(store.load().unwrap());
            again.keep(&mut store).unwrap();
            assert_eq!(again.accepts_from(), 5000 + RESERVE);
        }
    }

    #[test]
    fn an_open_link_lets_a_new_start_in() {
        let mut guard = ReplayGuard::volatile();
        assert_eq!(guard.judge(5000), Verdict::Fresh { lost: 0 });
        assert!(matches!(guard.judge(4990), Verdict::Replayed { .. }));
        assert_eq!(guard.judge(0), Verdict::Fresh { lost: 0 });
        assert_eq!(guard.to_reserve(), None);
    }
}
