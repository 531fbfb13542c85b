//! Detectors: from what comes in with each tick to a set of [`Conditions`].
//!
//! - Time passes by the difference between two ticks only, taken modulo 2^32; the
//!   [`timers`](crate::safety::timers) add it up.
//! - Comparisons are written so that NaN falls on the bad side.
//! - A pose that is frozen, jumped or not a number counts as one that did not come; the silence
//!   that follows does the rest.
//!
//! From when on something counts is the table [`Supervision`] of the gains file. What is done about
//! a condition is the table in [`state_machine`](crate::safety::state_machine).
//!
//! [`Supervision`]: crate::config::supervision_limits::Supervision

use crate::inputs::input_checks::magnitude;
use crate::inputs::readings::Pose;
use crate::safety::conditions::{Condition, Conditions};
use crate::safety::limits::Limits;
use crate::safety::plausibility::{differ, is_inside, is_pose, is_reachable, is_tilted_beyond, tilt_bound};
use crate::safety::second_opinion::SecondOpinion;
use crate::safety::timers::{Held, Silence};

/// How often something was refused since the start; counts stay at the greatest number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Poses refused: frozen, jumped or not a number.
    pub poses_refused: u32,
    /// Ticks without a usable gyro sample.
    pub imu_refused: u32,
    /// Commands refused: not a number.
    pub commands_refused: u32,
    /// Late ticks.
    pub overruns: u32,
    /// Leaps of the clock.
    pub clock_jumps: u32,
}

#[cold]
pub(crate) fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// What is known of the craft before a pose comes.
pub(crate) struct LastKnown<'a> {
    /// The last pose that could be flown with.
    pub(crate) last: &'a Pose,
    /// Where the craft has turned since then by the gyro, rad.
    pub(crate) attitude_rad: [f32; 3],
    /// Without it a pose may be anywhere.
    pub(crate) anchored: bool,
}

/// Whether good poses come every so many ticks, always as many. After one that comes earlier or later
/// than the others the rates of motion capture are wrong for a while: the way of two ticks in one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Rhythm {
    /// Ticks since the last pose, and between the two before.
    since: u8,
    between: u8,
    /// Ticks until the velocity estimators have forgotten the last irregularity.
    settling: u8,
}

/// Ticks after which a velocity estimator has forgotten an irregularity: the thesis' one (75 rad/s,
/// critically damped, 100 Hz) all but half a percent of it.
const FORGOTTEN: u8 = 10;

impl Rhythm {
    /// A tick with or without a good pose; whether the rates of motion capture are worth comparing.
    #[inline]
    fn tick(&mut self, seen: bool) -> bool {
        self.since = self.since.saturating_add(1);
        self.settling = self.settling.saturating_sub(1);
        if seen {
            if self.since != self.between {
                self.settling = FORGOTTEN;
            }
            (self.between, self.since) = (self.since, 0);
        }
        self.settling == 0
    }
}

/// All detectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Detectors {
    last_us: Option<u32>,
    /// Time lost to late ticks and not yet made up for, us.
    debt_us: u32,
    pub(crate) link: Silence,
    pub(crate) pose: Silence,
    pose_repeats: u32,
    /// For how long no pose at all has come, us.
    unheard_us: u32,
    /// Poses that were refused.
    second: SecondOpinion,
    /// A simulation begins with a line of equal poses: none of them is frozen.
    pose_settling: bool,
    /// Whether the sample of this tick can be compared with motion capture.
    imu_comparable: bool,
    imu_last: [f32; 3],
    imu_before: [f32; 3],
    /// Mean square of the second differences, rad^2/s^2.
    vibration: f32,
    imu_equal: u32,
    imu_missing: u32,
    imu_age_us: u32,
    /// Whether poses come evenly.
    rhythm: Rhythm,
    /// Smoothed difference of gyro and motion capture, rad/s.
    difference_rad_s: [f32; 3],
    imu_disagrees: bool,
    battery: [Held; 3],
    battery_low: bool,
    tilt: Held,
    fence: Held,
    outside: bool,
    outputs: Held,
    armed: Held,
    pub(crate) counters: Counters,
}

impl Detectors {
    /// Nothing has been received yet.
    pub(crate) fn at_rest() -> Self {
        Self {
            last_us: None,
            debt_us: 0,
            link: Silence::NEVER,
            pose: Silence::NEVER,
            pose_repeats: 0,
            unheard_us: 0,
            second: SecondOpinion::NONE,
            pose_settling: false,
            imu_comparable: false,
            imu_last: [f32::NAN; 3],
            imu_before: [f32::NAN; 3],
            vibration: 0.0,
            imu_equal: 0,
            imu_missing: u32::MAX,
            imu_age_us: u32::MAX,
            rhythm: Rhythm::default(),
            difference_rad_s: [0.0; 3],
            imu_disagrees: false,
            battery: [Held::default(); 3],
            battery_low: false,
            tilt: Held::default(),
            fence: Held::default(),
            outside: true,
            outputs: Held::default(),
            armed: Held::default(),
            counters: Counters::default(),
        }
    }

    /// Everything has been in order until now.
    pub(crate) fn in_flight() -> Self {
        Self {
            link: Silence::GOOD,
            pose: Silence::GOOD,
            pose_settling: true,
            imu_missing: 0,
            imu_age_us: 0,
            outside: false,
            ..Self::at_rest()
        }
    }

    /// Time since the tick before in us; one period if the clock cannot be right.
    #[inline]
    pub(crate) fn clock(&mut self, time_us: u32, limits: &Limits, conditions: &mut Conditions) -> u32 {
        let period_us = limits.period_us;
        let elapsed_us = self.last_us.map_or(period_us, |last_us| time_us.wrapping_sub(last_us));
        self.last_us = Some(time_us);
        // Half a period to one and a half.
        if self.debt_us == 0 && elapsed_us.wrapping_sub(period_us / 2) <= period_us {
            return elapsed_us;
        }
        self.off_time(elapsed_us, limits, conditions)
    }

    /// Handles a tick out of time, or one of those after it.
    #[cold]
    fn off_time(&mut self, elapsed_us: u32, limits: &Limits, conditions: &mut Conditions) -> u32 {
        let Limits { period_us, jump_us, overrun_us, .. } = *limits;
        // Backwards is a leap too: modulo 2^32 it is a long way forward. No two ticks are within
        // one microsecond.
        if elapsed_us == 0 || elapsed_us > jump_us {
            count(&mut self.counters.clock_jumps);
            conditions.note(Condition::ClockJumped, true);
            return period_us;
        }
        if elapsed_us > period_us + period_us / 2 {
            count(&mut self.counters.overruns);
            self.debt_us = self.debt_us.saturating_add(elapsed_us - period_us);
        } else {
            self.debt_us = self.debt_us.saturating_sub(period_us / 10);
        }
        conditions.note(Condition::LoopOverrun, self.debt_us >= overrun_us);
        elapsed_us
    }

    /// Detects a silent link: `came` is whether a command came.
    #[inline]
    pub(crate) fn link(&mut self, came: bool, elapsed_us: u32, limits: &Limits, conditions: &mut Conditions) {
        self.link.step(came, elapsed_us, &limits.link);
        if self.link.late {
            conditions.note(Condition::LinkLate, true);
            conditions.note(Condition::LinkLost, self.link.age_us >= limits.link.lost_us);
        }
    }

    /// Detects bad and missing poses; returns whether a pose came that can be flown with.
    #[inline]
    pub(crate) fn pose(
        &mut self,
        pose: Option<&Pose>,
        known: &LastKnown<'_>,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) -> bool {
        let LastKnown { last, attitude_rad, anchored } = *known;
        let good = pose.is_some_and(|pose| {
            self.outside = !is_inside(pose.position_m, limits);
            let plausible = if anchored {
                // Refused poses do not extend the reach: a tracker that has jumped is believed for
                // moving as a craft does, not for staying there.
                let reach_m = if self.unheard_us == 0 { limits.jump_m } else { self.reach_m(limits) };
                is_reachable(pose, last.position_m, attitude_rad, reach_m, limits)
            } else {
                is_pose(pose)
            };
            if plausible && differ(&pose.position_m, &last.position_m) {
                self.pose_repeats = 0;
                self.pose_settling &= !anchored;
                return true;
            }
            self.doubtful(pose, known, plausible, elapsed_us, limits, conditions)
        });
        self.unheard_us = if pose.is_some() { 0 } else { self.unheard_us.saturating_add(elapsed_us) };
        self.pose.step(good, elapsed_us, &limits.pose);
        if self.pose.late {
            conditions.note(Condition::PoseLate, true);
            conditions.note(Condition::PoseLost, self.pose.age_us >= limits.pose.lost_us);
            conditions.note(Condition::PoseGone, self.pose.age_us >= limits.pose_cut_us);
        }
        let outside = self.fence.step(self.outside, elapsed_us, limits.fence_us);
        conditions.note(Condition::OutsideFence, outside);
        good
    }

    /// A pose that came too late counts as none.
    #[cold]
    pub(crate) fn old_pose(&mut self, conditions: &mut Conditions) {
        count(&mut self.counters.poses_refused);
        conditions.note(Condition::PoseOld, true);
    }

    /// How far from the last good pose the craft may be, m.
    #[cold]
    fn reach_m(&self, limits: &Limits) -> f32 {
        limits.jump_m + limits.speed_m_per_us * self.unheard_us as f32
    }

    /// A pose that came again unchanged, or one that cannot be true.
    #[cold]
    fn doubtful(
        &mut self,
        pose: &Pose,
        known: &LastKnown<'_>,
        plausible: bool,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) -> bool {
        self.pose_repeats = if pose == known.last { self.pose_repeats.saturating_add(1) } else { 0 };
        let frozen = self.pose_repeats >= limits.pose_repeats && !self.pose_settling;
        conditions.note(Condition::PoseFrozen, frozen);
        conditions.note(Condition::PoseJumped, !plausible);
        if plausible && !frozen {
            return true;
        }
        let since_us = self.unheard_us.saturating_add(elapsed_us);
        let LastKnown { last, attitude_rad, anchored } = *known;
        let believed =
            !plausible && anchored && self.second.hear(pose, last.position_m, attitude_rad, since_us, limits);
        if !believed {
            count(&mut self.counters.poses_refused);
        }
        believed
    }

    /// Detects bad and missing gyro samples; returns the sample if it can be used.
    #[inline]
    pub(crate) fn imu(
        &mut self,
        gyro_rad_s: Option<[f32; 3]>,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) -> Option<[f32; 3]> {
        if let Some(rates) = gyro_rad_s {
            let greatest = rates.iter().fold(0, |greatest, rate| magnitude(*rate).max(greatest));
            if greatest <= limits.rate_limit && differ(&rates, &self.imu_last) && !self.imu_disagrees {
                self.shake(rates, limits);
                conditions.note(Condition::Vibrating, self.vibration > limits.vibration);
                (self.imu_before, self.imu_last) = (self.imu_last, rates);
                (self.imu_equal, self.imu_missing, self.imu_age_us) = (1, 0, 0);
                self.imu_comparable = true;
                return gyro_rad_s;
            }
        }
        self.imu_in_doubt(gyro_rad_s, elapsed_us, limits, conditions)
    }

    /// Adds a good sample to the mean of the vibration.
    #[inline]
    fn shake(&mut self, [p, q, r]: [f32; 3], limits: &Limits) {
        let ([p1, q1, r1], [p2, q2, r2]) = (self.imu_last, self.imu_before);
        let (dp, dq, dr) = (p - 2.0 * p1 + p2, q - 2.0 * q1 + q2, r - 2.0 * r1 + r2);
        let square = dp * dp + dq * dq + dr * dr;
        // The first samples have none before them.
        if square <= f32::MAX {
            self.vibration += limits.vibration_gain * (square - self.vibration);
        }
    }

    /// Poses come, and the newest is not the one before it again.
    #[inline]
    pub(crate) fn pose_is_new(&self) -> bool {
        !self.pose.late && self.pose_repeats == 0
    }

    /// Handles no sample, an implausible one, or a repeated one.
    #[cold]
    fn imu_in_doubt(
        &mut self,
        gyro_rad_s: Option<[f32; 3]>,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) -> Option<[f32; 3]> {
        let plausible =
            gyro_rad_s.filter(|rates| rates.iter().all(|rate| magnitude(*rate) <= limits.rate_limit));
        self.imu_comparable = plausible.is_some();
        match plausible {
            Some(rates) => {
                self.imu_missing = 0;
                self.imu_equal = if rates == self.imu_last { self.imu_equal.saturating_add(1) } else { 1 };
                self.imu_last = rates;
            }
            None => self.imu_missing = self.imu_missing.saturating_add(1),
        }
        self.imu_age_us = self.imu_age_us.saturating_add(elapsed_us);
        let stuck = self.imu_equal >= limits.imu_repeats;
        conditions.note(Condition::ImuLate, self.imu_missing >= limits.imu_missing_ticks);
        conditions.note(Condition::ImuStuck, stuck);
        conditions.note(Condition::ImuDisagrees, self.imu_disagrees);
        // Without poses the gyro is all that keeps the craft level.
        let needed = limits.uses_gyro || self.pose.late;
        conditions.note(Condition::ImuGone, needed && self.imu_age_us >= limits.imu_cut_us);
        let usable = plausible.filter(|_| !stuck && !self.imu_disagrees);
        if usable.is_none() {
            count(&mut self.counters.imu_refused);
        }
        usable
    }

    /// Detects a low voltage.
    #[inline]
    pub(crate) fn battery(
        &mut self,
        voltage_v: f32,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) {
        let [warn_v, _, _] = limits.battery_v;
        if self.battery_low || !(voltage_v >= warn_v) {
            self.battery_sags(voltage_v, elapsed_us, limits, conditions);
        }
    }

    #[cold]
    fn battery_sags(
        &mut self,
        voltage_v: f32,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) {
        let levels = [Condition::BatteryLow, Condition::BatteryCritical, Condition::BatteryEmpty];
        self.battery_low = false;
        for ((held, level_v), condition) in self.battery.iter_mut().zip(limits.battery_v).zip(levels) {
            let low = !(voltage_v >= level_v);
            self.battery_low |= low;
            conditions.note(condition, held.step(low, elapsed_us, limits.battery_us));
        }
    }

    /// Detects excessive tilt of the attitude (rad) that is flown with.
    #[inline]
    pub(crate) fn tilt(
        &mut self,
        attitude_rad: [f32; 3],
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) {
        let tilted = !(tilt_bound(attitude_rad) <= limits.tilt_rad) && is_tilted_beyond(attitude_rad, limits);
        conditions.note(Condition::Tilted, self.tilt.step(tilted, elapsed_us, limits.tilt_us));
    }

    /// Detects outputs that do not take the commands.
    #[inline]
    pub(crate) fn outputs(
        &mut self,
        ready: bool,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) {
        conditions.note(Condition::OutputsFailed, self.outputs.step(!ready, elapsed_us, limits.outputs_us));
    }

    /// Detects a craft that is armed and is not flown.
    #[cold]
    pub(crate) fn armed(
        &mut self,
        waits: bool,
        elapsed_us: u32,
        limits: &Limits,
        conditions: &mut Conditions,
    ) {
        conditions.note(Condition::IdleForLong, self.armed.step(waits, elapsed_us, limits.armed_us));
    }

    /// A tick with or without a good pose; whether the rates of motion capture are worth comparing.
    #[inline]
    pub(crate) fn poses_come_evenly(&mut self, seen: bool) -> bool {
        self.rhythm.tick(seen)
    }

    /// Compares the body rates by gyro and by motion capture, in rad/s.
    #[inline]
    pub(crate) fn compare_rates(&mut self, gyro_rad_s: [f32; 3], tracked_rad_s: [f32; 3], limits: &Limits) {
        if !self.imu_comparable {
            return;
        }
        let ([p, q, r], [tp, tq, tr]) = (gyro_rad_s, tracked_rad_s);
        let mut difference = [p - tp, q - tq, r - tr];
        let [dp, dq, dr] = difference;
        let bound_rad_s = 2.0 * limits.disagreement_rad_s;
        if !(dp.abs() + dq.abs() + dr.abs() <= bound_rad_s) {
            // One wild sample counts no more than one at the bound.
            difference = bounded(difference, bound_rad_s);
        }
        let mut sum = 0.0;
        for (smooth, difference) in self.difference_rad_s.iter_mut().zip(difference) {
            *smooth += limits.disagreement_gain * (difference - *smooth);
            sum += smooth.abs();
        }
        self.imu_disagrees = sum > limits.disagreement_rad_s;
    }

    /// Whether clock and loop keep time.
    pub(crate) fn on_time(&self, limits: &Limits) -> bool {
        self.debt_us <= limits.overrun_us / 2
    }

    /// Whether the last pose was inside the box.
    pub(crate) fn is_inside(&self) -> bool {
        !self.outside
    }
}

/// Each value clamped to the limit on either side; 0 for NaN.
#[cold]
fn bounded(values: [f32; 3], limit: f32) -> [f32; 3] {
    // Not `clamp`, which panics where the limit is NaN.
    values.map(|value| {
        if value > limit {
            limit
        } else if value < -limit {
            -limit
        } else if value.is_nan() {
            0.0
        } else {
            value
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;
    use crate::config::supervision_limits::BatteryLevels;
    use Condition as C;

    const PERIOD_US: u32 = 10_000;
    const POSE: Pose = Pose { position_m: [0.0, 0.0, -1.0], attitude_rad: [0.0; 3] };

    fn limits() -> Limits {
        Limits::new(&Config::thesis())
    }

    /// What one call of a detector found.
    fn found<T>(detect: impl FnOnce(&mut Conditions) -> T) -> (T, Vec<Condition>) {
        let mut conditions = Conditions::NONE;
        let result = detect(&mut conditions);
        (result, conditions.iter().collect())
    }

    #[test]
    fn the_clock_may_wrap_but_neither_leap_nor_stand_still() {
        let limits = limits();
        let mut detectors = Detectors::in_flight();
        let mut tick = |time_us| found(|conditions| detectors.clock(time_us, &limits, conditions));
        assert_eq!(tick(u32::MAX - 4999), (PERIOD_US, vec![]), "the first tick");
        assert_eq!(tick(5000), (PERIOD_US, vec![]), "across the wrap");
        for time_us in [5000, 4000, 3_000_000] {
            assert_eq!(tick(time_us), (PERIOD_US, vec![C::ClockJumped]), "{time_us}");
        }
        assert_eq!(detectors.counters.clock_jumps, 3);
    }

    /// The table allows 0.1 s of delay: three ticks 40 ms late, and less after ticks in time.
    #[test]
    fn late_ticks_add_up_and_ticks_in_time_make_up_for_them() {
        let limits = limits();
        let mut detectors = Detectors::in_flight();
        let mut time_us = 0;
        let mut tick = |elapsed_us| {
            time_us += elapsed_us;
            let (_, conditions) = found(|conditions| detectors.clock(time_us, &limits, conditions));
            (conditions, detectors.on_time(&limits), detectors.counters.overruns)
        };
        tick(0);
        assert_eq!(tick(50_000), (vec![], true, 1));
        assert_eq!(tick(50_000), (vec![], false, 2), "80 ms: no arming");
        assert_eq!(tick(50_000), (vec![C::LoopOverrun], false, 3), "120 ms");
        // A tenth of a period each.
        (0..20).for_each(|_| assert_eq!(tick(PERIOD_US).2, 3));
        assert_eq!(tick(PERIOD_US).0, vec![]);
        (0..60).for_each(|_| drop(tick(PERIOD_US)));
        assert!(tick(PERIOD_US).1);
    }

    #[test]
    fn a_silent_link_is_late_and_then_lost() {
        let limits = limits();
        let mut detectors = Detectors::in_flight();
        for k in 1..=200 {
            let ((), conditions) = found(|c| detectors.link(false, PERIOD_US, &limits, c));
            let want: &[Condition] = match k {
                ..50 => &[],
                50..190 => &[C::LinkLate],
                _ => &[C::LinkLate, C::LinkLost],
            };
            assert_eq!(conditions, want, "{k}");
        }
    }

    /// Ticks of a pose each, as a craft in flight sees them: whether it is used, and what is found.
    fn pose_ticks(poses: impl IntoIterator<Item = Option<Pose>>) -> (Vec<(bool, Vec<Condition>)>, u32) {
        let limits = limits();
        let mut detectors = Detectors { pose_settling: false, ..Detectors::in_flight() };
        let mut last = POSE;
        let ticks = poses.into_iter().map(|pose| {
            let known = LastKnown { last: &last, attitude_rad: last.attitude_rad, anchored: true };
            let tick = found(|c| detectors.pose(pose.as_ref(), &known, PERIOD_US, &limits, c));
            if let (true, Some(pose)) = (tick.0, pose) {
                last = pose;
            }
            tick
        });
        (ticks.collect(), detectors.counters.poses_refused)
    }

    #[test]
    fn a_pose_that_never_changes_is_frozen() {
        let (ticks, refused) = pose_ticks([Some(POSE); 5]);
        let used: Vec<bool> = ticks.iter().map(|tick| tick.0).collect();
        // The table allows two repetitions.
        assert_eq!(used, [true, true, false, false, false]);
        assert_eq!(ticks[2].1, [C::PoseFrozen]);
        assert_eq!(refused, 3);
    }

    /// Until the first one that moves, as at the beginning of a simulation.
    #[test]
    fn equal_poses_are_not_frozen_before_one_has_moved() {
        let limits = limits();
        let mut detectors = Detectors::in_flight();
        let mut used = |pose: Pose, last: Pose, anchored| {
            let known = LastKnown { last: &last, attitude_rad: last.attitude_rad, anchored };
            found(|c| detectors.pose(Some(&pose), &known, PERIOD_US, &limits, c)).0
        };
        (0..10).for_each(|_| assert!(used(POSE, POSE, true)));
        let moved = Pose { position_m: [0.01, 0.0, -1.0], ..POSE };
        // On the ground nothing settles.
        assert!(used(moved, POSE, false));
        (0..10).for_each(|_| assert!(used(moved, moved, true)));
        assert!(used(POSE, moved, true));
        assert_eq!([(); 4].map(|()| used(POSE, POSE, true)), [true, true, false, false]);
    }

    #[test]
    fn a_pose_out_of_reach_is_refused_until_a_silence_makes_room() {
        let away = Pose { position_m: [0.6, 0.0, -1.0], ..POSE };
        let (ticks, _) = pose_ticks([Some(away), Some(away)]);
        assert_eq!(ticks, [(false, vec![C::PoseJumped]), (false, vec![C::PoseJumped])]);
        // 0.5 m at once, and 3 m/s: four silent ticks and half a metre reach 0.62 m.
        let after_silence = |x_m: f32| {
            let there = Pose { position_m: [x_m, 0.0, -1.0], ..POSE };
            pose_ticks([None, None, None, None, Some(there)]).0[4].0
        };
        assert!(after_silence(0.61) && !after_silence(0.63));
    }

    /// The first refused one only begins, ten agree with the one before them (see `second_opinion.rs`); then the craft is there.
    #[test]
    fn refused_poses_that_follow_each_other_are_believed_and_count_no_more() {
        let elsewhere = |k: u8| Pose { position_m: [5.0 + 0.02 * f32::from(k), 0.0, -1.0], ..POSE };
        let (ticks, refused) = pose_ticks((0..20).map(|k| Some(elsewhere(k))));
        let used: Vec<usize> = (0..20).filter(|k| ticks[*k].0).collect();
        assert_eq!((used, refused), ((10..20).collect(), 10));
        assert_eq!(ticks[10].1, [C::PoseLate, C::PoseJumped], "no good one for 0.1 s");
    }

    /// The thrust that carries a craft is learned from such poses alone.
    #[test]
    fn a_pose_is_new_that_came_in_time_and_is_not_the_last_one() {
        let limits = limits();
        let mut detectors = Detectors { pose_settling: false, ..Detectors::in_flight() };
        let moved = |k: u8| Pose { position_m: [0.01 * f32::from(k), 0.0, -1.0], ..POSE };
        let mut last = POSE;
        let mut is_new = |pose: Option<Pose>| {
            let known = LastKnown { last: &last, attitude_rad: last.attitude_rad, anchored: true };
            found(|c| detectors.pose(pose.as_ref(), &known, PERIOD_US, &limits, c));
            last = pose.unwrap_or(last);
            detectors.pose_is_new()
        };
        assert!(is_new(Some(moved(1))) && !is_new(Some(moved(1))) && is_new(Some(moved(2))));
        // Late after 50 ms, and good again after 100 ms.
        assert_eq!([(); 5].map(|()| is_new(None)), [true, true, true, true, false]);
        let good: Vec<u8> = (3..20).filter(|k| is_new(Some(moved(*k)))).collect();
        assert!(good.first().is_some_and(|k| (10..15).contains(k)), "{good:?}");
    }

    #[test]
    fn no_pose_is_late_lost_and_gone_in_turn() {
        let (ticks, _) = pose_ticks([None; 190]);
        let conditions = |k: usize| ticks[k - 1].1.as_slice();
        assert_eq!(conditions(4), []);
        assert_eq!(conditions(5), [C::PoseLate]);
        assert_eq!(conditions(40), [C::PoseLate, C::PoseLost]);
        assert_eq!(conditions(190), [C::PoseLate, C::PoseLost, C::PoseGone]);
    }

    #[test]
    fn leaving_the_box_counts_after_its_time() {
        let outside = |k: u8| Pose { position_m: [0.0, 2.15 + 0.1 * f32::from(k), -1.0], ..POSE };
        let (ticks, _) = pose_ticks((0..30).map(|k| Some(outside(k.min(3) * 2 + k % 2))));
        let first = ticks.iter().position(|tick| tick.1.contains(&C::OutsideFence));
        // Outside from tick 1 on, for 0.2 s.
        assert_eq!(first, Some(20), "{ticks:?}");
    }

    #[test]
    fn a_gyro_that_repeats_itself_is_stuck_and_a_wild_one_is_missing() {
        let limits = limits();
        let mut detectors = Detectors::in_flight();
        let mut sample = |rates| found(|c| detectors.imu(rates, PERIOD_US, &limits, c));
        let same = Some([0.1, 0.0, 0.0]);
        for _ in 0..9 {
            assert_eq!(sample(same), (same, vec![]));
        }
        assert_eq!(sample(same), (None, vec![C::ImuStuck]));
        let other = Some([0.2, 0.0, 0.0]);
        assert_eq!(sample(other), (other, vec![]));
        for (k, bad) in [Some([36.0, 0.0, 0.0]), Some([f32::NAN, 0.0, 0.0]), None].into_iter().enumerate() {
            let want = if k == 2 { vec![C::ImuLate] } else { vec![] };
            assert_eq!(sample(bad), (None, want));
        }
    }

    #[test]
    fn a_simulation_that_begins_in_the_air_has_had_everything_and_a_boot_nothing() {
        let limits = Limits { uses_gyro: true, ..limits() };
        let first = |mut detectors: Detectors| found(|c| detectors.imu(None, PERIOD_US, &limits, c));
        assert_eq!(first(Detectors::in_flight()), (None, vec![]));
        assert_eq!(first(Detectors::at_rest()), (None, vec![C::ImuLate, C::ImuGone]));
    }

    /// By hand: 1.1 + 2 * 0.4 + 0.7 = 2.6, 0.2 - 2 * 0.5 - 0.3 = -1.1 and -0.6 - 2 * 0.1 + 0.9 = 0.1 have 7.98 as sum of squares.
    #[test]
    fn vibration_is_the_mean_square_of_second_differences() {
        let limits = limits();
        let mut detectors = Detectors {
            imu_before: [0.7, -0.3, 0.9],
            imu_last: [-0.4, 0.5, 0.1],
            vibration: 0.5,
            ..Detectors::in_flight()
        };
        detectors.shake([1.1, 0.2, -0.6], &limits);
        let want = 0.5 + limits.vibration_gain * (7.98 - 0.5);
        assert!((detectors.vibration - want).abs() < 1e-6, "{} {want}", detectors.vibration);
        // At its limit it is not beyond it.
        for (least, vibrates) in [(16.0_f32, false), (16.0_f32.next_down(), true)] {
            let limits = Limits { vibration: least, ..limits };
            let mut detectors = Detectors {
                imu_before: [0.0; 3],
                imu_last: [0.0; 3],
                vibration: 16.0,
                ..Detectors::in_flight()
            };
            let (_, conditions) = found(|c| detectors.imu(Some([4.0, 0.0, 0.0]), PERIOD_US, &limits, c));
            assert_eq!(conditions == [C::Vibrating], vibrates);
        }
    }

    /// Nothing of a gyro that contradicts the poses is used, whatever it measures.
    #[test]
    fn a_gyro_that_disagrees_is_not_used() {
        let limits = limits();
        let mut detectors = Detectors { imu_disagrees: true, ..Detectors::in_flight() };
        for k in 1..5_u8 {
            let sample = Some([0.1 * f32::from(k), 0.0, 0.0]);
            let got = found(|c| detectors.imu(sample, PERIOD_US, &limits, c));
            assert_eq!((got, detectors.counters.imu_refused), ((None, vec![C::ImuDisagrees]), k.into()));
        }
    }

    /// It cannot where the law flies by the gyro, or no poses come.
    #[test]
    fn a_craft_can_do_without_a_gyro_or_it_cannot() {
        for (uses_gyro, late) in [(false, false), (false, true), (true, false), (true, true)] {
            let limits = Limits { uses_gyro, ..limits() };
            let mut detectors = Detectors::in_flight();
            detectors.pose.late = late;
            let first = (1..1000)
                .find(|_| found(|c| detectors.imu(None, PERIOD_US, &limits, c)).1.contains(&C::ImuGone));
            let want = limits.imu_cut_us.div_ceil(PERIOD_US);
            assert_eq!(first, (uses_gyro || late).then_some(want), "{uses_gyro} {late}");
        }
    }

    /// Sines of 1 rad/s on one axis, by the frequency response of the second difference (Oppenheim
    /// and Schafer): 4 sin^2(pi f / fs), so 16/2 at 25 Hz, a quarter of what 1 rad/s at 50 Hz gives.
    #[test]
    fn what_shakes_from_sample_to_sample_is_vibration_and_motion_is_not() {
        let limits = limits();
        let shaken = |amplitude_rad_s: f32, frequency_hz: f32| {
            let mut detectors = Detectors::in_flight();
            let mut last = vec![];
            for k in 0..400 {
                // The phase keeps 50 Hz away from its zeros.
                let phase = core::f32::consts::TAU * frequency_hz * 0.01 * k as f32 + 1.57;
                let rates = Some([0.0, amplitude_rad_s * libm::sinf(phase), 0.3]);
                last = found(|c| detectors.imu(rates, PERIOD_US, &limits, c)).1;
            }
            (detectors.vibration, last == [C::Vibrating])
        };
        let (square, vibrates) = shaken(1.0, 25.0);
        assert!((square - 2.0).abs() < 0.1 && !vibrates, "{square}");
        assert!(shaken(1.1, 50.0).1 && !shaken(0.9, 50.0).1);
        assert!(!shaken(5.0, 5.0).1, "a craft that rolls");
    }

    /// Every tick, every other, every third: rates are compared after a tenth of a second; and not for
    /// as long after a pose that was lost, late or early.
    #[test]
    fn rates_are_compared_where_poses_come_evenly() {
        for every in 1..=3 {
            let mut rhythm = Rhythm::default();
            let mut from = |ticks: std::ops::Range<u32>| -> Vec<bool> {
                ticks.map(|tick| rhythm.tick(tick % every == 0)).collect()
            };
            assert!(from(0..40)[20..].iter().all(|worth| *worth), "{every}");
        }
        let mut rhythm = Rhythm::default();
        (0..40).for_each(|_| _ = rhythm.tick(true));
        assert!(rhythm.tick(false), "nothing came, so nothing is wrong yet");
        let worth: Vec<bool> = (0..30).map(|_| rhythm.tick(true)).collect();
        assert_eq!(worth.iter().position(|worth| *worth), Some(usize::from(FORGOTTEN) + 1));
        let mut detectors = Detectors::in_flight();
        let evenly: Vec<bool> = (0..30).map(|_| detectors.poses_come_evenly(true)).collect();
        assert_eq!(evenly.iter().position(|evenly| *evenly), Some(usize::from(FORGOTTEN)));
    }

    #[test]
    fn a_gyro_that_contradicts_the_poses_is_noticed_and_one_wild_sample_is_not() {
        let limits = limits();
        let mut detectors = Detectors { imu_comparable: true, ..Detectors::in_flight() };
        detectors.compare_rates([1e6, 0.0, 0.0], [0.0; 3], &limits);
        assert!(!detectors.imu_disagrees);
        let ticks = (1..100).find(|_| {
            detectors.compare_rates([2.0, 0.0, 0.0], [0.0; 3], &limits);
            detectors.imu_disagrees
        });
        // 2 rad/s smoothed over 20 ticks passes 1.2 rad/s after 20 ln(2.0 / 0.8) = 18, the wild
        // sample's 0.117 rad/s sooner.
        assert!(ticks.is_some_and(|ticks| (16..=18).contains(&ticks)), "{ticks:?}");
    }

    #[test]
    fn each_axis_of_the_gyro_is_compared_with_its_own() {
        let limits = limits();
        let (most, gain) = (limits.disagreement_rad_s, limits.disagreement_gain);
        let after = |difference_rad_s, gyro_rad_s, tracked_rad_s| {
            let mut detectors =
                Detectors { imu_comparable: true, difference_rad_s, ..Detectors::in_flight() };
            detectors.compare_rates(gyro_rad_s, tracked_rad_s, &limits);
            (detectors.difference_rad_s, detectors.imu_disagrees)
        };
        assert_eq!(after([0.0; 3], [1.0, -2.0, 3.0], [1.0, -2.0, 3.0]), ([0.0; 3], false));
        for axis in 0..3 {
            let about = |rate: f32| core::array::from_fn(|k| if k == axis { rate } else { 0.0 });
            assert_eq!(after([0.0; 3], about(0.5), about(-0.25)), (about(gain * 0.75), false));
            // A wild sample counts as twice the limit, one that is no number as none.
            assert_eq!(after([0.0; 3], about(1e6), [0.0; 3]), (about(gain * (2.0 * most)), false));
            assert_eq!(after([0.0; 3], about(-1e6), [0.0; 3]), (about(gain * (-2.0 * most)), false));
            assert_eq!(after([0.0; 3], about(f32::NAN), [0.0; 3]), ([0.0; 3], false));
            // At the limit they agree.
            assert_eq!(after(about(-most), about(-most), [0.0; 3]), (about(-most), false));
            let beyond = most.next_up();
            assert_eq!(after(about(beyond), about(beyond), [0.0; 3]), (about(beyond), true));
        }
        let mut silent = Detectors { imu_comparable: false, ..Detectors::in_flight() };
        (0..1000).for_each(|_| silent.compare_rates([30.0; 3], [0.0; 3], &limits));
        assert!(!silent.imu_disagrees, "there was nothing to compare");
    }

    #[test]
    fn values_are_bounded_on_either_side() {
        assert_eq!(bounded([3.0, -3.0, f32::NAN], 2.0), [2.0, -2.0, 0.0]);
        assert_eq!(bounded([1.5, -1.5, 0.0], 2.0), [1.5, -1.5, 0.0]);
    }

    #[test]
    fn half_of_the_lost_time_that_is_allowed_is_on_time() {
        let limits = limits();
        let on_time = |debt_us| Detectors { debt_us, ..Detectors::in_flight() }.on_time(&limits);
        assert!(on_time(0) && on_time(50_000) && !on_time(50_001));
    }

    #[test]
    fn a_craft_in_flight_was_inside_and_one_that_boots_nobody_knows() {
        assert!(Detectors::in_flight().is_inside() && !Detectors::at_rest().is_inside());
    }

    /// 60 degrees for 0.3 s by the table, about either axis and about both.
    #[test]
    fn a_tilt_counts_beyond_its_limit_and_after_its_time_only() {
        let limits = limits();
        let first = |attitude_rad: [f32; 3], ticks: u32| {
            let mut detectors = Detectors::in_flight();
            (1..=ticks)
                .find(|_| found(|c| detectors.tilt(attitude_rad, PERIOD_US, &limits, c)).1 == [C::Tilted])
        };
        let degrees = |roll: f32, pitch: f32| [roll.to_radians(), pitch.to_radians(), 2.0];
        // cos tilt = cos roll cos pitch: 45 degrees of both are 60 of tilt.
        for attitude_rad in [degrees(59.9, 0.0), degrees(0.0, -59.9), degrees(-44.9, 44.9)] {
            assert_eq!(first(attitude_rad, if cfg!(miri) { 100 } else { 100_000 }), None, "{attitude_rad:?}");
        }
        for attitude_rad in
            [degrees(-60.1, 0.0), degrees(0.0, 60.1), degrees(45.1, -45.1), degrees(180.0, 0.0)]
        {
            assert_eq!(first(attitude_rad, 100), Some(30), "{attitude_rad:?}");
        }
        assert_eq!(first([f32::NAN, 0.0, 0.0], 100), Some(30), "what is no number is no good attitude");
    }

    #[test]
    fn a_sag_is_no_empty_battery_and_a_voltage_that_is_no_number_is() {
        let mut config = Config::thesis();
        config.supervision.battery = BatteryLevels { for_s: 0.05, ..BatteryLevels::THREE_CELLS };
        let limits = Limits::new(&config);
        let mut detectors = Detectors::in_flight();
        let mut voltage = |volts| found(|c| detectors.battery(volts, PERIOD_US, &limits, c)).1;
        (0..4).for_each(|_| assert_eq!(voltage(9.0), []));
        assert_eq!(voltage(11.0), []);
        (0..4).for_each(|_| assert_eq!(voltage(10.5), []));
        assert_eq!(voltage(10.5), [C::BatteryLow]);
        (0..4).for_each(|_| assert_eq!(voltage(f32::NAN), [C::BatteryLow]));
        assert_eq!(voltage(f32::NAN), [C::BatteryLow, C::BatteryCritical, C::BatteryEmpty]);
        assert_eq!(voltage(12.0), []);
    }
}

/// The clock from every residue of 2^32 with a boundary, every 7th time between two ticks up to 2.1 s and those about its boundaries,
/// every 4,099th of all others (at night, every one), and lost time about its boundaries: against wide integers.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::config::gains::Config;
    use crate::residues::{residues, stride};

    /// What a tick after `elapsed` us does to `debt` us of lost time: the time that counts, the lost time
    /// after it, whether it was a leap, late, and whether there is too much of it.
    fn by_words(elapsed: i128, debt: i128, limits: &Limits) -> (i128, i128, [bool; 3]) {
        let [period, jump, most] = [limits.period_us, limits.jump_us, limits.overrun_us].map(i128::from);
        if elapsed == 0 || elapsed > jump {
            return (period, debt, [true, false, false]);
        }
        let late = elapsed > period + period / 2;
        let made_up = if late { debt + elapsed - period } else { debt - period / 10 };
        // A tick in time, and none lost, or one that comes early.
        let debt = made_up.clamp(0, i128::from(u32::MAX));
        (elapsed, debt, [false, late, debt >= most])
    }

    fn check(last_us: u32, elapsed_us: u32, debt_us: u32, limits: &Limits) {
        let mut detectors = Detectors { last_us: Some(last_us), debt_us, ..Detectors::in_flight() };
        let mut found = Conditions::NONE;
        let now = i128::from(last_us) + i128::from(elapsed_us);
        let counted = detectors.clock(now as u32, limits, &mut found);
        let (elapsed, debt, [leap, late, overrun]) = by_words(elapsed_us.into(), debt_us.into(), limits);
        let Counters { overruns, clock_jumps, .. } = detectors.counters;
        let about = || format!("{elapsed_us} us after {last_us}, {debt_us} us lost");
        assert_eq!((i128::from(counted), i128::from(detectors.debt_us)), (elapsed, debt), "{}", about());
        assert_eq!((clock_jumps, overruns), (leap.into(), late.into()), "{}", about());
        assert_eq!(found.has(Condition::ClockJumped), leap, "{}", about());
        assert_eq!(found.has(Condition::LoopOverrun), overrun, "{}", about());
    }

    #[test]
    fn time_between_ticks_is_counted_as_it_passes() {
        let mut config = Config::thesis();
        // The least, the thesis' and the greatest period that is allowed, and an odd one.
        for sample_time_s in [0.0001, 0.002_001, 0.01, 0.1] {
            config.sample_time_s = sample_time_s;
            let limits = Limits::new(&config);
            let debts =
                [0, 1, limits.period_us, limits.overrun_us - 1, limits.overrun_us, u32::MAX - 1, u32::MAX];
            let boundaries = [limits.period_us / 2, 3 * limits.period_us / 2, limits.jump_us];
            let about = boundaries.into_iter().flat_map(|us| us - 2..=us + 2);
            for elapsed_us in (0..2_100_000).step_by(stride(7)).chain(about) {
                check(u32::MAX - 10_000, elapsed_us, 0, &limits);
            }
            for last_us in residues() {
                for elapsed_us in residues().into_iter().chain([limits.period_us, 3 * limits.period_us / 2]) {
                    debts.iter().for_each(|debt_us| check(last_us, elapsed_us, *debt_us, &limits));
                }
            }
        }
        let limits = Limits::new(&Config::thesis());
        for elapsed_us in (0..=u32::MAX).step_by(stride(4099)) {
            check(7, elapsed_us, 1000, &limits);
        }
    }

    #[test]
    fn counts_stay_at_the_greatest_number() {
        for number in residues() {
            let mut counter = number;
            count(&mut counter);
            assert_eq!(u64::from(counter), (u64::from(number) + 1).min(u32::MAX.into()));
        }
    }
}
