//! Does a flying craft stand on something?
//!
//! A craft whose tracker sees it too high, or that is told to fly through a table, stands on its legs
//! although it is to fly. There the law's loops ask for a tilt that the ground does not allow, and
//! their integrators would grow for as long as that lasts: when it is free again, all that they have
//! gathered turns it over. So while it stands nothing is integrated, as other autopilots do it
//! (PX4 where its land detector finds contact with the ground, ArduPilot where it is landed).
//!
//! What stands is told to turn and goes nowhere: an error of roll or pitch of 0.05 rad, and for 0.3 s
//! neither its place nor its tilt is another. In the air an error that lasts turns the craft, or comes
//! of a tilt that moves it: 0.05 rad are 2.2 cm in 0.3 s. Where a free craft is caught all the same,
//! between two ways to and fro, its integrators keep what they have, and go on with its next motion.
//!
//! The thrust does not tell: with no error of its height a craft that is a little heavier than its
//! model stands with nearly what would carry it. Whether a landing is over is another question
//! ([`touchdown`](crate::safety::touchdown)).

use crate::inputs::readings::Pose;
use crate::safety::timers::Held;

/// Roll or pitch is asked for from this error on, rad: three degrees. What a smaller one makes an
/// integrator gather is no more in a second than a loop asks for by itself at three degrees.
const ASKED_RAD: f32 = 0.05;
/// For how long, us. A free craft has turned long before: its loops take 0.1 to 0.2 s.
const FOR_US: u32 = 300_000;
/// It has moved if it is farther than this from where it was, along any axis, m: ten times a tracker's
/// noise.
const MOVED_M: f32 = 0.02;
/// ... and has turned if roll or pitch has changed by more, rad.
const TURNED_RAD: f32 = 0.03;

/// What is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Standing {
    /// Where it was when it was asked first.
    since: Pose,
    held: Held,
    /// It stands.
    pub(crate) found: bool,
}

impl Standing {
    /// In the air.
    pub(crate) const NOT: Self =
        Self { since: Pose { position_m: [0.0; 3], attitude_rad: [0.0; 3] }, held: Held::NOT, found: false };

    /// A tick: the pose, whether it is known, and errors of roll and pitch in rad. What is no number
    /// stands nowhere.
    #[inline]
    pub(crate) fn step(
        &mut self,
        pose: &Pose,
        known: bool,
        [roll_error, pitch_error, _]: [f32; 3],
        elapsed_us: u32,
    ) {
        if known && (roll_error.abs() > ASKED_RAD || pitch_error.abs() > ASKED_RAD) {
            self.asked(pose, elapsed_us);
        } else {
            (self.held, self.found) = (Held::NOT, false);
        }
    }

    /// A tick in which it is to turn.
    #[cold]
    fn asked(&mut self, pose: &Pose, elapsed_us: u32) {
        let near = |now: &[f32], then: &[f32], by: f32| {
            now.iter().zip(then).fold(true, |all, (now, then)| all & ((now - then).abs() <= by))
        };
        let is_new = self.held == Held::NOT;
        let stays = near(&pose.position_m, &self.since.position_m, MOVED_M)
            // Its heading it may keep or change: it can turn on its legs.
            && near(tilt(pose), tilt(&self.since), TURNED_RAD);
        if is_new || !stays {
            (self.since, self.held) = (*pose, Held::NOT);
        }
        self.found = self.held.step(true, elapsed_us, FOR_US);
    }
}

/// Roll and pitch, rad.
fn tilt(pose: &Pose) -> &[f32] {
    let [tilt @ .., _] = &pose.attitude_rad;
    tilt
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: Pose = Pose { position_m: [1.0, -0.5, -0.2], attitude_rad: [0.01, -0.01, 3.0] };

    /// In which ticks of 10 ms a craft is found to stand that does this, with these errors.
    fn found(ticks: u16, at: impl Fn(f32) -> (Pose, [f32; 3])) -> Vec<u16> {
        let mut standing = Standing::NOT;
        (1..=ticks)
            .filter(|k| {
                let (pose, errors_rad) = at(f32::from(*k) * 0.01);
                standing.step(&pose, true, errors_rad, 10_000);
                standing.found
            })
            .collect()
    }

    #[test]
    fn what_is_to_tilt_and_goes_nowhere_stands() {
        let all: Vec<u16> = (30..=100).collect();
        for errors_rad in [[0.06, 0.0, 0.0], [0.0, -0.06, 0.0], [-0.2, 0.2, 1.0]] {
            assert_eq!(found(100, |_| (HERE, errors_rad)), all, "{errors_rad:?}");
        }
        // A tracker's noise, and a heading that turns.
        let noisy = |time_s: f32| {
            let noise = 0.009 * crate::dsp::trig::sin_cos(7.0 * time_s * 100.0).0;
            let position_m = HERE.position_m.map(|x| x + noise);
            (Pose { position_m, attitude_rad: [noise, noise, time_s] }, [0.1, 0.0, 0.0])
        };
        assert_eq!(found(100, noisy), all);
    }

    #[test]
    fn what_moves_or_is_asked_for_nothing_flies() {
        assert!(found(200, |_| (HERE, [0.05, -0.05, 1.0])).is_empty(), "no error to speak of");
        for axis in 0..3 {
            // 2 cm in 0.3 s are 0.067 m/s.
            let moves = |time_s: f32| {
                let mut pose = HERE;
                pose.position_m[axis] += 0.08 * time_s;
                (pose, [0.1, 0.0, 0.0])
            };
            assert!(found(200, moves).is_empty(), "{axis}");
        }
        for axis in 0..2 {
            let turns = |time_s: f32| {
                let mut pose = HERE;
                pose.attitude_rad[axis] += 0.12 * time_s;
                (pose, [0.1, 0.0, 0.0])
            };
            assert!(found(200, turns).is_empty(), "{axis}");
        }
    }

    /// By 0.05 rad too little tilt a craft that is at rest is moved by `g 0.05 t^2 / 2`: 2.2 cm in 0.3 s.
    #[test]
    fn what_is_free_is_moved_by_a_lasting_error() {
        let drifts = |time_s: f32| {
            let mut pose = HERE;
            pose.position_m[1] += 0.5 * 9.81 * 0.051 * time_s * time_s;
            (pose, [0.051, 0.0, 0.0])
        };
        assert!(found(200, drifts).is_empty());
    }

    #[test]
    fn the_first_motion_ends_it_and_it_begins_anew() {
        let hops = |time_s: f32| {
            let mut pose = HERE;
            pose.position_m[2] -= if time_s > 0.495 { 0.05 } else { 0.0 };
            (pose, [0.1, 0.0, 0.0])
        };
        let want: Vec<u16> = (30..50).chain(79..=100).collect();
        assert_eq!(found(100, hops), want);
        let calm = |time_s: f32| (HERE, [if (0.395..0.405).contains(&time_s) { 0.0 } else { 0.1 }, 0.0, 0.0]);
        let want: Vec<u16> = (30..40).chain(70..=100).collect();
        assert_eq!(found(100, calm), want);
    }

    /// 2 cm and 0.03 rad are no motion yet.
    #[test]
    fn at_its_limits_it_stays() {
        let origin = Pose { position_m: [0.0; 3], attitude_rad: [0.0; 3] };
        for place in 0..5 {
            let leans = |time_s: f32| {
                let mut pose = origin;
                if time_s > 0.205 {
                    match place {
                        0..3 => pose.position_m[place] = MOVED_M,
                        _ => pose.attitude_rad[place - 3] = -TURNED_RAD,
                    }
                }
                (pose, [0.1, 0.0, 0.0])
            };
            assert_eq!(found(40, leans), (30..=40).collect::<Vec<u16>>(), "{place}");
        }
    }

    #[test]
    fn nobody_knows_without_poses_or_numbers() {
        let mut standing = Standing::NOT;
        for _ in 0..100 {
            standing.step(&HERE, false, [0.1, 0.0, 0.0], 10_000);
            assert!(!standing.found);
        }
        for bad in [f32::NAN, f32::INFINITY] {
            let nowhere = Pose { position_m: [bad, 0.0, 0.0], ..HERE };
            assert!(found(100, |_| (nowhere, [0.1, 0.0, 0.0])).is_empty());
            let turned = Pose { attitude_rad: [0.0, bad, 0.0], ..HERE };
            assert!(found(100, |_| (turned, [0.1, 0.0, 0.0])).is_empty());
        }
        assert!(found(100, |_| (HERE, [f32::NAN; 3])).is_empty());
    }
}
