//! The `[supervision]` table of the gains file in the units of flight: microseconds, f32, and what
//! a tick need not compute anew.

use crate::config::gains::{Config, Law};
use crate::config::supervision_limits::{Fence, Landing, Supervision};
use crate::inputs::input_checks::magnitude;

/// Seconds as the nearest microseconds; what does not fit is the greatest number.
fn micros(seconds: f64) -> u32 {
    libm::round(seconds * 1e6) as u32
}

/// When a silence is late, lost, and over, s.
fn silence(late_s: f64, lost_s: f64, good_s: f64) -> SilenceLimits {
    SilenceLimits { late_us: micros(late_s), lost_us: micros(lost_s), good_us: micros(good_s) }
}

/// Weight of the newest sample in a first-order smoothing.
fn smoothing(period_s: f64, time_constant_s: f64) -> f32 {
    (1.0 - libm::exp(-period_s / time_constant_s)) as f32
}

/// The three pairs of walls of a box.
fn sides(fence: &Fence) -> [[f64; 2]; 3] {
    [fence.x_m, fence.y_m, fence.z_m]
}

/// Least and greatest command, less what rounding and a map that is not exact leave of them.
fn ends([low, high]: [f64; 2]) -> [f32; 2] {
    let rest = 0.005 * (high - low);
    [(low + rest) as f32, (high - rest) as f32]
}

/// [`Supervision`] in the units of flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    pub(crate) period_us: u32,
    pub(crate) jump_us: u32,
    pub(crate) overrun_us: u32,
    pub(crate) link: SilenceLimits,
    pub(crate) pose: SilenceLimits,
    pub(crate) pose_cut_us: u32,
    pub(crate) pose_oldest_us: u32,
    pub(crate) pose_repeats: u32,
    pub(crate) jump_m: f32,
    pub(crate) speed_m_per_us: f32,
    pub(crate) jump_rad: f32,
    pub(crate) believed_us: u32,
    pub(crate) imu_missing_ticks: u32,
    pub(crate) imu_repeats: u32,
    pub(crate) imu_cut_us: u32,
    /// As a [`magnitude`].
    pub(crate) rate_limit: u32,
    /// Of second differences, which are four times what alternates from sample to sample, rad^2/s^2.
    pub(crate) vibration: f32,
    pub(crate) vibration_gain: f32,
    pub(crate) disagreement_rad_s: f32,
    pub(crate) disagreement_gain: f32,
    pub(crate) battery_v: [f32; 3],
    pub(crate) battery_us: u32,
    pub(crate) tilt_rad: f32,
    pub(crate) tilt_cosine: f32,
    pub(crate) tilt_us: u32,
    pub(crate) arming_tilt_rad: f32,
    pub(crate) fence_centre_m: [f32; 3],
    pub(crate) fence_half_m: [f32; 3],
    pub(crate) fence_us: u32,
    pub(crate) thrust_us: u32,
    pub(crate) sink_m_s: f32,
    pub(crate) level_rad: f32,
    pub(crate) outputs_us: u32,
    pub(crate) armed_us: u32,
    pub(crate) motor_us: u32,
    /// A motor command up to the first is none, from the second on all there is, command units.
    pub(crate) ends: [f32; 2],
    /// Error in rad, body rates in rad/s.
    pub(crate) crash: [f32; 2],
    pub(crate) crash_us: u32,
    pub(crate) touchdown: TouchdownLimits,
    pub(crate) hover: HoverLimits,
    pub(crate) uses_gyro: bool,
}

/// When a landing craft stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TouchdownLimits {
    /// Motor command at idle, command units.
    pub(crate) idle: f32,
    pub(crate) fraction: f32,
    /// Smoothing of the command in flight, over a second.
    pub(crate) smoothing: f32,
    /// It does not sink if it sinks, or rises, slower.
    pub(crate) still_m_s: f32,
    /// Inertial z of what counts as the floor, m.
    pub(crate) floor_m: f32,
    pub(crate) near_us: u32,
    pub(crate) anywhere_us: u32,
}

/// Gravity, m/s^2: what of it differs over the Earth is 0.5 % of a correction by a few percent.
pub(crate) const GRAVITY_M_S2: f32 = 9.81;

/// What the thrust that carries the craft is learned with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HoverLimits {
    /// The law's own, N or command units.
    pub(crate) model: f32,
    /// Weight of the newest sample: half a second is long against what noise and the loop do in
    /// moments, and short against a battery's fall.
    pub(crate) smoothing: f32,
    /// Fraction of correction for each m/s that z's rate is above its smoothed value; none for a law
    /// in command units.
    pub(crate) per_m_s: f32,
}

impl HoverLimits {
    /// Whether thrusts are in N, not in command units.
    #[inline]
    pub(crate) fn are_forces(&self) -> bool {
        self.per_m_s > 0.0
    }
}

/// When a silence matters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SilenceLimits {
    pub(crate) late_us: u32,
    pub(crate) lost_us: u32,
    pub(crate) good_us: u32,
}

impl TouchdownLimits {
    fn new(config: &Config, landing: &Landing) -> Self {
        let ([idle, _], [_, lowest_m]) = (config.command_range, config.position_limits.z_m);
        Self {
            idle: idle as f32,
            fraction: landing.touchdown_fraction as f32,
            smoothing: smoothing(config.sample_time_s, 1.0),
            still_m_s: (0.5 * landing.descent_m_s) as f32,
            floor_m: (lowest_m - landing.touchdown_m) as f32,
            near_us: micros(landing.touchdown_s),
            anywhere_us: micros(3.0 * landing.touchdown_s),
        }
    }
}

impl HoverLimits {
    fn new(config: &Config) -> Self {
        const MEMORY_S: f64 = 0.5;
        let (model, per_m_s) = match &config.law {
            Law::ModelBased(law) => (law.hover_thrust_n, 1.0 / (MEMORY_S * f64::from(GRAVITY_M_S2))),
            Law::HandTuned(law) => (law.hover_command, 0.0),
        };
        let smoothing = smoothing(config.sample_time_s, MEMORY_S);
        Self { model: model as f32, smoothing, per_m_s: per_m_s as f32 }
    }
}

impl Limits {
    pub(crate) fn new(config: &Config) -> Self {
        let Supervision {
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
        } = &config.supervision;
        Self {
            period_us: micros(config.sample_time_s),
            jump_us: micros(timing.jump_s),
            overrun_us: micros(timing.overrun_s),
            link: silence(link.hold_after_s, link.land_after_s, link.good_for_s),
            pose: silence(pose.coast_s, pose.land_after_s, pose.good_for_s),
            pose_cut_us: micros(pose.cut_after_s),
            pose_oldest_us: micros(pose.oldest_s),
            pose_repeats: pose.repeats,
            jump_m: pose.jump_m as f32,
            speed_m_per_us: (pose.speed_m_s * 1e-6) as f32,
            jump_rad: pose.jump_rad as f32,
            believed_us: micros(pose.believed_after_s.max(pose.coast_s)),
            imu_missing_ticks: imu.missing_ticks,
            imu_repeats: imu.repeats,
            imu_cut_us: micros(imu.cut_after_s),
            rate_limit: magnitude(imu.rate_limit_rad_s as f32),
            vibration: (16.0 * imu.vibration_rad_s * imu.vibration_rad_s) as f32,
            vibration_gain: smoothing(config.sample_time_s, imu.vibration_filter_s),
            disagreement_rad_s: imu.disagreement_rad_s as f32,
            disagreement_gain: smoothing(config.sample_time_s, imu.disagreement_filter_s),
            battery_v: [battery.warn_v as f32, battery.land_v as f32, battery.empty_v as f32],
            battery_us: micros(battery.for_s),
            tilt_rad: tilt.limit_rad as f32,
            tilt_cosine: libm::cos(tilt.limit_rad) as f32,
            tilt_us: micros(tilt.for_s),
            arming_tilt_rad: tilt.arming_rad as f32,
            fence_centre_m: sides(fence).map(|[low, high]| (0.5 * (low + high)) as f32),
            fence_half_m: sides(fence).map(|[low, high]| (0.5 * (high - low)) as f32),
            fence_us: micros(fence.for_s),
            thrust_us: micros(thrust.for_s),
            sink_m_s: thrust.sink_m_s as f32,
            level_rad: thrust.level_rad as f32,
            outputs_us: micros(outputs.land_after_s),
            armed_us: micros(armed.idle_for_s),
            motor_us: micros(motor.for_s),
            ends: ends(config.command_range),
            crash: [crash.error_rad as f32, crash.rate_rad_s as f32],
            crash_us: micros(crash.for_s),
            touchdown: TouchdownLimits::new(config, landing),
            hover: HoverLimits::new(config),
            uses_gyro: config.estimation.gyro.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_become_microseconds() {
        assert_eq!([0.0, 1e-6, 0.01, 60.0, 1e9].map(micros), [0, 1, 10_000, 60_000_000, u32::MAX]);
    }

    /// Of the first 3 s every whole microsecond, and those at boundaries of 2^32: as a person writes
    /// them, with six decimals, which f64 holds to less than half of one.
    #[test]
    fn whole_microseconds_stay_whole() {
        for us in
            (0..3_000_000).step_by(if cfg!(miri) { 10_007 } else { 1 }).chain(crate::residues::residues())
        {
            assert_eq!(micros(f64::from(us) / 1e6), us);
        }
    }

    /// The thesis' table, worked out by hand.
    #[test]
    fn the_table_in_the_units_of_flight() {
        let mut config = Config::thesis();
        config.supervision.fence = Fence { x_m: [-1.0, 3.0], y_m: [2.0, 4.0], z_m: [-2.5, 0.5], for_s: 0.2 };
        let limits = Limits::new(&config);
        assert_eq!((limits.period_us, limits.jump_us, limits.overrun_us), (10_000, 1_000_000, 100_000));
        assert_eq!(limits.link, SilenceLimits { late_us: 500_000, lost_us: 1_900_000, good_us: 500_000 });
        assert_eq!(limits.pose, SilenceLimits { late_us: 50_000, lost_us: 400_000, good_us: 100_000 });
        assert_eq!((limits.fence_centre_m, limits.fence_half_m), ([1.0, 3.0, -1.0], [2.0, 1.0, 1.5]));
        // Of 1000 us between idle and all there is, 5 at either end.
        assert_eq!(limits.ends, [1005.0, 1995.0]);
        // cos(60 degrees), rounded once.
        assert!((limits.tilt_cosine - 0.5).abs() < 1e-7);
        // A first-order smoothing of 0.2 s at 0.01 s: 1 - exp(-0.05).
        assert!((limits.disagreement_gain - 0.048_770_6).abs() < 1e-7);
        assert_eq!((limits.rate_limit, limits.uses_gyro), (35.0_f32.to_bits(), false));
    }
}
