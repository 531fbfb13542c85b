//! The attitude of now, where the last pose is of before: carried on by the gyro, with Euler rates
//! from body rates (thesis (2.3)).
//!
//! Between poses each tick carries it on by its own sample. Where a link has become slow, a pose is
//! brought to the present by the turn since it was taken: the attitude loops see nothing of the
//! delay. The height has its own way (`law/height.rs`); the position stays as old as it is.
//!
//! On a good link poses count as they came: what the craft tells of its attitude is then motion
//! capture's alone, and a model can be fitted to it and to the gyro as to two witnesses.

use crate::dsp::recent::Recent;
use crate::dsp::trig::{sin_cos, wrap_angle};

/// So many samples are kept: at 100 Hz those of the 0.15 s that a pose may be old by default, and one.
pub(crate) const KEPT: usize = 16;
/// A pose that came so much later than the quickest do, us, is late: by as much as the transmission takes as a rule (thesis 5.5) ...
const LATE_US: u32 = 20_000;
/// ... and for so long after it all are brought to now, us: one way or the other, not to and fro.
const STAYS_LATE_US: u32 = 500_000;

/// The gyro in one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    /// Body rates in rad/s.
    gyro_rad_s: Option<[f32; 3]>,
    /// Time since the tick before, us.
    elapsed_us: u32,
}

/// The gyro in the last ticks, and whether poses are late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turns {
    samples: Recent<Sample, KEPT>,
    /// Poses are brought to now for so long still, us.
    late_for_us: u32,
}

impl Turns {
    /// A craft that has never turned, over a good link.
    pub(crate) const NONE: Self =
        Self { samples: Recent::of([Sample { gyro_rad_s: None, elapsed_us: 0 }; KEPT]), late_for_us: 0 };

    /// Takes in the sample of this tick.
    #[inline]
    pub(crate) fn hear(&mut self, gyro_rad_s: Option<[f32; 3]>, elapsed_us: u32) {
        self.samples.push(Sample { gyro_rad_s, elapsed_us });
        self.late_for_us = self.late_for_us.saturating_sub(elapsed_us);
    }

    /// Whether poses are to be brought to now, with one of this age.
    #[inline]
    pub(crate) fn poses_are_late(&mut self, age_us: u32) -> bool {
        if age_us > LATE_US {
            self.late_for_us = STAYS_LATE_US;
        }
        self.late_for_us != 0
    }

    /// The attitude of now in rad of a craft that had this one so many us ago. What lies
    /// before the samples that are kept is no turn, nor is a time without samples.
    #[cold]
    pub(crate) fn brought_to_now(&self, attitude_rad: [f32; 3], age_us: u32) -> [f32; 3] {
        if age_us == 0 {
            return attitude_rad;
        }
        carry(attitude_rad, Some(self.mean_rad_s(age_us)), age_us)
    }

    /// Mean rates over the last so many us.
    fn mean_rad_s(&self, age_us: u32) -> [f32; 3] {
        let mut left_us = age_us;
        let mut mean_rad_s = [0.0; 3];
        for sample in self.samples.newest_first() {
            let us = left_us.min(sample.elapsed_us);
            left_us -= us;
            let part = us as f32 / age_us as f32;
            for (mean, rate) in mean_rad_s.iter_mut().zip(sample.gyro_rad_s.unwrap_or([0.0; 3])) {
                *mean += rate * part;
            }
            if left_us == 0 {
                break;
            }
        }
        mean_rad_s
    }
}

/// The attitude in rad after turning at the gyro's rates.
#[cold]
pub(crate) fn carry([roll, pitch, yaw]: [f32; 3], gyro_rad_s: Option<[f32; 3]>, elapsed_us: u32) -> [f32; 3] {
    let Some([p, q, r]) = gyro_rad_s else { return [roll, pitch, yaw] };
    let dt = elapsed_us as f32 * 1e-6;
    let ((sin_roll, cos_roll), (sin_pitch, cos_pitch)) = (sin_cos(roll), sin_cos(pitch));
    // With the nose straight up yaw and roll are one; by then the tilt has long been detected.
    let cos_pitch = if cos_pitch.abs() < 0.1 { 0.1 } else { cos_pitch };
    let turning = q * sin_roll + r * cos_roll;
    [
        wrap_angle(roll + dt * (p + turning * sin_pitch / cos_pitch)),
        pitch + dt * (q * cos_roll - r * sin_roll),
        wrap_angle(yaw + dt * turning / cos_pitch),
    ]
}

/// From one attitude to another in rad, yaw the short way round.
#[cold]
pub(crate) fn turn(from_rad: [f32; 3], [roll, pitch, yaw]: [f32; 3]) -> [f32; 3] {
    let [roll0, pitch0, yaw0] = from_rad;
    [roll - roll0, pitch - pitch0, wrap_angle(yaw - yaw0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turning about a fixed axis: the carried attitude is that of the rotation, by nalgebra.
    #[test]
    fn the_gyro_carries_the_attitude() {
        use nalgebra::{Rotation3, Vector3};
        let rates = [0.6_f32, -0.4, 0.9];
        let start = [0.1_f32, 0.2, 3.0];
        let [r0, p0, y0] = start.map(f64::from);
        let mut attitude = start;
        for _ in 0..1000 {
            attitude = carry(attitude, Some(rates), 1000);
        }
        let turned = Rotation3::new(Vector3::from(rates.map(f64::from)));
        let exact = Rotation3::from_euler_angles(r0, p0, y0) * turned;
        let (roll, pitch, yaw) = exact.euler_angles();
        for (got, want) in attitude.iter().zip([roll, pitch, yaw]) {
            // First-order steps of 1 ms over 1 s at 1.2 rad/s: half of 1.2^2 * 1 ms, below 1e-3
            // rad.
            assert!((f64::from(*got) - want).abs() < 1e-3, "{attitude:?} {roll} {pitch} {yaw}");
        }
        assert_eq!(carry(start, None, 10_000), start);
        // Nose up: 0.1 stands in for a cosine of next to nothing.
        let [roll, pitch, yaw] =
            carry([0.0, core::f32::consts::FRAC_PI_2, 0.0], Some([0.0, 0.0, 1.0]), 10_000);
        assert!((roll - 0.1).abs() < 1e-4 && (yaw - 0.1).abs() < 1e-4, "{roll} {pitch} {yaw}");
    }

    fn turns(rates_rad_s: impl IntoIterator<Item = [f32; 3]>) -> Turns {
        let mut turns = Turns::NONE;
        rates_rad_s.into_iter().for_each(|rates| turns.hear(Some(rates), 10_000));
        turns
    }

    /// Rates of roll alone, one rad/s more with each tick of 10 ms up to 40: by sums done by hand.
    #[test]
    fn the_turn_since_a_pose_is_that_of_the_last_samples() {
        let turned_by = |ticks: u8, age_us| {
            let turns = turns((1..=ticks).map(|k| [f32::from(k), 0.0, 0.0]));
            let [roll, pitch, yaw] = turns.brought_to_now([-1.0, 0.2, 0.3], age_us);
            assert_eq!([pitch, yaw], [0.2, 0.3]);
            roll + 1.0
        };
        for (ticks, age_us, want_rad) in [
            (40, 10_000, 0.4),
            (40, 4_000, 0.16),
            (40, 35_000, 0.40 + 0.39 + 0.38 + 0.5 * 0.37),
            (3, 30_000, 0.06),
            // Before the first sample nothing is known, and no more than 16 are kept.
            (3, 90_000, 0.06),
            (31, 10_000, 0.31),
            (32, 10_000, 0.32),
            (32, 160_000, 3.92),
            (40, 160_000, 5.2),
            (40, 4_000_000_000, 5.2),
        ] {
            let got_rad = wrap_angle(turned_by(ticks, age_us) - want_rad);
            assert!(got_rad.abs() < 1e-5, "{ticks} {age_us}: {got_rad} rad off {want_rad}");
        }
    }

    /// Ticks that are not even count as long as they were, and without a gyro there is no turn.
    #[test]
    fn a_sample_counts_for_its_time() {
        let mut turns = Turns::NONE;
        turns.hear(Some([0.0, 9.0, 0.0]), 10_000);
        turns.hear(Some([0.0, 1.0, 0.0]), 25_000);
        turns.hear(None, 5_000);
        let [_, pitch, _] = turns.brought_to_now([0.0; 3], 31_000);
        assert!((pitch - (0.025 + 0.009)).abs() < 1e-6, "{pitch}");
    }

    /// A craft that turns about an axis of its own at a rate that swells and falls: the attitude of
    /// 60 ms ago, brought to now, by nalgebra's rotations. (First order in the turn of 0.05 rad.)
    #[test]
    fn a_late_attitude_is_that_of_now() {
        use nalgebra::{Rotation3, Vector3};
        let rates = |tick: u16| {
            let swell = 1.0 + 0.5 * libm::sin(0.3 * f64::from(tick));
            Vector3::new(0.5, -0.4, 0.6) * swell
        };
        let mut attitude = Rotation3::from_euler_angles(0.2, -0.1, 3.1);
        let mut known = Turns::NONE;
        let mut before = [[0.0_f32; 3]; 7];
        for tick in 0..100 {
            let rates_rad_s = rates(tick);
            attitude *= Rotation3::new(0.01 * rates_rad_s);
            known.hear(Some([0, 1, 2].map(|axis| rates_rad_s[axis] as f32)), 10_000);
            let (roll, pitch, yaw) = attitude.euler_angles();
            before.rotate_right(1);
            before[0] = [roll, pitch, yaw].map(|rad| rad as f32);
            if tick >= 7 {
                let late = known.brought_to_now(before[6], 60_000);
                for (got, want) in late.into_iter().zip(before[0]) {
                    assert!(wrap_angle(got - want).abs() < 2e-3, "{tick}: {late:?} {:?}", before[0]);
                }
            }
        }
    }
}
