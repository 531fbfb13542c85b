//! Refused poses that are right after all.
//!
//! A pose that the craft cannot have flown to is refused. If all that follow are refused as well
//! because the last good one is the wrong one (the tracker had been silent, was moved, or had taken
//! another thing for the craft), refusing them for ever loses a craft that is seen well. So poses
//! that follow each other as those of a craft do count after a while, as long as their attitude is
//! the one that the gyro has carried on: a position can be believed anew, a heading cannot.

use crate::inputs::input_checks::{POSITION_LIMIT_M, magnitude};
use crate::inputs::readings::Pose;
use crate::safety::limits::Limits;
use crate::safety::plausibility::{differ, is_turned_so, is_within};
use crate::safety::timers::Held;

/// What is refused, and for how long it has agreed with itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SecondOpinion {
    /// The last good position at the time: a good pose in between ends it all.
    good_m: [f32; 3],
    last_m: [f32; 3],
    agreed: Held,
}

impl SecondOpinion {
    pub(crate) const NONE: Self = Self { good_m: [f32::NAN; 3], last_m: [f32::NAN; 3], agreed: Held::NOT };

    /// Hears a refused pose, so many us after the last one of any kind; the last good position in m
    /// and the attitude by the gyro in rad. Returns whether it is to be believed.
    #[cold]
    pub(crate) fn hear(
        &mut self,
        pose: &Pose,
        good_m: [f32; 3],
        attitude_rad: [f32; 3],
        since_us: u32,
        limits: &Limits,
    ) -> bool {
        if differ(&good_m, &self.good_m) {
            *self = Self { good_m, ..Self::NONE };
        }
        let last_m = core::mem::replace(&mut self.last_m, pose.position_m);
        // From one to the next no more than a tenth of a jump, and what it flies meanwhile.
        let step_m = 0.1 * limits.jump_m + limits.speed_m_per_us * since_us as f32;
        let agrees = is_within(pose.position_m, last_m, step_m)
            && differ(&pose.position_m, &last_m)
            && pose.position_m.iter().all(|x| magnitude(*x) <= POSITION_LIMIT_M.to_bits())
            && is_turned_so(pose.attitude_rad, attitude_rad, limits);
        let believed = self.agreed.step(agrees, since_us, limits.believed_us);
        if believed {
            *self = Self::NONE;
        }
        believed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;

    /// After how many refused poses, 10 ms apart, one is believed.
    fn believed(pose: impl Fn(f32) -> Pose) -> Option<u8> {
        let limits = Limits::new(&Config::thesis());
        let mut second = SecondOpinion::NONE;
        (1..60).find(|k| second.hear(&pose(f32::from(*k)), [0.0; 3], [0.0; 3], 10_000, &limits))
    }

    fn at(x_m: f32, yaw_rad: f32) -> Pose {
        Pose { position_m: [x_m, 0.0, -1.0], attitude_rad: [0.0, 0.0, yaw_rad] }
    }

    /// The first only begins; ten agree with the one before them.
    #[test]
    fn poses_that_follow_each_other_are_believed_after_their_time() {
        assert_eq!(believed(|k| at(5.0 + 0.02 * k, 0.3)), Some(11));
    }

    /// By hand: a tenth of 0.5 m, and 3 m/s for 10 ms, are 0.08 m from one to the next.
    #[test]
    fn a_step_is_a_tenth_of_a_jump_and_what_the_craft_flies_meanwhile() {
        assert_eq!(believed(|k| at(5.0 + 0.079 * k, 0.0)), Some(11));
        assert_eq!(believed(|k| at(5.0 + 0.081 * k, 0.0)), None);
    }

    /// Two trackers in turn, each right by itself.
    #[test]
    fn a_good_pose_in_between_begins_anew() {
        let limits = Limits::new(&Config::thesis());
        let mut second = SecondOpinion::NONE;
        for k in 1..60 {
            let good_m = [1e-3 * (k / 8) as f32, 0.0, 0.0];
            assert!(!second.hear(&at(5.0 + 0.02 * k as f32, 0.0), good_m, [0.0; 3], 10_000, &limits));
        }
    }

    #[test]
    fn poses_that_do_not_are_not() {
        assert_eq!(believed(|k| at(5.0 + 0.3 * k, 0.0)), None, "faster than the craft");
        assert_eq!(
            believed(|k| at(if k % 5.0 == 0.0 { 1.0 } else { 5.0 + 0.01 * k }, 0.0)),
            None,
            "restless"
        );
        assert_eq!(believed(|_| at(5.0, 0.0)), None, "always the same");
        assert_eq!(believed(|k| at(5.0 + 0.01 * k, 3.0)), None, "the gyro has seen no turn");
        assert_eq!(believed(|k| at(2e5 + 0.1 * k, 0.0)), None, "beyond reason");
        assert_eq!(believed(|_| at(f32::NAN, 0.0)), None);
    }
}
