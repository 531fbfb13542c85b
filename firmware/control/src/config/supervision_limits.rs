//! Supervision limits: from when on something counts as wrong in flight, the `[supervision]` table
//! of the gains file.
//!
//! Every key has a default, so files from before there was a supervisor still read. Times and
//! angles are what other autopilots fly with, made shorter for a cage: 0.5 s without a command and
//! 60 degrees for 0.3 s as in PX4 and Crazyflie's firmware, 2 s to motors off as in Crazyflie's, a
//! thrust loss detected within a second as in ArduPilot (sooner: the thesis' law has no priority of
//! attitude over thrust and keeps a saturated craft level for about a second only). Battery levels
//! belong to a pack, so there is no default that guesses one: without levels the voltage is not
//! judged, unless the craft's own configuration says how many cells it carries.

use serde::{Deserialize, Serialize};

use crate::config::error::ConfigError;
use crate::config::range_check::RangeCheck;

/// When the supervisor steps in: the whole table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Supervision {
    /// Command frames.
    pub link: LinkLimits,
    /// Poses from motion capture.
    pub pose: PoseLimits,
    /// Gyro.
    pub imu: ImuLimits,
    /// Voltage levels.
    pub battery: BatteryLevels,
    /// Tilt.
    pub tilt: TiltLimits,
    /// The box that must not be left.
    pub fence: Fence,
    /// Loss of thrust.
    pub thrust: ThrustLossLimits,
    /// Clock and loop.
    pub timing: TimingLimits,
    /// Motor outputs.
    pub outputs: OutputLimits,
    /// Waiting for the take-off.
    pub armed: ArmedLimits,
    /// Crash.
    pub crash: CrashLimits,
    /// Loss of a motor.
    pub motor: MotorLimits,
    /// How a landing goes.
    pub landing: Landing,
}

/// Command frames from the ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinkLimits {
    /// Hold after this many s without a good frame.
    pub hold_after_s: f64,
    /// Land after this many s without a good frame.
    pub land_after_s: f64,
    /// A lost link counts again after this many s of good frames.
    pub good_for_s: f64,
}

/// Poses from motion capture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseLimits {
    /// Coast for this many s without a good pose: position held, attitude carried on by the gyro.
    /// Then: level, and hold.
    pub coast_s: f64,
    /// Land after this many s without a good pose.
    pub land_after_s: f64,
    /// Motors off after this many s without a good pose.
    pub cut_after_s: f64,
    /// Missing poses count again after this many s of good ones.
    pub good_for_s: f64,
    /// A pose that was taken more than this many s ago is refused.
    pub oldest_s: f64,
    /// A pose is frozen after this many samples equal to its first.
    pub repeats: u32,
    /// A pose farther from the last than this many m ...
    pub jump_m: f64,
    /// ... plus this many m/s times the time between them is refused.
    pub speed_m_s: f64,
    /// So is one turned by more than this many rad about an axis.
    pub jump_rad: f64,
    /// Refused poses that agree with each other, and with the attitude by the gyro, count after this
    /// many s of them: the tracker has found the craft again, or was moved. Never before the craft
    /// ceases to coast.
    pub believed_after_s: f64,
}

/// Gyro.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImuLimits {
    /// This many ticks without a sample are a fault.
    pub missing_ticks: u32,
    /// A sample that comes unchanged this many times is a fault.
    pub repeats: u32,
    /// Motors off after this many s without a usable sample, where the law uses the gyro or there
    /// are no poses either.
    pub cut_after_s: f64,
    /// Rates beyond this many rad/s are refused (2000 degrees/s is the range of the usual chips).
    pub rate_limit_rad_s: f64,
    /// Greatest vibration in rad/s: root mean square of what changes from sample to sample, the
    /// axes added. At 100 Hz a body hardly moves above 5 Hz; what the chip's own filter lets pass of
    /// the rotors' 100 Hz comes folded down to anything below 50 Hz.
    pub vibration_rad_s: f64,
    /// Time constant of that mean in s.
    pub vibration_filter_s: f64,
    /// Greatest difference to the rates from motion capture in rad/s, after smoothing (added over
    /// the axes).
    pub disagreement_rad_s: f64,
    /// Time constant of that smoothing in s. It must be longer than the delay of the poses.
    pub disagreement_filter_s: f64,
}

/// Voltage levels in V; 0 is no level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BatteryLevels {
    /// Below it the craft cannot be armed, and warns.
    pub warn_v: f64,
    /// Below it the craft lands.
    pub land_v: f64,
    /// Below it the craft lands fast.
    pub empty_v: f64,
    /// A level counts once the voltage has been below it for this many s: a sag in a climb is no
    /// empty battery.
    pub for_s: f64,
}

/// Tilt.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TiltLimits {
    /// Greatest angle between the body's and the inertial z axis in rad.
    pub limit_rad: f64,
    /// How long it has to last before it counts, in s.
    pub for_s: f64,
    /// Greatest such angle at which the craft may be armed, in rad.
    pub arming_rad: f64,
}

/// The box that must not be left, inertial NED in m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fence {
    /// Least and greatest x in m.
    pub x_m: [f64; 2],
    /// Least and greatest y in m.
    pub y_m: [f64; 2],
    /// Least and greatest z in m, down positive.
    pub z_m: [f64; 2],
    /// How long it has to last before it counts, in s.
    pub for_s: f64,
}

/// Loss of thrust: the motors refuse thrust while the craft is level and sinks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThrustLossLimits {
    /// How long it has to last before it counts, in s.
    pub for_s: f64,
    /// Sinking is faster than this many m/s.
    pub sink_m_s: f64,
    /// Level is a roll and a pitch that add up to less than this many rad.
    pub level_rad: f64,
}

/// Clock and loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TimingLimits {
    /// Two ticks farther apart than this many s, or out of order, mean that the clock is wrong.
    pub jump_s: f64,
    /// This many s lost to late ticks are an overrun; each tick in time makes up for a tenth of a
    /// period.
    pub overrun_s: f64,
}

/// Motor outputs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputLimits {
    /// Land after this many s in which the outputs did not take the commands.
    pub land_after_s: f64,
}

/// Waiting for the take-off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmedLimits {
    /// A craft that is armed for this many s and does not fly is disarmed.
    pub idle_for_s: f64,
}

/// Crash: the attitude is far from the one that is flown, and the craft does not turn towards it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CrashLimits {
    /// Far is errors of roll and pitch that add up to more than this many rad.
    pub error_rad: f64,
    /// Body rates that add up to less than this many rad/s are no turn.
    pub rate_rad_s: f64,
    /// How long it has to last before it counts, in s.
    pub for_s: f64,
}

/// Loss of a motor: it is at its greatest command, and either no other is, or the one across is at
/// its least.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotorLimits {
    /// How long it has to last before it counts, in s: in hard flight any motor is at its end for up
    /// to 0.43 s. Three fifths of it while the craft tips over.
    pub for_s: f64,
}

/// How a landing goes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Landing {
    /// Rate of descent in m/s.
    pub descent_m_s: f64,
    /// Rate of descent with an empty battery in m/s.
    pub fast_descent_m_s: f64,
    /// Without poses the height is unknown: the altitude loop sees a height that is too great by
    /// this many m, and so gives less thrust than carries the craft.
    pub blind_offset_m: f64,
    /// A landing craft that no longer sinks although its motors carry less than it weighs stands
    /// on something. It counts as landed after [`Landing::touchdown_s`] this many m above the lowest
    /// height that may be commanded, and anywhere else (on a table) after three times as long.
    pub touchdown_m: f64,
    /// So many s of that.
    pub touchdown_s: f64,
    /// "Less" is this fraction of what the motor commands were above idle in flight.
    pub touchdown_fraction: f64,
}

impl Fence {
    /// A box too large to leave.
    pub const NONE: Self = Self { x_m: [-1e5, 1e5], y_m: [-1e5, 1e5], z_m: [-1e5, 1e5], for_s: 0.2 };
}

impl BatteryLevels {
    /// No levels.
    pub const NONE: Self = Self { warn_v: 0.0, land_v: 0.0, empty_v: 0.0, for_s: 1.0 };
    /// A lithium-polymer pack of three cells in flight, when 15, 7 and 5 % are left: 3.7, 3.6 and
    /// 3.5 V a cell at rest, less the half volt that hovering draws it down.
    pub const THREE_CELLS: Self = Self { warn_v: 10.6, land_v: 10.3, empty_v: 10.0, for_s: 1.0 };

    /// The same three stages for a pack of so many cells.
    pub fn of_cells(cells: u8) -> Self {
        let Self { warn_v, land_v, empty_v, for_s } = Self::THREE_CELLS;
        let packs = f64::from(cells) / 3.0;
        Self { warn_v: packs * warn_v, land_v: packs * land_v, empty_v: packs * empty_v, for_s }
    }

    /// Is there any level to land at?
    pub fn are_given(&self) -> bool {
        self.land_v > 0.0
    }
}

impl Supervision {
    /// The defaults: a cage of 7.6 m x 5.2 m and 2.8 m (thesis chapter 3) less a margin of 0.4 m,
    /// and no battery levels.
    pub const DEFAULT: Self = Self {
        link: LinkLimits { hold_after_s: 0.5, land_after_s: 1.9, good_for_s: 0.5 },
        pose: PoseLimits {
            coast_s: 0.05,
            land_after_s: 0.4,
            cut_after_s: 1.9,
            good_for_s: 0.1,
            oldest_s: 0.15,
            repeats: 3,
            jump_m: 0.5,
            speed_m_s: 3.0,
            jump_rad: 1.0,
            believed_after_s: 0.1,
        },
        imu: ImuLimits {
            missing_ticks: 3,
            repeats: 10,
            cut_after_s: 0.18,
            rate_limit_rad_s: 35.0,
            vibration_rad_s: 1.0,
            vibration_filter_s: 0.5,
            disagreement_rad_s: 1.2,
            disagreement_filter_s: 0.2,
        },
        battery: BatteryLevels::NONE,
        tilt: TiltLimits { limit_rad: core::f64::consts::FRAC_PI_3, for_s: 0.3, arming_rad: 0.2 },
        fence: Fence { x_m: [-3.4, 3.4], y_m: [-2.2, 2.2], z_m: [-2.6, 0.5], for_s: 0.2 },
        thrust: ThrustLossLimits { for_s: 0.4, sink_m_s: 0.2, level_rad: 0.35 },
        timing: TimingLimits { jump_s: 1.0, overrun_s: 0.1 },
        outputs: OutputLimits { land_after_s: 0.05 },
        armed: ArmedLimits { idle_for_s: 10.0 },
        crash: CrashLimits { error_rad: 0.4, rate_rad_s: 0.6, for_s: 0.3 },
        motor: MotorLimits { for_s: 0.5 },
        landing: Landing {
            descent_m_s: 0.3,
            fast_descent_m_s: 0.6,
            blind_offset_m: 0.06,
            touchdown_m: 0.1,
            touchdown_s: 0.3,
            touchdown_fraction: 0.7,
        },
    };

    /// Checks every limit: the first that cannot be flown with, by name.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        self.check_times()?;
        self.check_order_of_times()?;
        self.check_streams()?;
        self.check_flight()
    }

    /// No time is longer than a minute: a timer in microseconds counts to 71 of them.
    fn check_times(&self) -> Result<(), ConfigError> {
        let Self {
            link,
            pose,
            imu,
            battery,
            tilt,
            fence,
            thrust,
            timing,
            outputs,
            armed,
            crash,
            motor,
            landing,
        } = self;
        let times = [
            ("supervision.link", "hold_after_s", link.hold_after_s),
            ("supervision.link", "land_after_s", link.land_after_s),
            ("supervision.link", "good_for_s", link.good_for_s),
            ("supervision.pose", "coast_s", pose.coast_s),
            ("supervision.pose", "land_after_s", pose.land_after_s),
            ("supervision.pose", "cut_after_s", pose.cut_after_s),
            ("supervision.pose", "good_for_s", pose.good_for_s),
            ("supervision.pose", "oldest_s", pose.oldest_s),
            ("supervision.pose", "believed_after_s", pose.believed_after_s),
            ("supervision.imu", "cut_after_s", imu.cut_after_s),
            ("supervision.battery", "for_s", battery.for_s),
            ("supervision.tilt", "for_s", tilt.for_s),
            ("supervision.fence", "for_s", fence.for_s),
            ("supervision.thrust", "for_s", thrust.for_s),
            ("supervision.timing", "jump_s", timing.jump_s),
            ("supervision.timing", "overrun_s", timing.overrun_s),
            ("supervision.outputs", "land_after_s", outputs.land_after_s),
            ("supervision.armed", "idle_for_s", armed.idle_for_s),
            ("supervision.crash", "for_s", crash.for_s),
            ("supervision.motor", "for_s", motor.for_s),
            ("supervision.landing", "touchdown_s", landing.touchdown_s),
        ];
        times
            .into_iter()
            .try_for_each(|(group, name, time_s)| RangeCheck { group }.within(name, time_s, 0.0, LONGEST_S))
    }

    /// A milder reaction never comes after a more severe one.
    fn check_order_of_times(&self) -> Result<(), ConfigError> {
        let Self { link, pose, .. } = self;
        let order = |group, name, low, high| RangeCheck { group }.within(name, high, low, LONGEST_S);
        order("supervision.link", "land_after_s", link.hold_after_s, link.land_after_s)?;
        order("supervision.pose", "land_after_s", pose.coast_s, pose.land_after_s)?;
        order("supervision.pose", "cut_after_s", pose.land_after_s, pose.cut_after_s)
    }

    /// What comes in: poses, gyro, voltage.
    fn check_streams(&self) -> Result<(), ConfigError> {
        let Self { pose, imu, battery, .. } = self;
        let check = RangeCheck { group: "supervision.pose" };
        check.within("repeats", f64::from(pose.repeats), 1.0, 1e6)?;
        check.within("jump_m", pose.jump_m, 1e-3, 1e5)?;
        check.within("speed_m_s", pose.speed_m_s, 0.0, 1e4)?;
        check.within("jump_rad", pose.jump_rad, 1e-3, 10.0)?;
        let check = RangeCheck { group: "supervision.imu" };
        check.within("missing_ticks", f64::from(imu.missing_ticks), 1.0, 1e6)?;
        check.within("repeats", f64::from(imu.repeats), 1.0, 1e6)?;
        check.within("rate_limit_rad_s", imu.rate_limit_rad_s, 1e-2, 1e4)?;
        check.within("vibration_rad_s", imu.vibration_rad_s, 1e-3, 1e4)?;
        check.within("vibration_filter_s", imu.vibration_filter_s, 1e-3, LONGEST_S)?;
        check.within("disagreement_rad_s", imu.disagreement_rad_s, 1e-3, 1e4)?;
        check.within("disagreement_filter_s", imu.disagreement_filter_s, 1e-3, LONGEST_S)?;
        let check = RangeCheck { group: "supervision.battery" };
        check.within("warn_v", battery.warn_v, 0.0, 1e3)?;
        check.within("land_v", battery.land_v, 0.0, battery.warn_v)?;
        check.within("empty_v", battery.empty_v, 0.0, battery.land_v)
    }

    /// What the craft does: tilt, place, sinking, landing.
    fn check_flight(&self) -> Result<(), ConfigError> {
        let Self { tilt, fence, thrust, crash, landing, .. } = self;
        let check = RangeCheck { group: "supervision.tilt" };
        check.within("limit_rad", tilt.limit_rad, 0.1, core::f64::consts::PI)?;
        check.within("arming_rad", tilt.arming_rad, 0.01, core::f64::consts::PI)?;
        let check = RangeCheck { group: "supervision.fence" };
        check.range("x_m", fence.x_m)?;
        check.range("y_m", fence.y_m)?;
        check.range("z_m", fence.z_m)?;
        let check = RangeCheck { group: "supervision.thrust" };
        check.within("sink_m_s", thrust.sink_m_s, 0.0, 100.0)?;
        check.within("level_rad", thrust.level_rad, 0.01, core::f64::consts::PI)?;
        let check = RangeCheck { group: "supervision.crash" };
        check.within("error_rad", crash.error_rad, 0.05, 10.0)?;
        check.within("rate_rad_s", crash.rate_rad_s, 0.01, 100.0)?;
        let check = RangeCheck { group: "supervision.landing" };
        check.within("descent_m_s", landing.descent_m_s, 0.01, 10.0)?;
        check.within("fast_descent_m_s", landing.fast_descent_m_s, 0.01, 10.0)?;
        check.within("blind_offset_m", landing.blind_offset_m, 0.0, 1.0)?;
        check.within("touchdown_m", landing.touchdown_m, 0.0, 1.0)?;
        check.within("touchdown_fraction", landing.touchdown_fraction, 0.1, 0.9)
    }
}

/// No time in the table is longer, in s.
const LONGEST_S: f64 = 60.0;

macro_rules! defaults {
    ($($table:ident: $field:ident),*) => {$(
        impl Default for $table {
            fn default() -> Self {
                Supervision::DEFAULT.$field
            }
        }
    )*};
}

defaults!(
    LinkLimits: link,
    PoseLimits: pose,
    ImuLimits: imu,
    BatteryLevels: battery,
    TiltLimits: tilt,
    Fence: fence,
    ThrustLossLimits: thrust,
    TimingLimits: timing,
    OutputLimits: outputs,
    ArmedLimits: armed,
    CrashLimits: crash,
    MotorLimits: motor,
    Landing: landing
);

impl Default for Supervision {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(change: impl FnOnce(&mut Supervision)) -> String {
        let mut limits = Supervision::DEFAULT;
        change(&mut limits);
        limits.check().map_or_else(|error| error.to_string(), |()| "good".into())
    }

    #[test]
    fn the_defaults_can_be_flown_with() {
        assert_eq!(message(|_| ()), "good");
        assert_eq!(message(|s| s.fence = Fence::NONE), "good");
        for cells in 1..=14 {
            assert_eq!(message(|s| s.battery = BatteryLevels::of_cells(cells)), "good");
        }
        assert_eq!(BatteryLevels::of_cells(3), BatteryLevels::THREE_CELLS);
        assert!(!Supervision::DEFAULT.battery.are_given() && BatteryLevels::of_cells(1).are_given());
    }

    #[test]
    fn a_milder_reaction_comes_first() {
        assert_eq!(
            message(|s| s.link.land_after_s = 0.4),
            "supervision.link.land_after_s is 0.4: give a number from 0.5 to 60"
        );
        assert_eq!(
            message(|s| s.pose.land_after_s = 0.01),
            "supervision.pose.land_after_s is 0.01: give a number from 0.05 to 60"
        );
        assert!(message(|s| s.pose.cut_after_s = 0.3).starts_with("supervision.pose.cut_after_s is 0.3:"));
        assert!(message(|s| s.battery.land_v = 1.0).starts_with("supervision.battery.land_v is 1:"));
    }

    /// A timer in microseconds counts to 71 minutes; every time in the table is checked.
    #[test]
    fn no_time_is_longer_than_a_minute() {
        let times: [fn(&mut Supervision) -> &mut f64; 23] = [
            |s| &mut s.link.hold_after_s,
            |s| &mut s.link.land_after_s,
            |s| &mut s.link.good_for_s,
            |s| &mut s.pose.coast_s,
            |s| &mut s.pose.land_after_s,
            |s| &mut s.pose.cut_after_s,
            |s| &mut s.pose.good_for_s,
            |s| &mut s.pose.oldest_s,
            |s| &mut s.pose.believed_after_s,
            |s| &mut s.imu.cut_after_s,
            |s| &mut s.imu.disagreement_filter_s,
            |s| &mut s.imu.vibration_filter_s,
            |s| &mut s.battery.for_s,
            |s| &mut s.tilt.for_s,
            |s| &mut s.fence.for_s,
            |s| &mut s.thrust.for_s,
            |s| &mut s.timing.jump_s,
            |s| &mut s.timing.overrun_s,
            |s| &mut s.outputs.land_after_s,
            |s| &mut s.armed.idle_for_s,
            |s| &mut s.crash.for_s,
            |s| &mut s.motor.for_s,
            |s| &mut s.landing.touchdown_s,
        ];
        for (k, time) in times.into_iter().enumerate() {
            for bad in [60.1, -0.1, f64::NAN] {
                assert!(
                    message(|s| *time(s) = bad).contains(&format!("_s is {bad}:")),
                    "time {k} of {bad} s"
                );
            }
        }
    }
}
