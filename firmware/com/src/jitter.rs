//! How late the loop's beats come on this machine: the number to check before anything flies.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::clock::{Beat, Ticker};
use crate::realtime;

/// Lateness of many beats, us.
#[derive(Debug, Clone, Default)]
pub struct Lateness {
    sorted_us: Vec<u32>,
    missed: u64,
}

impl Lateness {
    /// Collects the lateness of these beats.
    pub fn of(beats: &[Beat]) -> Self {
        let mut sorted_us: Vec<u32> = beats.iter().map(|beat| beat.late_us).collect();
        sorted_us.sort_unstable();
        Self { sorted_us, missed: beats.iter().map(|beat| u64::from(beat.missed)).sum() }
    }

    /// The lateness in us that `permille` of 1000 beats do not exceed.
    pub fn permille_us(&self, permille: usize) -> u32 {
        let last = self.sorted_us.len().saturating_sub(1);
        // Nearest rank, rounded up.
        let at = (self.sorted_us.len() * permille).div_ceil(1000).saturating_sub(1).min(last);
        self.sorted_us.get(at).copied().unwrap_or(0)
    }
}

impl fmt::Display for Lateness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [half, most, nearly_all, all] = [500, 990, 999, 1000].map(|permille| self.permille_us(permille));
        write!(
            f,
            "{} beats: late by {half} us (median), {most} us (99 %), {nearly_all} us (99.9 %), {all} us (greatest); {} missed",
            self.sorted_us.len(),
            self.missed
        )
    }
}

/// Measures `beats` beats of `period_ns` with the loop's rights, while `busy` threads without them
/// compute. Logs which rights were granted.
pub fn measure(period_ns: u64, beats: usize, priority: u8, busy: usize) -> Lateness {
    let done = Arc::new(AtomicBool::new(false));
    let load: Vec<_> = (0..busy)
        .map(|_| {
            let done = Arc::clone(&done);
            thread::spawn(move || {
                while !done.load(Ordering::Relaxed) {
                    std::hint::spin_loop()
                }
            })
        })
        .collect();
    for line in realtime::ask_for(priority) {
        crate::error::log(&line);
    }
    let mut seen = Vec::with_capacity(beats);
    let mut ticker = Ticker::start(period_ns);
    seen.extend((0..beats).map(|_| ticker.wait()));
    done.store(true, Ordering::Relaxed);
    load.into_iter().for_each(|thread| drop(thread.join()));
    Lateness::of(&seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_those_of_the_sorted_beats() {
        let beat = |late_us| Beat { time_us: 0, late_us, missed: u32::from(late_us == 1000) };
        let beats: Vec<Beat> = (1..=1000).rev().map(beat).collect();
        let lateness = Lateness::of(&beats);
        assert_eq!([500, 990, 999, 1000].map(|p| lateness.permille_us(p)), [500, 990, 999, 1000]);
        assert_eq!(lateness.missed, 1);
        assert_eq!(Lateness::default().permille_us(500), 0);
    }

    /// Every rank of up to 300 beats, by its definition: the least that so many of 1000 do not exceed.
    #[test]
    fn any_rank_is_the_least_that_so_many_do_not_exceed() {
        for count in 0..300 {
            let beats: Vec<Beat> =
                (1..=count).map(|late_us| Beat { time_us: 0, late_us, missed: 0 }).collect();
            let lateness = Lateness::of(&beats);
            for permille in 0..=1000_u32 {
                // Beat k of the sorted ones is k us late.
                let want = (1..=count).find(|k| k * 1000 >= count * permille).unwrap_or(0);
                assert_eq!(lateness.permille_us(permille as usize), want, "{permille} of {count}");
            }
        }
    }

    #[test]
    fn a_measurement_has_as_many_beats_as_were_asked_for() {
        let text = measure(1_000_000, 20, 10, 1).to_string();
        assert!(text.starts_with("20 beats: "), "{text}");
    }
}
