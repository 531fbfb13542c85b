//! The height of now, where poses come late: what the motors were told since a pose was taken is
//! already on its way.
//!
//! A late height makes the altitude loop oscillate: under the thesis' gains 0.1 s is too much. Adding
//! the rate times the delay does not help, since the rate is as late as the height. But the craft
//! knows what its motors were told: with motors at their end, as in a take-off, that is less thrust
//! than was asked for. So an observer carries height and rate on by the acceleration
//! that was commanded, and each late pose corrects them by its distance from the height that was held
//! for its moment. The correction is slow beside the loop and the delay ([`CORRECTS_RAD_S`]): quicker
//! motions are the motors' own, and slower ones do not mind the delay. A third state holds the
//! acceleration that nobody commanded: a load, or motors that have become weaker.

use crate::dsp::recent::Recent;
use crate::law::carried::KEPT;

/// Natural frequency of the correction, rad/s. With 3 rad/s a craft that is 15 % lighter than its
/// hover thrust says oscillates at 0.2 s of delay (thesis' altitude loop).
const CORRECTS_RAD_S: f32 = 2.0;
/// Its damping ratio.
const DAMPING_RATIO: f32 = 0.8;
/// The third state's part: all three poles are then at 0.6 times the frequency.
const BESIDES: f32 = 0.25;
/// Accelerations along z that a thrust can mean, m/s^2: a rotor does not pull down, and hardly a craft
/// has more than three times its weight.
const UPWARDS_M_S2: f32 = -20.0;
const DOWNWARDS_M_S2: f32 = 10.0;
/// Steps of the time before the first late pose, us: [`KEPT`] of them are 0.16 s.
const LEAST_STEP_US: u32 = 10_000;
/// Longest step, s: a tick that took longer is a fault of its own.
const LONGEST_S: f32 = 0.1;

/// A height that was held.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Past {
    z_m: f32,
    /// From then to the next, us.
    elapsed_us: u32,
}

/// Height and rate of now of a craft whose poses are late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Height {
    /// Inertial z, m, and its rate, m/s, down positive.
    z_m: f32,
    rate_m_s: f32,
    /// Acceleration that was not commanded, m/s^2.
    besides_m_s2: f32,
    past: Recent<Past, KEPT>,
    /// Time since the last correction, us.
    uncorrected_us: u32,
}

impl Height {
    /// From a pose after a silence, of so many us ago: what is known of the motion is kept.
    #[cold]
    pub(crate) fn seen_again(&self, z_m: f32, age_us: u32) -> Self {
        Self { besides_m_s2: self.besides_m_s2, ..Self::start(z_m, age_us, self.rate_m_s) }
    }

    /// From the first late pose: inertial z in m, of so many us ago, and the rate of z since, m/s.
    #[cold]
    pub(crate) fn start(z_m: f32, age_us: u32, rate_m_s: f32) -> Self {
        let rate_m_s = if rate_m_s.is_finite() { rate_m_s } else { 0.0 };
        let now_m = z_m + rate_m_s * (age_us as f32 * 1e-6);
        // What was before lies on a straight line, at least as far back as the pose is old.
        let step_us = age_us.max(LEAST_STEP_US);
        let mut past = [Past { z_m: now_m, elapsed_us: step_us }; KEPT];
        let mut before_m = now_m;
        for one in past.iter_mut().rev() {
            before_m -= rate_m_s * (step_us as f32 * 1e-6);
            one.z_m = before_m;
        }
        Self { z_m: now_m, rate_m_s, besides_m_s2: 0.0, past: Recent::of(past), uncorrected_us: 0 }
    }

    /// Inertial z of now, m.
    #[inline]
    pub(crate) fn z_m(&self) -> f32 {
        self.z_m
    }

    /// One tick on, at the acceleration along z in m/s^2 that was commanded in the last.
    #[cold]
    pub(crate) fn go_on(&mut self, commanded_m_s2: f32, elapsed_us: u32) {
        self.past.push(Past { z_m: self.z_m, elapsed_us });
        self.uncorrected_us = self.uncorrected_us.saturating_add(elapsed_us);
        let dt = seconds(elapsed_us);
        let acceleration_m_s2 = possible(commanded_m_s2) + self.besides_m_s2;
        self.z_m += dt * (self.rate_m_s + 0.5 * dt * acceleration_m_s2);
        self.rate_m_s += dt * acceleration_m_s2;
    }

    /// A pose says that z was this, m, so many us ago.
    #[cold]
    pub(crate) fn correct(&mut self, z_m: f32, age_us: u32) {
        let step = CORRECTS_RAD_S * seconds(self.uncorrected_us);
        self.uncorrected_us = 0;
        let off_m = z_m - self.before_m(age_us);
        self.z_m += 2.0 * DAMPING_RATIO * step * off_m;
        self.rate_m_s += CORRECTS_RAD_S * step * off_m;
        self.besides_m_s2 += BESIDES * CORRECTS_RAD_S * CORRECTS_RAD_S * step * off_m;
    }

    /// The z that was held so many us ago, m; the oldest there is where that is longer ago.
    fn before_m(&self, age_us: u32) -> f32 {
        let (mut left_us, mut later_m) = (age_us, self.z_m);
        for past in self.past.newest_first() {
            if left_us < past.elapsed_us {
                return later_m + left_us as f32 / past.elapsed_us as f32 * (past.z_m - later_m);
            }
            left_us -= past.elapsed_us;
            later_m = past.z_m;
        }
        later_m
    }
}

/// A time of a step, s.
fn seconds(elapsed_us: u32) -> f32 {
    (elapsed_us as f32 * 1e-6).min(LONGEST_S)
}

/// What of an acceleration can be; NaN is none.
fn possible(acceleration_m_s2: f32) -> f32 {
    if acceleration_m_s2.is_nan() { 0.0 } else { acceleration_m_s2.clamp(UPWARDS_M_S2, DOWNWARDS_M_S2) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_US: u32 = 10_000;

    /// A craft whose acceleration swells and falls is seen 0.1 s late: in the end the height of now is known to a millimetre, though a
    /// straight line through late poses is a centimetre off.
    #[test]
    fn a_late_height_is_that_of_now() {
        let (mut z_m, mut rate_m_s) = (-1.0_f32, 0.2_f32);
        let mut seen_m = [z_m; 11];
        let mut height = None;
        let (mut worst_m, mut worst_of_line_m) = (0.0_f32, 0.0_f32);
        for tick in 0..2000_u16 {
            let acceleration_m_s2 = 3.0 * libm::sinf(0.05 * f32::from(tick));
            z_m += 0.01 * (rate_m_s + 0.005 * acceleration_m_s2);
            rate_m_s += 0.01 * acceleration_m_s2;
            seen_m.rotate_right(1);
            seen_m[0] = z_m;
            let (late_m, before_m) = (seen_m[10], seen_m[9]);
            match &mut height {
                None if tick < 20 => {}
                None => height = Some(Height::start(late_m, 100_000, (before_m - late_m) / 0.01)),
                Some(height) => {
                    height.go_on(acceleration_m_s2, TICK_US);
                    height.correct(late_m, 100_000);
                    if tick > 1600 {
                        worst_m = worst_m.max((height.z_m() - z_m).abs());
                        let line_m = late_m + (before_m - late_m) * 10.0;
                        worst_of_line_m = worst_of_line_m.max((line_m - z_m).abs());
                    }
                }
            }
        }
        assert!(worst_m < 1e-3 && worst_of_line_m > 0.01, "{worst_m} {worst_of_line_m}");
    }

    /// What nobody commanded is learned: a load that pulls by 0.5 m/s^2 in the end leaves no error.
    #[test]
    fn a_load_that_nobody_commanded_leaves_no_error() {
        let mut height = Height::start(-1.0, 100_000, 0.0);
        let mut off_m = 0.0;
        // The craft stays where it is, because the loop holds it with more thrust.
        for _ in 0..3000 {
            height.go_on(-0.5, TICK_US);
            height.correct(-1.0, 100_000);
            off_m = height.z_m() + 1.0;
        }
        assert!(off_m.abs() < 1e-3, "{off_m}");
        assert!((height.besides_m_s2 - 0.5).abs() < 1e-2, "{height:?}");
    }

    /// Between the entries on a straight line, and before the first as it was.
    #[test]
    fn heights_of_before_are_those_that_were_held() {
        let mut height = Height::start(0.0, 50_000, 1.0);
        let near = |height: &Height, age_us: u32, want_m: f32| {
            let got_m = height.before_m(age_us);
            assert!((got_m - want_m).abs() < 1e-5, "{age_us}: {got_m} for {want_m}");
        };
        near(&height, 0, 0.05);
        near(&height, 50_000, 0.0);
        near(&height, 20_000, 0.03);
        // At 1 m/s: 0.06 after a tick, 0.065 after half of another.
        height.go_on(0.0, 10_000);
        height.go_on(0.0, 5_000);
        near(&height, 0, 0.065);
        near(&height, 5_000, 0.06);
        near(&height, 12_000, 0.053);
        near(&height, 60_000, 0.005);
        near(&height, 150_000, -0.085);
        for _ in 0..KEPT {
            height.go_on(0.0, 10_000);
        }
        near(&height, 160_000, 0.065);
        near(&height, 159_000, 0.066);
        near(&height, u32::MAX, 0.065);
    }

    /// Poses may be allowed to be older than the ticks that are kept: what was before the first late one reaches as far back.
    #[test]
    fn the_time_before_the_first_late_pose_reaches_back_to_it() {
        for age_us in [10_000, 145_000, 170_000, 400_000, 2_000_000] {
            let height = Height::start(-1.0, age_us, 0.7);
            assert!((height.before_m(age_us) + 1.0).abs() < 1e-5, "{age_us}: {}", height.before_m(age_us));
        }
    }

    /// After a silence the height is the pose's, and the rate and what nobody commanded as they were.
    #[test]
    fn a_pose_after_a_silence_keeps_the_motion() {
        let height = Height { besides_m_s2: 0.7, ..Height::start(0.0, 0, -0.4) };
        let again = height.seen_again(-2.0, 100_000);
        assert_eq!(again, Height { besides_m_s2: 0.7, ..Height::start(-2.0, 100_000, -0.4) });
    }

    /// An error of a metre dies away as the observer's differential equations say, which are integrated here in steps of 0.1 ms: what is
    /// left differs by the ticks' length.
    #[test]
    fn an_error_dies_away_as_its_equations_say() {
        let (omega, two_zeta, besides) = (2.0_f64, 2.0 * 0.8, 0.25);
        let mut height = Height::start(1.0, 0, 0.0);
        let [mut z_m, mut rate_m_s, mut besides_m_s2] = [1.0_f64, 0.0, 0.0];
        for tick in 1..400_u32 {
            height.go_on(0.0, TICK_US);
            height.correct(0.0, 0);
            for _ in 0..100 {
                let off_m = -z_m;
                z_m += 1e-4 * (rate_m_s + two_zeta * omega * off_m);
                rate_m_s += 1e-4 * (besides_m_s2 + omega * omega * off_m);
                besides_m_s2 += 1e-4 * besides * omega * omega * omega * off_m;
            }
            assert!((f64::from(height.z_m()) - z_m).abs() < 0.02, "{tick}: {} {z_m}", height.z_m());
        }
        assert!(z_m.abs() < 0.1, "{z_m}");
    }

    /// A pose that is early or late by some ticks is held against the height of its own moment.
    #[test]
    fn ages_may_differ_from_pose_to_pose() {
        let mut height = Height::start(-1.0, 40_000, -0.5);
        for tick in 1..200_u32 {
            height.go_on(0.0, TICK_US);
            let age_us = 40_000 + 10_000 * (tick % 7);
            let at_s = (tick * TICK_US) as f32 * 1e-6 + 0.04 - age_us as f32 * 1e-6;
            if tick % 3 != 0 {
                height.correct(-1.0 - 0.5 * at_s, age_us);
            }
            let now_m = -1.02 - 0.5 * (tick * TICK_US) as f32 * 1e-6;
            assert!((height.z_m() - now_m).abs() < 1e-4, "{tick}: {} {now_m}", height.z_m());
        }
    }

    #[test]
    fn nonsense_accelerates_nothing() {
        for (commanded, want_m_s2) in [
            (f32::NAN, 0.0),
            (f32::INFINITY, DOWNWARDS_M_S2),
            (f32::NEG_INFINITY, UPWARDS_M_S2),
            (-1e9, UPWARDS_M_S2),
            (3.0, 3.0),
        ] {
            let mut height = Height::start(0.0, 0, f32::NAN);
            height.go_on(commanded, 20_000);
            assert!((height.rate_m_s - 0.02 * want_m_s2).abs() < 1e-6, "{commanded}: {height:?}");
            // A tick of a minute moves it no further than one of 0.1 s.
            height.go_on(0.0, 60_000_000);
            assert!((height.z_m - (0.01 * 0.02 + 0.1 * 0.02) * want_m_s2).abs() < 1e-5, "{height:?}");
        }
    }
}
