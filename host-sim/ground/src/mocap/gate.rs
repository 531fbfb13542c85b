//! Which sightings are the tracker's own: one sender, numbers in their order, places that a craft can reach.
//!
//! Trackers do not show who they are. What can be asked of a datagram is that it goes on where the last one was: the same
//! sender, a frame number that has not run ahead of time, a pose within reach of the last. One that does not is dropped and
//! counted, and begins a rival. A rival that has been continued takes over once the tracker that was believed has fallen
//! silent: so a restarted tracker is heard again after [`SILENT`], and a forged datagram changes nothing while the true ones
//! come.
//!
//! Not held off: who sends from the tracker's own address and port, with the number that is due and a pose within reach.
//! Let the tracker have a network of its own.

use std::net::{IpAddr, SocketAddr};
use std::time::{Duration, Instant};

use model::frames::dcm_from_euler;
use nalgebra::Vector3;
use proto::Pose;

/// A tracker that has said nothing for so long may be replaced by a rival: ten frames at 100 Hz.
const SILENT: Duration = Duration::from_millis(100);
/// Frames in their order that make a rival a tracker.
const CONTINUED: u32 = 3;
/// Frames that UDP may lose in a row however fast they come.
const LOST: f64 = 3.0;
/// Beyond that, numbers run no faster than so many times what the tracker has sent until now.
const FASTER: f64 = 2.0;
/// Before a tracker's pace is known, frames/s: faster than any.
const FASTEST_HZ: f64 = 1000.0;
/// How far a pose may lie from the last: the tracker's noise and the time between two frames, and what a craft flies in
/// the rest, m, m/s, rad, rad/s.
const REACH_M: f64 = 0.15;
const SPEED_M_S: f64 = 10.0;
const TURN_RAD: f64 = 0.5;
const RATE_RAD_S: f64 = 20.0;
/// Senders whose frames are watched beside the tracker's.
const MOST_RIVALS: usize = 8;

/// Why a sighting is not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotTaken {
    #[error("frame {0} came late or twice")]
    Late(u32),
    #[error("a datagram of {0}, which is not the tracker")]
    Stranger(IpAddr),
    #[error("frame {0} does not go on from the one before: dropped until more follow it")]
    Leap(u32),
    #[error("the pose of frame {0} is out of the craft's reach: dropped")]
    Jump(u32),
}

/// Frames of one sender that go on from each other.
#[derive(Debug, Clone, Copy)]
struct Track {
    source: SocketAddr,
    frame: u32,
    at: Instant,
    /// The last frame in which the craft was seen.
    seen: Option<(Pose, Instant)>,
    /// Mean time from frame to frame, s; none before the second.
    interval_s: Option<f64>,
    length: u32,
}

impl Track {
    fn begin(source: SocketAddr, frame: u32, pose: Option<Pose>, at: Instant) -> Self {
        Self { source, frame, at, seen: pose.map(|pose| (pose, at)), interval_s: None, length: 1 }
    }

    /// Whether a frame of the same sender goes on from it.
    fn judge(&self, frame: u32, pose: Option<&Pose>, now: Instant) -> Result<(), NotTaken> {
        let ahead = f64::from(frame.wrapping_sub(self.frame).cast_signed());
        let passed_s = now.saturating_duration_since(self.at).as_secs_f64();
        let pace_hz = self.interval_s.map_or(FASTEST_HZ, |s| 1.0 / s.max(1.0 / FASTEST_HZ));
        if ahead <= 0.0 {
            return Err(NotTaken::Late(frame));
        }
        if ahead > LOST.max(FASTER * pace_hz * passed_s) {
            return Err(NotTaken::Leap(frame));
        }
        match (&self.seen, pose) {
            (Some((last, at)), Some(pose)) if !is_within_reach(last, pose, now - *at) => {
                Err(NotTaken::Jump(frame))
            }
            _ => Ok(()),
        }
    }

    fn go_on(&mut self, frame: u32, pose: Option<Pose>, now: Instant) {
        let frames = f64::from(frame.wrapping_sub(self.frame).max(1));
        let interval_s = now.saturating_duration_since(self.at).as_secs_f64() / frames;
        self.interval_s = Some(self.interval_s.map_or(interval_s, |mean| 0.95 * mean + 0.05 * interval_s));
        (self.frame, self.at, self.length) = (frame, now, self.length.saturating_add(1));
        if let Some(pose) = pose {
            self.seen = Some((pose, now));
        }
    }
}

/// Whether a craft can have got from one pose to the other.
fn is_within_reach(last: &Pose, pose: &Pose, passed: Duration) -> bool {
    let vector = |v: [f32; 3]| Vector3::from(v.map(f64::from));
    let passed_s = passed.as_secs_f64();
    let way_m = (vector(pose.position_m) - vector(last.position_m)).norm();
    let [from, to] = [last, pose].map(|pose| dcm_from_euler(vector(pose.attitude_rad)));
    let cosine = 0.5 * ((from.transpose() * to).trace() - 1.0);
    let turn_rad = cosine.clamp(-1.0, 1.0).acos();
    way_m <= REACH_M + SPEED_M_S * passed_s && turn_rad <= TURN_RAD + RATE_RAD_S * passed_s
}

/// Lets the tracker's own sightings through.
#[derive(Debug, Clone, Default)]
pub(crate) struct Gate {
    /// The tracker's address, where the user has named it.
    named: Option<IpAddr>,
    tracker: Option<Track>,
    rivals: Vec<Track>,
}

impl Gate {
    /// For a tracker at a named address; absent: for whoever is heard first.
    pub(crate) fn new(named: Option<IpAddr>) -> Self {
        Self { named, ..Self::default() }
    }

    /// Whether a sender can be the tracker at all, before its datagram is looked into.
    pub(crate) fn admits(&self, source: SocketAddr) -> Result<(), NotTaken> {
        let wanted = self.named.or(self.tracker.map(|tracker| tracker.source.ip()));
        match wanted {
            Some(wanted) if wanted != source.ip() => Err(NotTaken::Stranger(source.ip())),
            _ => Ok(()),
        }
    }

    /// Whether a frame is the tracker's own; `pose` is absent where the cameras did not see the craft.
    pub(crate) fn judge(
        &mut self,
        source: SocketAddr,
        frame: u32,
        pose: Option<Pose>,
        now: Instant,
    ) -> Result<(), NotTaken> {
        self.admits(source)?;
        let Some(tracker) = self.tracker.as_mut() else {
            self.tracker = Some(Track::begin(source, frame, pose, now));
            return Ok(());
        };
        let why = if tracker.source == source {
            match tracker.judge(frame, pose.as_ref(), now) {
                Ok(()) => {
                    tracker.go_on(frame, pose, now);
                    return Ok(());
                }
                Err(why) => why,
            }
        } else {
            NotTaken::Stranger(source.ip())
        };
        let is_silent = now.saturating_duration_since(tracker.at) >= SILENT;
        let rival = self.rival(source, frame, pose, now);
        if is_silent && rival.length >= CONTINUED {
            self.tracker = Some(rival);
            self.rivals.clear();
            return Ok(());
        }
        Err(why)
    }

    /// The rival that a frame goes on from, or begins.
    fn rival(&mut self, source: SocketAddr, frame: u32, pose: Option<Pose>, now: Instant) -> Track {
        if let Some(rival) = self.rivals.iter_mut().find(|rival| rival.source == source) {
            match rival.judge(frame, pose.as_ref(), now) {
                Ok(()) => rival.go_on(frame, pose, now),
                Err(_) => *rival = Track::begin(source, frame, pose, now),
            }
            return *rival;
        }
        if self.rivals.len() >= MOST_RIVALS {
            let oldest = (0..self.rivals.len()).min_by_key(|&n| self.rivals[n].at);
            self.rivals.remove(oldest.unwrap_or(0));
        }
        let rival = Track::begin(source, frame, pose, now);
        self.rivals.push(rival);
        rival
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(10);

    fn pose(north_m: f32) -> Option<Pose> {
        Some(Pose { position_m: [north_m, 0.0, -1.0], attitude_rad: [0.0; 3] })
    }

    fn from(text: &str) -> SocketAddr {
        text.parse().unwrap()
    }

    /// A tracker that has sent a second of frames, 100 to 199, of a craft that hovers at 0.
    fn heard() -> (Gate, SocketAddr, Instant) {
        let (mut gate, source, mut now) = (Gate::default(), from("10.0.0.2:4000"), Instant::now());
        for frame in 100..200 {
            assert_eq!(gate.judge(source, frame, pose(0.0), now), Ok(()), "{frame}");
            now += PERIOD;
        }
        (gate, source, now)
    }

    #[test]
    fn frame_numbers_wrap_and_come_late_or_twice() {
        let (mut gate, source, mut now) = (Gate::default(), from("10.0.0.2:4000"), Instant::now());
        for (frame, wanted) in [
            (u32::MAX - 1, Ok(())),
            (u32::MAX, Ok(())),
            (0, Ok(())),
            (u32::MAX, Err(NotTaken::Late(u32::MAX))),
            (1, Ok(())),
            (1, Err(NotTaken::Late(1))),
        ] {
            assert_eq!(gate.judge(source, frame, pose(0.0), now), wanted);
            now += PERIOD;
        }
    }

    #[test]
    fn one_forged_number_makes_no_true_frame_late() {
        for ahead in [4, 99, 999, 1_000_000, 1 << 31] {
            let (mut gate, source, mut now) = heard();
            let forged = 199_u32.wrapping_add(ahead);
            assert!(gate.judge(source, forged, pose(0.0), now).is_err(), "{ahead}");
            for frame in 200..400 {
                assert_eq!(gate.judge(source, frame, pose(0.0), now), Ok(()), "{ahead}: {frame}");
                now += PERIOD;
            }
        }
    }

    #[test]
    fn a_thousand_forgeries_a_second_from_another_port_change_nothing() {
        let (mut gate, source, mut now) = heard();
        let (forger, far) = (from("10.0.0.2:666"), from("10.0.0.66:4000"));
        for frame in 200..400 {
            for n in 0..10 {
                let number = 10_000 + 10 * frame + n;
                assert!(gate.judge(forger, number, pose(3.0), now).is_err());
                assert_eq!(gate.judge(far, frame, pose(0.0), now), Err(NotTaken::Stranger(far.ip())));
                now += PERIOD / 10;
            }
            assert_eq!(gate.judge(source, frame, pose(0.0), now), Ok(()), "{frame}");
        }
    }

    #[test]
    fn frames_that_were_lost_on_the_way_are_no_leap() {
        let (mut gate, source, now) = heard();
        assert_eq!(gate.judge(source, 202, pose(0.0), now), Ok(()), "two lost, whenever they come");
        assert_eq!(gate.judge(source, 232, pose(0.1), now + 30 * PERIOD), Ok(()), "0.3 s lost");
    }

    #[test]
    fn a_restarted_tracker_is_heard_again_after_a_tenth_of_a_second() {
        for again in ["10.0.0.2:4000", "10.0.0.2:5000"] {
            let (mut gate, _, now) = heard();
            let again = from(again);
            // It has stopped for a second, and the craft has drifted.
            let mut now = now + Duration::from_secs(1);
            let taken: Vec<bool> = (0..6)
                .map(|frame| {
                    now += PERIOD;
                    gate.judge(again, frame, pose(0.4), now).is_ok()
                })
                .collect();
            assert_eq!(taken, [false, false, true, true, true, true]);
        }
        // From another machine only where nobody was heard or named.
        let (mut gate, _, now) = heard();
        let other = from("10.0.0.3:4000");
        for frame in 0..50 {
            let late = now + Duration::from_secs(1) + frame * PERIOD;
            assert_eq!(gate.judge(other, frame, pose(0.0), late), Err(NotTaken::Stranger(other.ip())));
        }
    }

    #[test]
    fn poses_out_of_reach_are_dropped_until_they_have_been_continued() {
        let (mut gate, source, mut now) = heard();
        // One that is a metre off: the tracker took another marker for it.
        assert_eq!(gate.judge(source, 200, pose(1.0), now), Err(NotTaken::Jump(200)));
        assert_eq!(gate.judge(source, 201, pose(0.0), now + PERIOD), Ok(()));
        // The craft was carried, or the tracker's axes were set anew: all are a metre off from now on.
        now += PERIOD;
        let mut refused = 0;
        for frame in 202..300 {
            now += PERIOD;
            refused += u32::from(gate.judge(source, frame, pose(1.0), now).is_err());
        }
        // Until the way is within reach of the time, at 10 m/s, or the old place has been silent: 0.1 s.
        assert!((5..=10).contains(&refused), "{refused}");
        let upside_down = Some(Pose { position_m: [1.0, 0.0, -1.0], attitude_rad: [3.0, 0.0, 0.0] });
        assert_eq!(gate.judge(source, 300, upside_down, now + PERIOD), Err(NotTaken::Jump(300)));
    }

    #[test]
    fn a_named_tracker_alone_is_heard() {
        let (tracker, other) = (from("10.0.0.2:4000"), from("10.0.0.3:4000"));
        let mut gate = Gate::new(Some(tracker.ip()));
        let now = Instant::now();
        assert_eq!(gate.judge(other, 1, pose(0.0), now), Err(NotTaken::Stranger(other.ip())));
        assert_eq!(gate.judge(tracker, 1, pose(0.0), now), Ok(()));
    }
}
