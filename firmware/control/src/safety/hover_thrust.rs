//! The thrust that carries the craft, as it was while poses came: what a craft flies on with that no
//! longer sees its height.
//!
//! The law's own hover thrust is that of a model: of a craft as heavy, with motors as good and a
//! battery as full as on the day it was made. What is missing the altitude loop adds in flight, much
//! of it by an error of the height, and without a height there is no such error. So the vertical part
//! of the thrust is smoothed over half a second, and corrected for how the craft was accelerated
//! meanwhile: `thrust cos(phi) cos(theta) = m (g - z'')`, so by `m g = smoothed / (1 - z''/g)`, with
//! the mean of `z''` from the rate of z and its own smoothed value.
//!
//! A craft that loses its poses while it sinks or climbs would go on doing so: nothing is left that
//! brakes it. So its last rate of z is carried on by Newton's law, `z'' = g (1 - thrust / hover)`, and
//! braked until it is none.
//!
//! Gains in command units have no such proportions: there the command is smoothed only.

use crate::safety::limits::{GRAVITY_M_S2, HoverLimits};

/// Brakes harder the faster it is, so that the rate falls with this time constant, s: most of it
/// while the craft still holds ...
const BRAKE_S: f32 = 0.15;
/// ... but with no more than this fraction of the hover thrust, which motors have to spare.
const HARDEST: f32 = 0.25;
/// Correction at most, a fraction: beyond it the craft falls, and this is no hover.
const MOST: f32 = 0.3;

/// What is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HoverThrust {
    smoothed: f32,
    /// Rate of inertial z, smoothed alike, and the newest, m/s.
    smoothed_m_s: f32,
    newest_m_s: f32,
    /// The newest, carried on without poses, m/s.
    carried_m_s: f32,
}

impl HoverThrust {
    /// Nothing but the law's.
    pub(crate) fn of_the_law(limits: &HoverLimits) -> Self {
        Self { smoothed: limits.model, smoothed_m_s: 0.0, newest_m_s: 0.0, carried_m_s: 0.0 }
    }

    /// A tick in flight with a pose: the thrust in N (or command units), roll and pitch in rad, the
    /// rate of inertial z in m/s.
    #[inline]
    pub(crate) fn learn(
        &mut self,
        thrust: f32,
        attitude_rad: [f32; 3],
        z_rate_m_s: f32,
        limits: &HoverLimits,
    ) {
        let vertical = Self::vertical(thrust, attitude_rad, limits);
        if vertical.is_finite() && z_rate_m_s.is_finite() {
            self.smoothed += limits.smoothing * (vertical - self.smoothed);
            self.smoothed_m_s += limits.smoothing * (z_rate_m_s - self.smoothed_m_s);
            (self.newest_m_s, self.carried_m_s) = (z_rate_m_s, z_rate_m_s);
        }
    }

    /// The vertical part of a thrust in N, at roll and pitch in rad; a command as it is.
    #[inline]
    pub(crate) fn vertical(thrust: f32, [roll, pitch, _]: [f32; 3], limits: &HoverLimits) -> f32 {
        // cos(phi) cos(theta) to second order: 0.5 % off at 20 degrees of both.
        let upright = 1.0 - 0.5 * (roll * roll + pitch * pitch);
        let upright = if upright > 0.5 { upright } else { 0.5 };
        thrust * if limits.are_forces() { upright } else { 1.0 }
    }

    /// A tick in flight without poses: the thrust that carries the craft and brakes it, N or command
    /// units.
    pub(crate) fn carry_on(&mut self, elapsed_us: u32, limits: &HoverLimits) -> f32 {
        let hover = self.value(limits);
        if !limits.are_forces() {
            return hover;
        }
        let brake = (self.carried_m_s / (GRAVITY_M_S2 * BRAKE_S)).clamp(-HARDEST, HARDEST);
        self.carried_m_s -= GRAVITY_M_S2 * brake * (elapsed_us as f32 * 1e-6).min(BRAKE_S);
        hover * (1.0 + brake)
    }

    /// It, N or command units.
    pub(crate) fn value(&self, limits: &HoverLimits) -> f32 {
        let accelerated = limits.per_m_s * (self.newest_m_s - self.smoothed_m_s);
        self.smoothed / (1.0 - accelerated.clamp(-MOST, MOST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;
    use crate::dsp::trig::sin_cos;
    use crate::safety::limits::Limits;

    const PERIOD_S: f32 = 0.01;

    /// What is learned of 3 s of flight by a craft of 1.4 kg at this acceleration (z, down, m/s^2),
    /// tilt (roll, pitch, rad) and from this rate on, in units of its weight.
    fn learned(acceleration: impl Fn(f32) -> f32, tilt: [f32; 2]) -> f32 {
        let (limits, mass_kg) = (Limits::new(&Config::thesis()).hover, 1.4);
        let mut hover = HoverThrust::of_the_law(&limits);
        let mut rate_m_s = 0.0;
        for k in 0..300_u16 {
            let now = acceleration(f32::from(k) * PERIOD_S);
            let [roll, pitch] = tilt;
            let thrust = mass_kg * (9.81 - now) / (sin_cos(roll).1 * sin_cos(pitch).1);
            rate_m_s += now * PERIOD_S;
            hover.learn(thrust, [roll, pitch, 1.0], rate_m_s, &limits);
        }
        hover.value(&limits) / (mass_kg * 9.81)
    }

    /// The law's own is 11.9 N, the craft weighs 13.7: six time constants leave 0.03 % of that, and of a
    /// rate that grows steadily 0.25 % of the correction; cosines to second order are 0.2 % off.
    #[test]
    fn it_is_the_weight_however_the_craft_moves() {
        let close = |got: f32, percent: f32| assert!((got - 1.0).abs() < 0.01 * percent, "{got}");
        close(learned(|_| 0.0, [0.0; 2]), 0.5);
        close(learned(|_| 0.0, [0.3, -0.2]), 0.5);
        close(learned(|_| 1.0, [0.0; 2]), 0.5);
        close(learned(|_| -1.0, [0.0; 2]), 0.5);
        // Up and down at 1 Hz: what a first-order filter leaves is the same of thrust and rate.
        close(learned(|t| 2.0 * sin_cos(std::f32::consts::TAU * t).0, [0.1, 0.0]), 1.0);
    }

    #[test]
    fn before_a_flight_it_is_the_laws_and_what_is_no_number_changes_nothing() {
        let config = Config::thesis();
        let limits = Limits::new(&config).hover;
        let mut hover = HoverThrust::of_the_law(&limits);
        assert!((hover.value(&limits) - 11.9093).abs() < 1e-5);
        for bad in [f32::NAN, f32::INFINITY] {
            hover.learn(bad, [0.0; 3], 0.0, &limits);
            hover.learn(12.0, [bad, 0.0, 0.0], bad, &limits);
            hover.learn(12.0, [0.0; 3], bad, &limits);
        }
        assert!((hover.value(&limits) - 11.9093).abs() < 1e-5);
        let falls = HoverThrust { newest_m_s: 1e9, ..hover };
        assert!(falls.value(&limits) < 1.5 * 11.9093);
    }

    /// Sinking at 1 m/s, by Newton's law: 0.25 g brakes it to 0.37 m/s, then it dies out.
    #[test]
    fn a_sinking_craft_is_braked_to_a_stop() {
        let limits = Limits::new(&Config::thesis()).hover;
        for start_m_s in [1.0_f32, -1.0] {
            let mut hover = HoverThrust { carried_m_s: start_m_s, ..HoverThrust::of_the_law(&limits) };
            let mut rate_m_s = start_m_s;
            for _ in 0..100 {
                let thrust = hover.carry_on(10_000, &limits);
                assert!((thrust / 11.9093 - 1.0).abs() < 0.251);
                rate_m_s += 9.81 * (1.0 - thrust / 11.9093) * 0.01;
            }
            assert!(rate_m_s.abs() < 0.02, "{rate_m_s}");
        }
    }

    /// By hand: 0.1 m/s falls within 0.15 s with 0.1 / (9.81 * 0.15) = 6.8 % of the weight more, and by 9.81 m/s^2 of that in 10 ms; at
    /// 1 m/s a quarter is all there is. After a long pause the craft is not said to move the other way.
    #[test]
    fn the_brake_is_proportional_and_bounded() {
        let limits = Limits::new(&Config::thesis()).hover;
        let braked = |rate_m_s: f32, elapsed_us: u32| {
            let mut hover = HoverThrust { carried_m_s: rate_m_s, ..HoverThrust::of_the_law(&limits) };
            let more = hover.carry_on(elapsed_us, &limits) / limits.model - 1.0;
            (more, hover.carried_m_s)
        };
        for sign in [1.0, -1.0] {
            for (elapsed_us, more, left_m_s) in [(10_000, 0.067_96, 0.093_33), (2_000_000, 0.067_96, 0.0)] {
                let (got, rate_m_s) = braked(sign * 0.1, elapsed_us);
                assert!((sign * got - more).abs() < 1e-4, "{got}");
                assert!((sign * rate_m_s - left_m_s).abs() < 1e-5, "{rate_m_s}");
            }
            let (got, rate_m_s) = braked(sign, 10_000);
            assert!((sign * got - 0.25).abs() < 1e-6 && (sign * rate_m_s - 0.975_475).abs() < 1e-5);
        }
    }

    /// Command units: 1711.9 us carry the thesis' craft.
    #[test]
    fn a_command_is_smoothed_only() {
        let limits = Limits::new(&Config::thesis_hand_tuned()).hover;
        let mut hover = HoverThrust::of_the_law(&limits);
        for k in 0..300_u16 {
            hover.learn(1800.0, [0.3, 0.0, 0.0], f32::from(k), &limits);
        }
        assert!((hover.value(&limits) - 1800.0).abs() < 0.5);
        assert!((hover.carry_on(10_000, &limits) - 1800.0).abs() < 0.5);
    }
}
