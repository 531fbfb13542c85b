//! Where the craft is and how it is turned, by the last good pose and by what has happened since.
//!
//! On a good link a pose counts as it came. One that comes late is brought to the present: the
//! attitude by the gyro (`law/carried.rs`), the height by the motors (`law/height.rs`). The position
//! stays as old as it is: its loops are slow. In ticks without a pose both are carried on. Once poses
//! have been silent for so long that it matters, the law sees the height that there was, since another
//! rule flies then ([`hover_thrust`](crate::safety::hover_thrust)), and the motors' is for when poses come back.

use crate::inputs::readings::{Measurement, Pose};
use crate::law::carried::{Turns, carry, turn};
use crate::law::height::Height;
use crate::safety::limits::GRAVITY_M_S2;

/// The pose before the first one: unknown.
const NOWHERE: Pose = Pose { position_m: [f32::NAN; 3], attitude_rad: [f32::NAN; 3] };

/// What happened since the tick before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Since {
    /// How long it was, us.
    pub(crate) elapsed_us: u32,
    /// Body rates in rad/s, if they are good.
    pub(crate) gyro_rad_s: Option<[f32; 3]>,
    /// There had been no pose for so long that it matters.
    pub(crate) silent: bool,
    /// Rate of inertial z by the law's estimator, m/s.
    pub(crate) z_rate_m_s: f32,
    /// What the motors were commanded, for a craft that flies by forces.
    pub(crate) lift: Option<Lift>,
}

/// The vertical thrust of the motor commands, and what carries the craft, both in N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lift {
    pub(crate) thrust: f32,
    /// Now; what counts is what it was when poses became late.
    pub(crate) hover: f32,
}

/// The next pose is off by this by no motion: what the estimators are not to take for one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Leap {
    pub(crate) turned_rad: [f32; 3],
    pub(crate) down_m: f32,
}

/// The last good pose, and how it is brought to the present.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Whereabouts {
    pose: Pose,
    /// The attitude of now by the gyro, rad; none where the last good pose counts as it came.
    carried_rad: Option<[f32; 3]>,
    /// The height of now by the motors, and what carried the craft when poses became late, N; none likewise.
    height: Option<(Height, f32)>,
    /// The height as it was when poses became silent, m.
    kept_m: Option<f32>,
    /// The last tick had no good pose.
    is_blind: bool,
    /// The last good pose was brought to now.
    was_late: bool,
    turns: Turns,
}

impl Whereabouts {
    /// Of a craft that was never seen.
    pub(crate) const UNKNOWN: Self = Self {
        pose: NOWHERE,
        carried_rad: None,
        height: None,
        kept_m: None,
        is_blind: false,
        was_late: false,
        turns: Turns::NONE,
    };

    /// The last good pose as it came.
    #[inline]
    pub(crate) fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Whether there was any.
    #[inline]
    pub(crate) fn is_known(&self) -> bool {
        self.pose.position_m[0].is_finite()
    }

    /// The attitude of now, rad.
    #[inline]
    pub(crate) fn attitude_rad(&self) -> [f32; 3] {
        self.carried_rad.unwrap_or(self.pose.attitude_rad)
    }

    /// Position of the last good pose with the height of now, inertial, m.
    #[inline]
    pub(crate) fn position_m(&self) -> [f32; 3] {
        let [x, y, z] = self.pose.position_m;
        let Some((height, _)) = &self.height else { return [x, y, z] };
        [x, y, self.kept_m.unwrap_or(height.z_m())]
    }

    /// What the law is to see.
    #[inline]
    pub(crate) fn measurement(&self, gyro_rad_s: Option<[f32; 3]>, battery_v: f32) -> Measurement {
        Measurement {
            position_m: self.position_m(),
            attitude_rad: self.attitude_rad(),
            gyro_rad_s,
            battery_v,
        }
    }

    /// Takes in the gyro of this tick.
    #[inline]
    pub(crate) fn hear(&mut self, gyro_rad_s: Option<[f32; 3]>, elapsed_us: u32) {
        self.turns.hear(gyro_rad_s, elapsed_us);
    }

    /// Whether a good pose of this age counts as it comes; else [`Self::see_again`] is to be told before [`Self::see`].
    #[inline]
    pub(crate) fn counts_as_it_comes(&mut self, age_us: u32) -> bool {
        !self.turns.poses_are_late(age_us) && self.carried_rad.is_none()
    }

    /// A good pose came.
    #[inline]
    pub(crate) fn see(&mut self, pose: &Pose) {
        // In parts: as a whole it would be moved by a call.
        let Pose { position_m, attitude_rad } = *pose;
        (self.pose.position_m, self.pose.attitude_rad) = (position_m, attitude_rad);
    }

    /// A good pose that is late, or the first one after ticks without or after late ones. What of the
    /// way to it is no motion.
    #[cold]
    pub(crate) fn see_again(&mut self, pose: &Pose, age_us: u32, since: &Since) -> Option<Leap> {
        let late = self.turns.poses_are_late(age_us);
        let before_rad = self.attitude_rad();
        self.carried_rad = late.then(|| self.turns.brought_to_now(pose.attitude_rad, age_us));
        let silent = self.is_blind && since.silent;
        let leap_m = self.see_height(pose, late.then_some(age_us), &Since { silent, ..*since });
        let leaps = silent || late != self.was_late || leap_m.is_some();
        (self.is_blind, self.was_late) = (false, late);
        leaps.then(|| {
            let seen_rad = self.carried_rad.unwrap_or(pose.attitude_rad);
            let turned_rad = turn(carry(before_rad, since.gyro_rad_s, since.elapsed_us), seen_rad);
            Leap { turned_rad, down_m: leap_m.unwrap_or(0.0) }
        })
    }

    /// A tick without a good pose.
    #[cold]
    pub(crate) fn go_blind(&mut self, since: &Since) {
        self.carried_rad = Some(carry(self.attitude_rad(), since.gyro_rad_s, since.elapsed_us));
        self.is_blind = true;
        if since.silent {
            let [_, _, now_m] = self.position_m();
            self.kept_m = Some(now_m);
        }
        self.go_on_by_motors(since);
    }

    /// The height that a pose tells, which was late by so much. By how much it is off what was last known, by no motion, m.
    fn see_height(&mut self, pose: &Pose, late_us: Option<u32>, since: &Since) -> Option<f32> {
        let ([_, _, before_m], [_, _, seen_m]) = (self.position_m(), pose.position_m);
        let was_carried = self.height.is_some();
        self.go_on_by_motors(since);
        self.kept_m = None;
        self.height = match (self.height, late_us, since.lift) {
            (Some((mut height, hover)), Some(age_us), Some(_)) => {
                if since.silent {
                    height = height.seen_again(seen_m, age_us);
                } else {
                    height.correct(seen_m, age_us);
                }
                Some((height, hover))
            }
            (None, Some(age_us), Some(lift)) => {
                let rate_m_s = if since.silent { 0.0 } else { since.z_rate_m_s };
                Some((Height::start(seen_m, age_us, rate_m_s), lift.hover))
            }
            _ => None,
        };
        let [_, _, now_m] = self.height.map_or(pose.position_m, |_| self.position_m());
        if since.silent {
            return Some(now_m - before_m);
        }
        let went_m = since.z_rate_m_s * (since.elapsed_us as f32 * 1e-6);
        (was_carried != self.height.is_some()).then_some(now_m - (before_m + went_m))
    }

    /// A height that is carried goes on by what the motors were told.
    fn go_on_by_motors(&mut self, since: &Since) {
        let Some((height, hover)) = &mut self.height else { return };
        let commanded_m_s2 = since.lift.map_or(0.0, |lift| GRAVITY_M_S2 * (1.0 - lift.thrust / *hover));
        height.go_on(commanded_m_s2, since.elapsed_us);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GYRO_RAD_S: Option<[f32; 3]> = Some([0.0, 0.0, 0.3]);
    const HOVERS: Option<Lift> = Some(Lift { thrust: 12.0, hover: 12.0 });

    /// A craft that climbs at 0.5 m/s and turns at 0.3 rad/s, as its motors tell.
    fn truth(time_s: f32) -> Pose {
        Pose { position_m: [0.1, 0.2, -1.0 - 0.5 * time_s], attitude_rad: [0.0, 0.0, 0.3 * time_s] }
    }

    fn since(silent: bool, lift: Option<Lift>) -> Since {
        Since { elapsed_us: 10_000, gyro_rad_s: GYRO_RAD_S, silent, z_rate_m_s: -0.5, lift }
    }

    /// One tick, with a pose of this age or without.
    fn tick(whereabouts: &mut Whereabouts, tick: u16, age_us: Option<u32>, since: &Since) -> Option<Leap> {
        whereabouts.hear(GYRO_RAD_S, 10_000);
        let Some(age_us) = age_us else {
            whereabouts.go_blind(since);
            return None;
        };
        let pose = truth(0.01 * f32::from(tick) - age_us as f32 * 1e-6);
        let leap = if whereabouts.counts_as_it_comes(age_us) {
            None
        } else {
            whereabouts.see_again(&pose, age_us, since)
        };
        whereabouts.see(&pose);
        leap
    }

    fn off(whereabouts: &Whereabouts, tick: u16) -> [f32; 2] {
        let now = truth(0.01 * f32::from(tick));
        let [_, _, z] = whereabouts.position_m();
        [z - now.position_m[2], whereabouts.attitude_rad()[2] - now.attitude_rad[2]]
    }

    /// On a good link a pose counts as it came; on a slow one heading and height are those of now, also in ticks between poses, and what
    /// is left of the way from one to the other and back is no motion.
    #[test]
    fn late_poses_are_brought_to_now() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        assert!(!whereabouts.is_known());
        for k in 0..200_u16 {
            let late = (50..100).contains(&k);
            let age_us = if late { 80_000 } else { 15_000 };
            let leap =
                tick(&mut whereabouts, k, (!late || k % 3 != 0).then_some(age_us), &since(false, HOVERS));
            let [z_m, yaw_rad] = off(&whereabouts, k);
            // The first late pose comes at 50, the last at 98; 0.5 s after it poses count as they come.
            if (50..148).contains(&k) {
                assert!(z_m.abs() < 1e-4 && yaw_rad.abs() < 1e-4, "{k}: {z_m} {yaw_rad}");
            } else {
                assert!(
                    (z_m - 0.0075).abs() < 1e-4 && (yaw_rad + 0.0045).abs() < 1e-4,
                    "{k}: {z_m} {yaw_rad}"
                );
            }
            assert_eq!(leap.is_some(), [50, 148].contains(&k), "{k}");
            if let Some(Leap { turned_rad, down_m }) = leap {
                let way = if k == 50 { -1.0 } else { 1.0 };
                assert!((down_m - 0.0075 * way).abs() < 1e-4, "{k}: {down_m}");
                assert!((turned_rad[2] + 0.0045 * way).abs() < 1e-4, "{k}: {turned_rad:?}");
            }
        }
        assert!(whereabouts.is_known());
    }

    /// In a silence the law sees the height that there was. The pose that ends it tells where the craft is, and the motors how fast it is:
    /// all of the way between is a leap.
    #[test]
    fn a_silence_keeps_the_height_and_ends_with_a_leap() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        for k in 0..60_u16 {
            tick(&mut whereabouts, k, Some(80_000), &since(false, HOVERS));
        }
        let [_, _, kept_m] = whereabouts.position_m();
        for k in 60..100_u16 {
            tick(&mut whereabouts, k, None, &since(true, HOVERS));
            assert_eq!(whereabouts.position_m()[2], kept_m);
        }
        let leap = tick(&mut whereabouts, 100, Some(80_000), &since(true, HOVERS)).unwrap();
        let [z_m, _] = off(&whereabouts, 100);
        assert!(z_m.abs() < 1e-4, "{z_m}");
        assert!((leap.down_m - (truth(1.0).position_m[2] - kept_m)).abs() < 1e-4, "{leap:?} {kept_m}");
        assert_eq!(tick(&mut whereabouts, 101, Some(80_000), &since(false, HOVERS)), None);
        assert!(off(&whereabouts, 101)[0].abs() < 1e-4);
    }

    /// A pose that follows another ends no silence, whatever is still said of one.
    #[test]
    fn a_pose_after_a_pose_is_no_leap() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        for k in 0..60_u16 {
            tick(&mut whereabouts, k, Some(80_000), &since(false, HOVERS));
        }
        assert_eq!(tick(&mut whereabouts, 60, Some(80_000), &since(true, HOVERS)), None);
        assert!(off(&whereabouts, 60)[0].abs() < 1e-4);
    }

    /// Without forces the height counts as it comes, and the attitude leaps all the same where poses become late, and where they no longer are.
    #[test]
    fn an_attitude_leaps_without_a_height() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        for k in 0..200_u16 {
            let age_us = if (50..100).contains(&k) { 80_000 } else { 15_000 };
            let leap = tick(&mut whereabouts, k, Some(age_us), &since(false, None));
            // The last late one is at 99; 0.5 s after it poses count as they come.
            assert_eq!(leap.is_some(), [50, 149].contains(&k), "{k}: {leap:?}");
            if let Some(Leap { turned_rad, down_m }) = leap {
                let way = if k == 50 { 1.0 } else { -1.0 };
                assert!(
                    (turned_rad[2] - 0.0045 * way).abs() < 1e-4 && down_m == 0.0,
                    "{k}: {turned_rad:?} {down_m}"
                );
            }
        }
    }

    /// Where the first pose after a silence is the first that is late, nothing tells how fast the craft is.
    #[test]
    fn a_late_pose_after_a_silence_counts_as_it_comes_where_none_was_late_before() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        for k in 0..60_u16 {
            tick(&mut whereabouts, k, (k < 20).then_some(15_000), &since(k > 25, HOVERS));
        }
        let leap = tick(&mut whereabouts, 60, Some(80_000), &since(true, HOVERS)).unwrap();
        assert!((leap.down_m - -0.5 * (0.52 - 0.175)).abs() < 1e-5, "{leap:?}");
        assert_eq!(whereabouts.position_m(), truth(0.52).position_m);
    }

    /// Motors at idle carry nothing, nor is a command a force: the height counts as it came.
    #[test]
    fn a_height_without_forces_counts_as_it_comes() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        for k in 0..100_u16 {
            let lift = HOVERS.filter(|_| (40..80).contains(&k));
            tick(&mut whereabouts, k, Some(80_000), &since(false, lift));
            let [z_m, yaw_rad] = off(&whereabouts, k);
            let carried = (40..80).contains(&k);
            assert!((z_m - if carried { 0.0 } else { 0.04 }).abs() < 1e-4, "{k}: {z_m}");
            // Turns before the first sample are not known.
            assert!(k < 8 || yaw_rad.abs() < 1e-4, "{k}: {yaw_rad}");
        }
    }

    /// More thrust than carries it is an acceleration, by Newton's law.
    #[test]
    fn the_height_follows_the_thrust_of_the_motors() {
        let mut whereabouts = Whereabouts::UNKNOWN;
        let lift = |thrust| Some(Lift { thrust, hover: 12.0 });
        let still = Since { z_rate_m_s: 0.0, ..since(false, lift(12.0)) };
        let pose = truth(0.0);
        whereabouts.counts_as_it_comes(80_000);
        whereabouts.see_again(&pose, 80_000, &still);
        whereabouts.see(&pose);
        for _ in 0..10 {
            // What carries it now is not what counts.
            whereabouts.go_blind(&Since { lift: Some(Lift { thrust: 18.0, hover: 15.0 }), ..still });
        }
        let [_, _, up_m] = whereabouts.position_m();
        // Half its weight more, for 0.1 s.
        assert!((up_m - (-1.0 - 0.5 * 0.5 * 9.81 * 0.01)).abs() < 1e-4, "{up_m}");
        for _ in 0..10 {
            whereabouts.go_blind(&Since { lift: lift(12.0), ..still });
        }
        let [_, _, on_m] = whereabouts.position_m();
        assert!((on_m - (up_m - 0.5 * 9.81 * 0.1 * 0.1)).abs() < 1e-4, "{on_m}");
    }
}
