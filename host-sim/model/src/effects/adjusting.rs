//! The places where an adjusting effect can take hold. Each effect's file writes those where it does; everywhere else it
//! leaves things as they are.

use nalgebra::{Matrix3, Vector3};

use crate::effects::slung_load::cable::SlungLoad;
use crate::sample::{AtRotor, SampleInput};

/// What an effect of kind [`crate::Kind::Adjusting`] does with its coefficients. Neutral by default, as is the `Default` of
/// each implementation.
pub(crate) trait Adjusting {
    /// Whether [`Self::air_velocity_m_s`] gives anything else than it takes.
    #[inline(always)]
    fn changes_air(&self) -> bool {
        false
    }

    /// Velocity relative to the air, body components, from that without the effect.
    #[inline(always)]
    fn air_velocity_m_s(&self, velocity_m_s: Vector3<f64>, _: &SampleInput) -> Vector3<f64> {
        velocity_m_s
    }

    /// Whether [`Self::thrust_rad2_s2`] or [`Self::thrust_factor`] make a difference.
    #[inline(always)]
    fn changes_thrust(&self) -> bool {
        false
    }

    /// What stands in for the square of a rotor's speed in its thrust, from that without the effect.
    #[inline(always)]
    fn thrust_rad2_s2(&self, square_rad2_s2: f64, _speed_rad_s: f64) -> f64 {
        square_rad2_s2
    }

    /// Factor of a rotor's thrust.
    #[inline(always)]
    fn thrust_factor(&self, _: &AtRotor) -> f64 {
        1.0
    }

    /// Rotor speed beyond the motor map's at a battery voltage, which it changes with in proportion.
    #[inline(always)]
    fn speed_change_rad_s(&self, _battery_v: f64) -> f64 {
        0.0
    }

    /// Slope of [`Self::speed_change_rad_s`], rad/s/V.
    fn speed_per_volt(&self) -> f64 {
        0.0
    }

    /// Time constant of the rotors beyond the vehicle file's.
    fn time_constant_s(&self) -> f64 {
        0.0
    }

    /// Dead time between command and rotor.
    fn dead_time_s(&self) -> f64 {
        0.0
    }

    /// Tracked point beyond the vehicle file's, body FRD.
    fn tracked_point_m(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Tilt of the tracked attitude against the body: measured = true followed by the tilt.
    fn tilt(&self) -> Option<Matrix3<f64>> {
        None
    }

    /// Mass beyond the vehicle file's.
    fn extra_mass_kg(&self) -> f64 {
        0.0
    }

    /// Centre of mass beyond the geometric centre, forward and right.
    fn com_offset_m(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// By what part of itself the reaction torque of each rotor is larger.
    fn torque_change(&self) -> [f64; 4] {
        [0.0; 4]
    }

    /// A load on a cable under the craft.
    fn load(&self) -> Option<SlungLoad> {
        None
    }
}
