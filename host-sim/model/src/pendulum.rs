//! A load on a cable as a pendulum: where it hangs and how it moves. What moves it is in `effects/slung_load/cable.rs`.

use nalgebra::Vector3;

/// Where a load hangs and how it swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pendulum {
    /// Unit vector from the craft to the load, inertial NED.
    pub direction: Vector3<f64>,
    /// Its turning rate, inertial NED, rad/s.
    pub turning_rad_s: Vector3<f64>,
}

/// It hangs still.
impl Default for Pendulum {
    fn default() -> Self {
        Self { direction: Vector3::new(0.0, 0.0, 1.0), turning_rad_s: Vector3::zeros() }
    }
}

impl Pendulum {
    /// The swing after `time_s` at a rate.
    #[inline(always)]
    pub(crate) fn moved(&self, rate: &Self, time_s: f64) -> Self {
        Self {
            direction: self.direction + time_s * rate.direction,
            turning_rad_s: self.turning_rad_s + time_s * rate.turning_rad_s,
        }
    }

    /// With a direction of length 1 again.
    pub(crate) fn normalized(&self) -> Self {
        Self { direction: self.direction / self.direction.norm(), ..*self }
    }

    /// Halfway to another one.
    pub fn middle(&self, other: &Self) -> Self {
        Self {
            direction: 0.5 * (self.direction + other.direction),
            turning_rad_s: 0.5 * (self.turning_rad_s + other.turning_rad_s),
        }
    }
}
