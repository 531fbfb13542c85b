//! What only the outcome of a tick shows, for the next one: loss of thrust or of a motor, a crash, a
//! result that is not a number.

use crate::safety::conditions::{Condition, Conditions};
use crate::safety::limits::Limits;
use crate::safety::plausibility::tilt_bound;
use crate::safety::timers::Held;

/// A craft tips over whose errors of roll and pitch add up to more, rad.
const TIPS_RAD: f32 = 0.5;

/// What the outcomes have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aftermath {
    thrust: Held,
    thrust_lost: bool,
    not_a_number: bool,
    /// One motor is at its end; and the craft tips over.
    motor: [Held; 2],
    motor_failed: bool,
    /// The motor that failed first, 0 to 3, until the pilot has taken note of it: a craft that was upset by one soon has another at
    /// its end.
    pub(crate) failed_motor: Option<u8>,
    crash: Held,
    crashed: bool,
}

impl Aftermath {
    /// Everything has been in order until now.
    pub(crate) const GOOD: Self = Self {
        thrust: Held::NOT,
        thrust_lost: false,
        not_a_number: false,
        motor: [Held::NOT; 2],
        motor_failed: false,
        failed_motor: None,
        crash: Held::NOT,
        crashed: false,
    };

    /// Reports what the end of the tick before has shown.
    #[inline]
    pub(crate) fn report(&self, conditions: &mut Conditions) {
        if self.thrust_lost | self.not_a_number | self.crashed | self.motor_failed {
            conditions.note(Condition::ThrustLost, self.thrust_lost);
            conditions.note(Condition::NotANumber, self.not_a_number);
            conditions.note(Condition::Crashed, self.crashed);
            conditions.note(Condition::MotorFailed, self.motor_failed);
        }
    }

    /// Looks for a single motor at its end in the commands of a tick that refused thrust upwards, or
    /// did not; attitude and errors of roll and pitch in rad.
    #[inline]
    pub(crate) fn motors(
        &mut self,
        refused: bool,
        pwm: [f32; 4],
        [attitude_rad, errors_rad]: [[f32; 3]; 2],
        elapsed_us: u32,
        limits: &Limits,
    ) {
        if refused {
            let is_level = tilt_bound(attitude_rad) < limits.level_rad;
            self.motor_at_end(pwm, is_level, errors_rad, elapsed_us, limits);
        } else {
            (self.motor, self.motor_failed) = ([Held::NOT; 2], false);
        }
    }

    #[cold]
    fn motor_at_end(
        &mut self,
        pwm: [f32; 4],
        is_level: bool,
        [roll_error, pitch_error, _]: [f32; 3],
        elapsed_us: u32,
        limits: &Limits,
    ) {
        let [a, b, c, d] = pwm;
        let [none, all] = limits.ends;
        let full = |command: f32| command >= all;
        let is_single = pwm.iter().filter(|command| full(**command)).count() == 1;
        // A craft that tips over a motor asks it for all, and the one across for nothing.
        let lost = |opposite: f32| is_single || opposite <= none;
        let motors = [(0, a, c), (1, b, d), (2, c, a), (3, d, b)];
        let found = motors.into_iter().find(|(_, command, opposite)| full(*command) && lost(*opposite));
        let tips = roll_error.abs() + pitch_error.abs() > TIPS_RAD;
        let [for_long, tipping] = &mut self.motor;
        // Held at a great tilt a craft may need all of one motor although nothing is wrong with it.
        let slowly = for_long.step(found.is_some() && is_level, elapsed_us, limits.motor_us);
        let fast = tipping.step(found.is_some() && tips, elapsed_us, limits.motor_us / 5 * 3);
        self.motor_failed = slowly || fast;
        if let (true, None, Some((motor, ..))) = (self.motor_failed, self.failed_motor, found) {
            self.failed_motor = Some(motor);
        }
    }

    /// Looks for a crash in the result of a tick: a craft that lies tilted, far from the attitude that it
    /// is to have, and does not turn. Attitude and errors of roll and pitch in rad, body rates in rad/s;
    /// in a tick with motors at idle errors and rates are 0.
    #[inline]
    pub(crate) fn turns(
        &mut self,
        [[roll, pitch, _], [roll_error, pitch_error, _]]: [[f32; 3]; 2],
        [p, q, r]: [f32; 3],
        elapsed_us: u32,
        limits: &Limits,
    ) {
        let [error_rad, rate_rad_s] = limits.crash;
        let far = roll_error.abs() + pitch_error.abs() > error_rad;
        // A level craft that is told to tilt and is slow to begin lies nowhere.
        let tilted = roll.abs() + pitch.abs() > error_rad;
        let lies = far && tilted && p.abs() + q.abs() + r.abs() < rate_rad_s;
        self.crashed = self.crash.step(lies, elapsed_us, limits.crash_us);
    }

    /// Looks at the result of a tick: thrust refused upwards, rate of inertial z in m/s, attitude
    /// in rad, a result that is not a number.
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;
    use Condition as C;

    const PERIOD_US: u32 = 10_000;

    fn limits() -> Limits {
        Limits::new(&Config::thesis())
    }

    fn reported(aftermath: &Aftermath) -> Vec<Condition> {
        let mut conditions = Conditions::NONE;
        aftermath.report(&mut conditions);
        conditions.iter().collect()
    }

    #[test]
    fn a_craft_that_is_far_from_its_attitude_and_does_not_turn_has_crashed() {
        let limits = limits();
        let crashed_at = |tilt_rad, error_rad: f32, rate_rad_s, ticks| {
            let mut aftermath = Aftermath::GOOD;
            for _ in 0..ticks {
                let attitude_rad = [tilt_rad, 0.0, 3.0];
                let errors_rad = [0.3, error_rad, 0.0];
                aftermath.turns([attitude_rad, errors_rad], [0.0, rate_rad_s, 0.1], PERIOD_US, &limits);
            }
            reported(&aftermath) == [C::Crashed]
        };
        assert!(!crashed_at(0.3, -0.2, 0.1, 100), "a level craft that is told to tilt");
        let crashed = |error_rad, rate_rad_s, ticks| crashed_at(0.5, error_rad, rate_rad_s, ticks);
        assert!(crashed(-0.2, 0.1, 30));
        assert!(!crashed(-0.2, 0.1, 29) && !crashed(0.05, 0.1, 100) && !crashed(-0.2, 0.6, 100));
        assert!(!crashed(f32::NAN, 0.1, 100), "what is no number is another condition");
    }

    /// Each by itself and with any others.
    #[test]
    fn every_set_of_outcomes_is_reported() {
        for set in 0..16_u8 {
            let [thrust_lost, not_a_number, crashed, motor_failed] = [1, 2, 4, 8].map(|bit| set & bit != 0);
            let aftermath = Aftermath { thrust_lost, not_a_number, crashed, motor_failed, ..Aftermath::GOOD };
            let outcomes = [
                (C::ThrustLost, thrust_lost),
                (C::NotANumber, not_a_number),
                (C::Crashed, crashed),
                (C::MotorFailed, motor_failed),
            ];
            let want = outcomes.into_iter().filter_map(|(condition, is_so)| is_so.then_some(condition));
            assert_eq!(reported(&aftermath), want.collect::<Vec<_>>(), "{set:04b}");
        }
    }

    /// Beyond a limit it counts, at the limit not; roll and pitch alike.
    #[test]
    fn what_is_at_a_limit_is_not_beyond_it() {
        let limits = limits();
        let [error_rad, rate_rad_s] = limits.crash;
        let (beyond, slow) = (error_rad.next_up(), rate_rad_s.next_down());
        let crashed = |tilt_rad: [f32; 3], errors_rad: [f32; 3], rates_rad_s: [f32; 3]| {
            let mut aftermath = Aftermath::GOOD;
            for _ in 0..100 {
                aftermath.turns([tilt_rad, errors_rad], rates_rad_s, PERIOD_US, &limits);
            }
            aftermath.crashed
        };
        for axis in 0..2 {
            let about = |angle_rad: f32| core::array::from_fn(|k| if k == axis { -angle_rad } else { 0.0 });
            assert!(crashed(about(beyond), about(beyond), [0.0; 3]));
            assert!(!crashed(about(error_rad), about(beyond), [0.0; 3]));
            assert!(!crashed(about(beyond), about(error_rad), [0.0; 3]));
        }
        for axis in 0..3 {
            let about = |rate_rad_s: f32| core::array::from_fn(|k| if k == axis { -rate_rad_s } else { 0.0 });
            assert!(crashed([beyond; 3], [beyond; 3], about(slow)));
            assert!(!crashed([beyond; 3], [beyond; 3], about(rate_rad_s)));
        }
        let lost = |sink_m_s: f32, roll_rad: f32| {
            let mut aftermath = Aftermath::GOOD;
            for _ in 0..100 {
                aftermath.after(true, sink_m_s, [roll_rad, 0.0, 0.0], false, PERIOD_US, &limits);
            }
            aftermath.thrust_lost
        };
        assert!(lost(limits.sink_m_s.next_up(), limits.level_rad.next_down()));
        assert!(!lost(limits.sink_m_s, 0.0) && !lost(1.0, limits.level_rad));
        let failed = |roll_rad: f32, errors_rad: [f32; 3]| {
            let mut aftermath = Aftermath::GOOD;
            let seen_rad = [[roll_rad, 0.0, 0.0], errors_rad];
            let pwm = [2000.0, 1700.0, 1700.0, 1700.0];
            (0..100).for_each(|_| aftermath.motors(true, pwm, seen_rad, PERIOD_US, &limits));
            aftermath.motor_failed
        };
        assert!(failed(limits.level_rad.next_down(), [0.0; 3]) && !failed(limits.level_rad, [0.0; 3]));
        assert!(failed(1.0, [-0.26, 0.25, 0.0]) && !failed(1.0, [-0.25, 0.25, 0.0]));
    }

    #[test]
    fn a_motor_alone_at_its_end_has_failed_and_is_named() {
        let limits = limits();
        let failed_at = |roll_rad, pwm, refused, error_rad, ticks| {
            let mut aftermath = Aftermath::GOOD;
            let seen_rad = [[roll_rad, 0.0, 0.0], [0.1, error_rad, 0.0]];
            (0..ticks).for_each(|_| aftermath.motors(refused, pwm, seen_rad, PERIOD_US, &limits));
            (reported(&aftermath) == [C::MotorFailed]).then_some(aftermath.failed_motor)
        };
        let failed = |pwm, refused, error_rad, ticks| failed_at(0.0, pwm, refused, error_rad, ticks);
        for motor in 0..4_u8 {
            let mut pwm = [1700.0; 4];
            pwm[usize::from(motor)] = 1999.9;
            assert_eq!(failed_at(0.5, pwm, true, 0.0, 100), None, "held at a tilt of 30 degrees");
            assert_eq!(failed_at(0.5, pwm, true, -0.5, 30), Some(Some(motor)), "and tips over it");
            assert_eq!(failed(pwm, true, 0.0, 50), Some(Some(motor)));
            assert_eq!((failed(pwm, true, 0.0, 49), failed(pwm, false, 0.0, 100)), (None, None));
            assert_eq!((failed(pwm, true, -0.5, 30), failed(pwm, true, -0.5, 29)), (Some(Some(motor)), None));
            let mut pwm = [2000.0; 4];
            pwm[usize::from(motor + 2) % 4] = 1000.0;
            assert_eq!(failed(pwm, true, 0.5, 30), Some(Some(motor)), "tips over it");
        }
        assert_eq!(
            failed([2000.0, 1700.0, 2000.0, 1700.0], true, 0.0, 100),
            None,
            "two: a battery, or a load"
        );
    }

    #[test]
    fn what_fails_after_the_first_motor_takes_its_name_away_from_nobody() {
        let (limits, mut aftermath) = (limits(), Aftermath::GOOD);
        for motor in [2_u8, 3] {
            let mut pwm = [1700.0; 4];
            pwm[usize::from(motor)] = 2000.0;
            (0..60).for_each(|_| aftermath.motors(true, pwm, [[0.0; 3]; 2], PERIOD_US, &limits));
            assert_eq!((aftermath.motor_failed, aftermath.failed_motor), (true, Some(2)));
            aftermath.motors(false, pwm, [[0.0; 3]; 2], PERIOD_US, &limits);
        }
    }

    /// Every set of motors at either end, level or not, tipping over or not: which one is named, if any.
    #[test]
    fn every_set_of_motors_at_their_ends() {
        let limits = limits();
        for set in (0..81_usize).step_by(if cfg!(miri) { 13 } else { 1 }) {
            let commands = [1000.0, 1500.0, 2000.0];
            let pwm: [f32; 4] = core::array::from_fn(|k| commands[set / 3_usize.pow(k as u32) % 3]);
            let full: Vec<usize> = (0..4).filter(|k| pwm[*k] == 2000.0).collect();
            let alone = |motor: &&usize| full.len() == 1 || pwm[(**motor + 2) % 4] == 1000.0;
            let want = full.iter().find(alone).map(|motor| *motor as u8);
            for (roll_rad, error_rad) in [(0.0, 0.0), (0.0, 0.6), (0.6, 0.0), (0.6, 0.6)] {
                let mut aftermath = Aftermath::GOOD;
                let seen_rad = [[roll_rad, 0.0, 0.0], [0.0, error_rad, 0.0]];
                (0..100).for_each(|_| aftermath.motors(true, pwm, seen_rad, PERIOD_US, &limits));
                let fails = roll_rad == 0.0 || error_rad > 0.0;
                assert_eq!(aftermath.failed_motor, want.filter(|_| fails), "{pwm:?} {seen_rad:?}");
            }
        }
    }

    #[test]
    fn thrust_is_lost_by_a_level_craft_that_sinks_and_nobody_else() {
        let limits = limits();
        let lost = |refused, sink_m_s, roll_rad| {
            let mut aftermath = Aftermath::GOOD;
            for _ in 0..40 {
                aftermath.after(refused, sink_m_s, [roll_rad, 0.0, 0.0], false, PERIOD_US, &limits);
            }
            !reported(&aftermath).is_empty()
        };
        assert!(lost(true, 0.3, 0.1));
        assert!(!lost(false, 0.3, 0.1) && !lost(true, 0.1, 0.1) && !lost(true, 0.3, 0.5));
        assert!(!lost(true, f32::NAN, 0.1));
    }
}
