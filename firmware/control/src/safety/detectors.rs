//! Detectors: from what comes in with each tick to a set of [`Conditions`].
//!
//! - Time passes by the difference between two ticks only, taken modulo 2^32; the [`timers`](crate::safety::timers) add it up.
//! - Comparisons are written so that NaN falls on the bad side.
//! - A pose that is frozen, jumped or not a number counts as one that did not come; the silence that follows does the rest.
//!
//! From when on something counts is the table [`Supervision`] of the gains file. What is done about a condition is the table in
//! [`state_machine`](crate::safety::state_machine).
//!
//! [`Supervision`]: crate::config::supervision_limits::Supervision

use crate::inputs::input_checks::magnitude;
use crate::inputs::readings::Pose;
use crate::safety::conditions::{Condition, Conditions};
use crate::safety::limits::Limits;
use crate::safety::plausibility::{differ, is_inside, is_pose, is_reachable, is_tilted_beyond, tilt_bound};
use crate::safety::timers::{Held, Silence};

/// How often something was refused, since the start. They stay at the greatest number.
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

/// What is known before a pose comes.
pub(crate) struct LastKnown<'a> {
    /// The last pose that could be flown with.
    pub(crate) last: &'a Pose,
    /// Where the craft has turned since then by the gyro, rad.
    pub(crate) attitude_rad: [f32; 3],
    /// Without it a pose may be anywhere.
    pub(crate) anchored: bool,
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
    /// A simulation begins with a line of equal poses: none of them is frozen.
    pose_settling: bool,
    /// Can the sample of this tick be compared with motion capture?
    imu_comparable: bool,
    imu_last: [f32; 3],
    imu_equal: u32,
    imu_missing: u32,
    imu_age_us: u32,
    /// Smoothed difference of gyro and motion capture, rad/s.
    difference_rad_s: [f32; 3],
    imu_disagrees: bool,
    battery: [Held; 3],
    battery_low: bool,
    tilt: Held,
    fence: Held,
    outside: bool,
    thrust: Held,
    thrust_lost: bool,
    not_a_number: bool,
    pub(crate) counters: Counters,
}

impl Detectors {
    /// Nothing has been heard yet.
    pub(crate) fn at_rest() -> Self {
        Self {
            last_us: None,
            debt_us: 0,
            link: Silence::NEVER,
            pose: Silence::NEVER,
            pose_repeats: 0,
            unheard_us: 0,
            pose_settling: false,
            imu_comparable: false,
            imu_last: [f32::NAN; 3],
            imu_equal: 0,
            imu_missing: u32::MAX,
            imu_age_us: u32::MAX,
            difference_rad_s: [0.0; 3],
            imu_disagrees: false,
            battery: [Held::default(); 3],
            battery_low: false,
            tilt: Held::default(),
            fence: Held::default(),
            outside: true,
            thrust: Held::default(),
            thrust_lost: false,
            not_a_number: false,
            counters: Counters::default(),
        }
    }

    /// Everything has been in good order until now.
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

    /// Time since the tick before in us, as far as it can be believed.
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

    /// A tick out of time, or one of those after it.
    #[cold]
    fn off_time(&mut self, elapsed_us: u32, limits: &Limits, conditions: &mut Conditions) -> u32 {
        let Limits { period_us, jump_us, overrun_us, .. } = *limits;
        // Backwards is a leap too: modulo 2^32 it is a long way forward. No two ticks are within one microsecond.
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

    /// Whether a command came.
    #[inline]
    pub(crate) fn link(&mut self, came: bool, elapsed_us: u32, limits: &Limits, conditions: &mut Conditions) {
        self.link.step(came, elapsed_us, &limits.link);
        if self.link.late {
            conditions.note(Condition::LinkLate, true);
            conditions.note(Condition::LinkLost, self.link.age_us >= limits.link.lost_us);
        }
    }

    /// Whether a pose came that can be flown with.
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
                // Refused poses add nothing: a tracker that has jumped is not believed for staying there.
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
            self.doubtful(pose != last, plausible, limits, conditions)
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

    /// How far from the last good pose the craft may be, m.
    #[cold]
    fn reach_m(&self, limits: &Limits) -> f32 {
        limits.jump_m + limits.speed_m_per_us * self.unheard_us as f32
    }

    /// A pose that came again unchanged, or one that cannot be true.
    #[cold]
    fn doubtful(&mut self, new: bool, plausible: bool, limits: &Limits, conditions: &mut Conditions) -> bool {
        self.pose_repeats = if new { 0 } else { self.pose_repeats.saturating_add(1) };
        let frozen = self.pose_repeats >= limits.pose_repeats && !self.pose_settling;

        conditions.note(Condition::PoseFrozen, frozen);
        conditions.note(Condition::PoseJumped, !plausible);
        let good = plausible && !frozen;
        if !good {
            count(&mut self.counters.poses_refused);
        }
        good
    }

    /// The gyro's sample, if it can be used.
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
                self.imu_last = rates;
                (self.imu_equal, self.imu_missing, self.imu_age_us) = (1, 0, 0);
                self.imu_comparable = true;
                return gyro_rad_s;
            }
        }
        self.imu_in_doubt(gyro_rad_s, elapsed_us, limits, conditions)
    }

    /// No sample, no plausible one, or the same again.
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

    /// The voltage.
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

    /// The attitude in rad as it is flown with.
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

    /// What the tick before has left.
    #[inline]
    pub(crate) fn aftermath(&mut self, conditions: &mut Conditions) {
        if self.thrust_lost || self.not_a_number {
            conditions.note(Condition::ThrustLost, self.thrust_lost);
            conditions.note(Condition::NotANumber, self.not_a_number);
        }
    }

    /// Body rates by gyro and by motion capture, rad/s.
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
            // One wild sample counts for no more than a wrong one.
            difference = bounded(difference, bound_rad_s);
        }
        let mut sum = 0.0;
        for (smooth, difference) in self.difference_rad_s.iter_mut().zip(difference) {
            *smooth += limits.disagreement_gain * (difference - *smooth);
            sum += smooth.abs();
        }
        self.imu_disagrees = sum > limits.disagreement_rad_s;
    }

    /// How the tick went: thrust refused upwards, rate of inertial z in m/s, roll and pitch, a result that is no number.
    #[inline]
    pub(crate) fn after(
        &mut self,
        refused: bool,
        z_rate_m_s: f32,
        attitude_rad: [f32; 3],
        not_a_number: bool,
        elapsed_us: u32,
        limits: &Limits,
    ) {
        let sinks = refused && z_rate_m_s > limits.sink_m_s && tilt_bound(attitude_rad) < limits.level_rad;
        self.thrust_lost = self.thrust.step(sinks, elapsed_us, limits.thrust_us);
        self.not_a_number = not_a_number;
    }

    /// Do clock and loop keep time?
    pub(crate) fn on_time(&self, limits: &Limits) -> bool {
        self.debt_us <= limits.overrun_us / 2
    }

    /// Is the craft inside the box, by the last pose?
    pub(crate) fn is_inside(&self) -> bool {
        !self.outside
    }
}

/// Each value, but not beyond the limit to either side; 0 for what is no number.
#[cold]
fn bounded(values: [f32; 3], limit: f32) -> [f32; 3] {
    // Not `clamp`, which panics where the limit is no number.
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
