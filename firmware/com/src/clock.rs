//! The beat of the loop: an absolute timer on the monotonic clock, and how late each beat comes.
//!
//! Beats lie on a fixed grid (`clock_nanosleep`, TIMER_ABSTIME, CLOCK_MONOTONIC), so lateness does
//! not add up, and nobody who sets the wall clock moves one. A beat that is later than a whole
//! period leaves out those that have passed: the law is made for one tick at a time, and two in a
//! row would be as wrong as one too few.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Nanoseconds of the monotonic clock.
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // The clock counts from the start of the machine: it is not negative and fits for 584 years.
    (now.tv_sec as u64).wrapping_mul(1_000_000_000).wrapping_add(now.tv_nsec as u64)
}

/// Milliseconds of the monotonic clock, modulo 2^32: the time that the link's packets carry.
pub fn monotonic_ms() -> u32 {
    (monotonic_ns() / 1_000_000) as u32
}

/// A beat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beat {
    /// The monotonic clock now, us modulo 2^32.
    pub time_us: u32,
    /// How much later than it should be, us.
    pub late_us: u32,
    /// Beats before it that were left out.
    pub missed: u32,
}

/// Gives beats.
#[derive(Debug, Clone, Copy)]
pub struct Ticker {
    period_ns: u64,
    next_ns: u64,
}

impl Ticker {
    /// The first beat is one period from now.
    pub fn start(period_ns: u64) -> Self {
        let period_ns = period_ns.max(1);
        Self { period_ns, next_ns: monotonic_ns() + period_ns }
    }

    /// Sleeps until the next beat.
    pub fn wait(&mut self) -> Beat {
        let at = Timespec {
            tv_sec: (self.next_ns / 1_000_000_000) as i64,
            tv_nsec: (self.next_ns % 1_000_000_000) as _,
        };
        // A signal wakes early: sleep on.
        while clock_nanosleep_absolute(ClockId::Monotonic, &at) == Err(rustix::io::Errno::INTR) {}
        self.beat(monotonic_ns())
    }

    /// The beat at `now_ns`, and when the next one is due.
    fn beat(&mut self, now_ns: u64) -> Beat {
        let late_ns = now_ns.saturating_sub(self.next_ns);
        let missed = late_ns / self.period_ns;
        self.next_ns += (missed + 1) * self.period_ns;
        Beat {
            time_us: (now_ns / 1000) as u32,
            late_us: u32::try_from(late_ns / 1000).unwrap_or(u32::MAX),
            missed: u32::try_from(missed).unwrap_or(u32::MAX),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residues::{TURN, residues_u64};

    #[test]
    fn beats_lie_on_the_grid_and_those_that_have_passed_are_left_out() {
        let mut ticker = Ticker { period_ns: 10_000_000, next_ns: 50_000_000 };
        let mut beat = |now_ns| ticker.beat(now_ns);
        assert_eq!(beat(50_000_000), Beat { time_us: 50_000, late_us: 0, missed: 0 });
        assert_eq!(beat(60_123_456), Beat { time_us: 60_123, late_us: 123, missed: 0 });
        assert_eq!(beat(95_000_000), Beat { time_us: 95_000, late_us: 25_000, missed: 2 });
        // The grid is where it was: the next one is due at 100 ms.
        assert_eq!(beat(100_000_001), Beat { time_us: 100_000, late_us: 0, missed: 0 });
    }

    #[test]
    fn the_clock_wraps() {
        let mut ticker = Ticker { period_ns: 10_000_000, next_ns: (1 << 32) * 1000 };
        assert_eq!(ticker.beat((1 << 32) * 1000 + 5000).time_us, 5);
    }

    /// Beats due at every boundary up to 2^63 ns (292 years), late by every other one: against wide
    /// integers. The grid is kept, the next beat is still to come, and all that is between is missed.
    #[test]
    fn a_grid_is_kept_whatever_passes() {
        let all = || residues_u64().into_iter().filter(|ns| *ns < 1 << 62);
        for period_ns in [100_000, 2_000_001, 10_000_000, 100_000_000] {
            for next_ns in all() {
                for late_ns in all().chain([period_ns - 1, period_ns, period_ns + 1]) {
                    let mut ticker = Ticker { period_ns, next_ns };
                    let now_ns = next_ns + late_ns;
                    let Beat { time_us, late_us, missed } = ticker.beat(now_ns);
                    let [due, late, period] = [next_ns, late_ns, period_ns].map(i128::from);
                    assert_eq!(i128::from(time_us), (due + late) / 1000 % TURN);
                    assert_eq!(u32::try_from(late / 1000).unwrap_or(u32::MAX), late_us);
                    assert_eq!(u32::try_from(late / period).unwrap_or(u32::MAX), missed);
                    let next = i128::from(ticker.next_ns);
                    assert!((next - due) % period == 0 && (1..=period).contains(&(next - due - late)));
                }
            }
            // A clock that is read before its time, as none should.
            let mut ticker = Ticker { period_ns, next_ns: 1 << 40 };
            assert_eq!(ticker.beat(0), Beat { time_us: 0, late_us: 0, missed: 0 });
        }
    }

    /// However busy the machine is, no beat comes early, and beats and gaps add up to the time that
    /// has passed.
    #[test]
    fn no_beat_is_early() {
        let period_ns = 2_000_000;
        let mut ticker = Ticker::start(period_ns);
        let start_ns = ticker.next_ns;
        let mut due = 0;
        for _ in 0..25 {
            let beat = ticker.wait();
            let now_ns = monotonic_ns();
            due += u64::from(beat.missed);
            assert!(now_ns >= start_ns + due * period_ns, "beat {due} at {now_ns}, start {start_ns}");
            due += 1;
            assert_eq!(ticker.next_ns, start_ns + due * period_ns);
        }
    }
}
