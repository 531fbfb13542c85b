//! Delay of the link and pace of the craft's clock, from two ramps of time (thesis 5.5).
//!
//! The ground sends its clock g; each telemetry frame brings back the newest g that had come, and
//! the craft's clock c at that tick; it arrives at the ground's time a. Then
//!
//! ```text
//! round trip   a - g             half of it is the one-way delay (thesis 5.5)
//! offset       between c - a and c - g: what the craft's clock is ahead of the ground's
//! skew         slope of the offset; 0.01: the craft's clock runs 1 % fast
//! ```
//!
//! The round trip holds the wait of g for the craft's next tick, up to a tick: the mean says how
//! old a command is when it is flown, the least what the network alone takes. Queues and waits only
//! ever add, so the greatest c - a and the least c - g in each `BIN_S` are the narrowest bounds;
//! straight lines through the last `BINS` of both give two slopes with their standard errors. The
//! skew is their mean, weighted; what they contradict each other is added to its error, because a
//! network that grows slower moves the bounds apart and a clock moves both alike. The ground's ramp
//! has to be sent at irregular times ([`ramp_interval_s`]): sent once a tick it would wait longer
//! and longer for a craft that is fast.
//!
//! A COM whose clock runs fast is the unsolved fault of the thesis (chapter 6): it throws off law,
//! sample rate and integrators, and came and went by itself. It counts as wrong when the skew is
//! beyond `SKEW_LIMIT` by four standard errors in two bins running, and as well again when the
//! estimate is inside by one; with jitter of a tick that takes under 2 s for 1 %. Bounds of two
//! bins that are more than `JUMP_S` apart are a jump, and reported too.
//!
//! Both ramps are microseconds modulo 2^32 (71.6 minutes); only differences are used. Deliberately
//! absent: setting anybody's clock.

use std::collections::VecDeque;

use proto::Unwrapped;

/// Length of a bin, s of the ground's clock.
const BIN_S: f64 = 0.25;
/// Bins that the skew is taken from.
const BINS: usize = 6;
/// A pace that differs by more than this part is a fault. Crystals differ by 1e-4 at most.
const SKEW_LIMIT: f64 = 3e-3;
/// Bounds of two bins that are farther apart are a leap, s.
const JUMP_S: f64 = 0.05;
/// Standard errors that a skew has to be beyond the limit.
const SURE: f64 = 4.0;
/// Echoes older than this say nothing about the link now, us.
const OLDEST_US: u64 = 5_000_000;

/// Pause before the ramp is sent for the `count`th time, s: between 5 and 15 ms, never in step with
/// a tick.
pub fn ramp_interval_s(count: u64) -> f64 {
    // Multiples of the golden ratio leave the most even remainders.
    let phase = (count as f64 * 0.618_033_988_749_894_9).fract();
    0.005 + 0.01 * phase
}

/// How the craft's clock runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// Not known yet, or the link jitters too much to say.
    Unknown,
    /// As the ground's.
    Good,
    /// Too fast: the fault of the thesis' COM.
    Fast,
    /// Too slow.
    Slow,
}

/// Something that happened to the craft's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClockEvent {
    /// It began to run fast (positive) or slow, by this part.
    Off {
        /// 0.01: 1 % fast.
        skew: f64,
        /// Standard error of `skew`.
        std_error: f64,
    },
    /// It runs as it should again.
    Recovered,
    /// It leapt, or the craft started anew.
    Jumped {
        /// By how much, s.
        by_s: f64,
    },
}

impl std::fmt::Display for ClockEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Off { skew, std_error } => write!(
                f,
                "the craft's clock runs {:.2} % {} (+- {:.2} %): its law, sample rate and integrators are off by as much; land and restart it",
                skew.abs() * 100.0,
                if *skew > 0.0 { "fast" } else { "slow" },
                std_error * 100.0
            ),
            Self::Recovered => f.write_str("the craft's clock runs as it should again"),
            Self::Jumped { by_s } => {
                write!(f, "the craft's clock jumped by {by_s:.3} s, or the craft was restarted")
            }
        }
    }
}

/// What is known of the link now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Half of the mean round trip over the last bins, s: the thesis' one-way delay.
    pub one_way_s: f64,
    /// Half of the least round trip over the last bins, s: the network alone.
    pub least_one_way_s: f64,
    /// How fast the craft's clock runs: 0.01 is 1 % fast.
    pub skew: f64,
    /// Standard error of `skew`; infinite while there are too few bins.
    pub skew_std_error: f64,
    /// Ticks of the craft in a second of the ground.
    pub tick_hz: f64,
    /// What is made of the skew.
    pub pace: Pace,
}

/// A time and a bound, us.
type Bound = (f64, f64);

#[derive(Debug, Clone, Copy)]
struct Bin {
    number: u64,
    /// The offset is at least the greatest c - a, and at most the least c - g.
    above: Bound,
    below: Bound,
    /// Round trips of ramps that came back for the first time: least, sum and count.
    least_us: i64,
    sum_us: i64,
    count: u32,
    /// Tick and arrival of the first frame.
    first: (u32, u64),
}

impl Bin {
    /// How far the offset has certainly moved, us: the bounds of both bins do not meet. A machine
    /// that stood still moves one bound only.
    fn jump_from_us(&self, before: &Self) -> f64 {
        let (forward, back) = (self.above.1 - before.below.1, self.below.1 - before.above.1);
        if forward > 0.0 { forward } else { back.min(0.0) }
    }
}

/// The estimator.
#[derive(Debug, Clone)]
pub struct ClockMonitor {
    craft: Unwrapped,
    last_echo: Option<u32>,
    /// An echo has changed: one that never did may be what the craft began with.
    echoed: bool,
    bins: VecDeque<Bin>,
    last_tick: (u32, u64),
    /// Bins running in which the skew was surely beyond the limit, with its sign, and in which it
    /// was inside.
    beyond: i32,
    inside: u32,
    pace: Pace,
}

impl Default for ClockMonitor {
    fn default() -> Self {
        Self {
            craft: Unwrapped::default(),
            last_echo: None,
            echoed: false,
            bins: VecDeque::with_capacity(BINS + 2),
            last_tick: (0, 0),
            beyond: 0,
            inside: 0,
            pace: Pace::Unknown,
        }
    }
}

impl ClockMonitor {
    /// A telemetry frame: the craft's ramp, the ground's that it brings back, its tick, and the
    /// ground's clock at its arrival. Gives what it shows to have happened.
    pub fn heard(&mut self, craft_us: u32, echo_us: u32, tick: u32, arrived_us: u64) -> Option<ClockEvent> {
        let craft_us = self.craft.push(craft_us);
        self.last_tick = (tick, arrived_us);
        // The echo is a past value of the same clock that `arrived_us` is, cut to 32 bits.
        let round_trip_us = u64::from((arrived_us as u32).wrapping_sub(echo_us));
        let fresh = self.last_echo != Some(echo_us);
        self.echoed |= fresh && self.last_echo.is_some();
        self.last_echo = Some(echo_us);
        if round_trip_us > OLDEST_US.min(arrived_us) || !self.echoed {
            return None; // nothing has come to the craft yet, or not for long
        }
        let round_trip_us = round_trip_us.cast_signed();
        let (arrived, craft) = (arrived_us as f64, craft_us as f64);
        let (above, below) = (craft - arrived, craft - arrived + round_trip_us as f64);
        let number = (arrived * 1e-6 / BIN_S) as u64;
        let mut event = None;
        if self.bins.back().is_none_or(|bin| bin.number != number) {
            event = self.close_bin();
            self.bins.push_back(Bin {
                number,
                above: (arrived, above),
                below: (arrived, below),
                least_us: round_trip_us,
                sum_us: 0,
                count: 0,
                first: (tick, arrived_us),
            });
            while self.bins.len() > BINS + 1 {
                self.bins.pop_front();
            }
        }
        if let Some(bin) = self.bins.back_mut() {
            if above > bin.above.1 {
                bin.above = (arrived, above);
            }
            if below < bin.below.1 {
                bin.below = (arrived, below);
            }
            if fresh {
                bin.least_us = bin.least_us.min(round_trip_us);
                (bin.sum_us, bin.count) = (bin.sum_us.saturating_add(round_trip_us), bin.count + 1);
            }
        }
        event
    }

    /// The last bin is complete: what does it show?
    fn close_bin(&mut self) -> Option<ClockEvent> {
        let newest = *self.bins.back()?;
        let before = self.bins.len().checked_sub(2).and_then(|k| self.bins.get(k));
        let jump_us = before.map_or(0.0, |before| newest.jump_from_us(before));
        if jump_us.abs() > JUMP_S * 1e6 {
            self.bins.clear();
            (self.beyond, self.inside, self.pace) = (0, 0, Pace::Unknown);
            return Some(ClockEvent::Jumped { by_s: jump_us * 1e-6 });
        }
        let (skew, std_error) = self.skew(self.bins.len())?;
        let off = |sign: f64| sign * skew - SURE * std_error > SKEW_LIMIT;
        self.beyond = match (off(1.0), off(-1.0)) {
            (true, _) => self.beyond.max(0) + 1,
            (_, true) => self.beyond.min(0) - 1,
            _ => 0,
        };
        self.inside = if skew.abs() + std_error < SKEW_LIMIT { self.inside + 1 } else { 0 };
        let before = self.pace;
        self.pace = match (self.beyond, self.inside) {
            (2.., _) => Pace::Fast,
            (..=-2, _) => Pace::Slow,
            (_, 2..) => Pace::Good,
            // Not sure: what was said stays.
            _ => before,
        };
        match (before, self.pace) {
            (before, after) if before == after => None,
            (_, Pace::Fast | Pace::Slow) => Some(ClockEvent::Off { skew, std_error }),
            (Pace::Fast | Pace::Slow, _) => Some(ClockEvent::Recovered),
            _ => None,
        }
    }

    /// Skew and its standard error from the first `count` bins.
    fn skew(&self, count: usize) -> Option<(f64, f64)> {
        if count < 4 {
            return None;
        }
        let slope =
            |pick: fn(&Bin) -> Bound| line(&self.bins.iter().take(count).map(pick).collect::<Vec<_>>());
        let ((a, a_error), (b, b_error)) = (slope(|bin| bin.above), slope(|bin| bin.below));
        let [a_variance, b_variance] = [a_error, b_error].map(|error| error.powi(2).max(1e-12));
        let skew = (a * b_variance + b * a_variance) / (a_variance + b_variance);
        let variance = 1.0 / (1.0 / a_variance + 1.0 / b_variance);
        let contradiction = ((a - b).powi(2) - a_variance - b_variance).max(0.0) / 4.0;
        Some((skew, (variance + contradiction).sqrt()))
    }

    /// What is known now; none before the ramp has come back.
    pub fn timing(&self) -> Option<Timing> {
        let least_us = self.bins.iter().map(|bin| bin.least_us).min()?;
        let (sum_us, count) = self
            .bins
            .iter()
            .fold((0_i64, 0), |(sum, count), bin| (sum.saturating_add(bin.sum_us), count + bin.count));
        // The last bin is not complete yet.
        let (skew, skew_std_error) = self.skew(self.bins.len() - 1).unwrap_or((0.0, f64::INFINITY));
        let (first, last) = (self.bins.front()?.first, self.last_tick);
        let elapsed_s = last.1.saturating_sub(first.1) as f64 * 1e-6;
        let ticks = f64::from(last.0.wrapping_sub(first.0));
        Some(Timing {
            one_way_s: 0.5e-6 * sum_us as f64 / f64::from(count.max(1)),
            least_one_way_s: 0.5e-6 * least_us as f64,
            skew,
            skew_std_error,
            tick_hz: if elapsed_s > 0.0 { ticks / elapsed_s } else { 0.0 },
            pace: self.pace,
        })
    }
}

/// Slope of the straight line through points, and its standard error from how far they lie off it.
fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| points.iter().map(pick).sum::<f64>() / n;
    let (t0, y0) = (mean(|p| p.0), mean(|p| p.1));
    let (stt, sty) = points
        .iter()
        .fold((0.0, 0.0), |(stt, sty), (t, y)| (stt + (t - t0).powi(2), sty + (t - t0) * (y - y0)));
    let slope = sty / stt;
    let rest: f64 = points.iter().map(|(t, y)| (y - y0 - slope * (t - t0)).powi(2)).sum();
    (slope, (rest / (n - 2.0) / stt).sqrt())
}

#[cfg(test)]
mod tests {
    //! Against synthetic links whose truth is known: constant ways, exponential queues, loss,
    //! clocks that are off.

    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, Exp1};
    use rand_pcg::Pcg64;

    struct Simulated {
        /// Constant part of each way, s, and the mean of what queues add.
        way_s: f64,
        queue_s: f64,
        loss: f64,
        /// Both clocks at the start, us.
        start_us: u32,
        /// From when on the craft's clock runs by which part too fast.
        skews: Vec<(f64, f64)>,
        seed: u64,
    }

    const LINK: Simulated =
        Simulated { way_s: 0.003, queue_s: 0.0, loss: 0.0, start_us: 0, skews: Vec::new(), seed: 1 };

    /// What came of `duration_s` of such a link: the estimator and the events with their times.
    fn run(link: &Simulated, duration_s: f64) -> (ClockMonitor, Vec<(f64, ClockEvent)>) {
        let mut generator = Pcg64::seed_from_u64(link.seed);
        let mut monitor = ClockMonitor::default();
        let start_us = 10_000_000 + u64::from(link.start_us);
        let mut way_s = || {
            let queue: f64 = Exp1.sample(&mut generator);
            let lost = generator.random_range(0.0..1.0) < link.loss;
            (!lost).then_some(link.way_s + link.queue_s * queue)
        };
        // The ground's ramp on its way up: (arrival, value).
        let (mut up, mut sent_s, mut count): (Vec<(f64, u32)>, f64, u64) = (Vec::new(), 0.0, 0);
        let (mut craft_s, mut now_s, mut tick, mut echo, mut events) = (0.0, 0.0, 0, 0, Vec::new());
        let mut last_arrival_s = 0.0;
        let us = |s: f64| start_us + (s * 1e6) as u64;
        while now_s < duration_s {
            while sent_s < now_s {
                up.extend(way_s().map(|way| (sent_s + way, us(sent_s) as u32)));
                sent_s += ramp_interval_s(count);
                count += 1;
            }
            up.retain(|(arrival_s, value)| {
                let there = *arrival_s <= now_s;
                if there {
                    echo = *value;
                }
                !there
            });
            if let Some(way) = way_s() {
                // A link keeps the order of its packets.
                last_arrival_s = f64::max(last_arrival_s, now_s + way);
                let craft_us = link.start_us.wrapping_add(777).wrapping_add((craft_s * 1e6) as u64 as u32);
                let event = monitor.heard(craft_us, echo, tick, us(last_arrival_s));
                events.extend(event.map(|event| (last_arrival_s, event)));
            }
            let skew =
                link.skews.iter().rev().find(|(from, _)| now_s >= *from).map_or(0.0, |(_, skew)| *skew);
            // A tick of the craft is 10 ms of its own clock.
            (craft_s, now_s, tick) = (craft_s + 0.01, now_s + 0.01 / (1.0 + skew), tick + 1);
        }
        (monitor, events)
    }

    #[test]
    fn a_quiet_link_is_measured_to_the_wait_for_the_tick() {
        let (monitor, events) = run(&LINK, 5.0);
        let timing = monitor.timing().unwrap();
        assert_eq!(events, []);
        // Two ways of 3 ms, and a wait of 0 to 10 ms for the tick, 5 ms in the mean.
        assert!((timing.one_way_s - 0.0055).abs() < 0.0004, "{timing:?}");
        assert!((timing.least_one_way_s - 0.003).abs() < 0.0002, "{timing:?}");
        assert!(timing.skew.abs() < 5e-4 && timing.pace == Pace::Good, "{timing:?}");
        assert!((timing.tick_hz - 100.0).abs() < 0.5, "{timing:?}");
    }

    /// Thesis 5.5: transmission and the tracker's latency add up to about 2 samples, 20 ms. With a
    /// tracker of 7 ms that leaves 13 ms for one way, wait included.
    #[test]
    fn the_thesis_two_samples_of_delay_are_found() {
        let (monitor, _) = run(&Simulated { way_s: 0.0105, ..LINK }, 5.0);
        let total_s = monitor.timing().unwrap().one_way_s + 0.007;
        assert!((total_s / 0.01 - 2.0).abs() < 0.05, "{total_s}");
    }

    #[test]
    fn a_fast_clock_is_named_within_two_seconds_and_so_is_its_end() {
        for (seed, skew, queue_s, loss) in [
            (1, 0.01, 0.0, 0.0),
            (2, 0.01, 0.005, 0.1),
            (3, 0.05, 0.01, 0.3),
            (4, -0.01, 0.005, 0.1),
            (5, 0.0118, 0.005, 0.2),
        ] {
            let skews = vec![(5.0, skew), (12.0, 0.0)];
            let (_, events) = run(&Simulated { queue_s, loss, skews, seed, ..LINK }, 20.0);
            let [(found_s, ClockEvent::Off { skew: found, .. }), (over_s, ClockEvent::Recovered)] =
                events[..]
            else {
                panic!("seed {seed}: {events:?}");
            };
            assert!((5.0..7.0).contains(&found_s), "seed {seed}: found after {:.2} s", found_s - 5.0);
            // It is named when half of the window may still be from before.
            assert!((0.5..1.3).contains(&(found / skew)), "seed {seed}: {found} of {skew}");
            assert!((12.0..15.0).contains(&over_s), "seed {seed}: over after {:.2} s", over_s - 12.0);
        }
    }

    #[test]
    fn a_steady_skew_is_measured() {
        for (seed, skew) in [(1, 0.02), (2, 0.0002), (3, -0.004), (4, 0.0)] {
            let skews = vec![(0.0, skew)];
            let (monitor, _) = run(&Simulated { queue_s: 0.004, loss: 0.1, skews, seed, ..LINK }, 10.0);
            let timing = monitor.timing().unwrap();
            // The least of 25 waits and queues in a bin is some 0.5 ms; over 1.5 s that leaves
            // 5e-4, thrice that is allowed.
            assert!((timing.skew - skew).abs() < 1.5e-3, "seed {seed}: {timing:?}");
            assert!(timing.skew_std_error < 1.5e-3, "seed {seed}: {timing:?}");
        }
    }

    /// Ten minutes each of a bad radio: queues of a tick and more in the mean, a third of the
    /// packets lost.
    #[test]
    fn a_bad_link_is_no_bad_clock() {
        for seed in 0..6 {
            let queue_s = [0.002, 0.01, 0.03][seed as usize % 3];
            let (monitor, events) = run(&Simulated { queue_s, loss: 0.3, seed, ..LINK }, 600.0);
            let wrong: Vec<_> = events.iter().filter(|(_, e)| matches!(e, ClockEvent::Off { .. })).collect();
            assert!(wrong.is_empty(), "seed {seed}, queue {queue_s}: {wrong:?}");
            assert!(
                !events.iter().any(|(_, e)| matches!(e, ClockEvent::Jumped { .. })),
                "seed {seed}: {events:?}"
            );
            assert_ne!(monitor.timing().unwrap().pace, Pace::Fast);
        }
    }

    #[test]
    fn wrapping_clocks_change_nothing() {
        // Both clocks wrap 2.5 s into the run, as after 71 minutes.
        let near_the_end = u32::MAX - 12_500_000;
        let link = |start_us| Simulated { start_us, queue_s: 0.002, skews: vec![(3.0, 0.02)], ..LINK };
        let (monitor, events) = run(&link(near_the_end), 8.0);
        let (same, as_events) = run(&link(0), 8.0);
        assert_eq!(events.len(), 1, "{events:?}");
        assert!((events[0].0 - as_events[0].0).abs() < 0.3, "{events:?} {as_events:?}");
        assert!((monitor.timing().unwrap().skew - same.timing().unwrap().skew).abs() < 1e-3);
    }

    #[test]
    fn a_leap_is_named() {
        let mut monitor = ClockMonitor::default();
        let mut events = Vec::new();
        for tick in 0..400_u32 {
            let now_us = 1_000_000 + u64::from(tick) * 10_000;
            let leapt = if tick >= 200 { 500_000 } else { 0 };
            let echo_us = (now_us - 6_000) as u32 - tick % 3;
            events.extend(monitor.heard(tick * 10_000 + leapt, echo_us, tick, now_us));
        }
        let [ClockEvent::Jumped { by_s }] = events[..] else { panic!("{events:?}") };
        assert!((by_s - 0.5).abs() < 0.01);
        assert_eq!(monitor.timing().unwrap().pace, Pace::Good);
    }

    #[test]
    fn before_the_ramp_has_come_back_nothing_is_known() {
        let mut monitor = ClockMonitor::default();
        for tick in 0..100_u32 {
            // Whatever the ground's clock says: an echo that never changes is none.
            assert_eq!(monitor.heard(tick * 10_000, 0, tick, 1_000 + u64::from(tick) * 10_000), None);
        }
        assert_eq!(monitor.timing(), None);
    }

    proptest! {
        #[test]
        fn no_numbers_panic(frames in prop::collection::vec((any::<u32>(), any::<u32>(), any::<u32>(), any::<u64>()), 0..200)) {
            let mut monitor = ClockMonitor::default();
            for (craft_us, echo_us, tick, arrived_us) in frames {
                let _ = monitor.heard(craft_us, echo_us, tick, arrived_us >> 8);
            }
            let _ = monitor.timing();
        }
    }
}
