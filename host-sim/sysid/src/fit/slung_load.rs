//! The load of a model, and the model without it.

use model::{Model, SlungLoad};
use nalgebra::{Vector2, Vector4};

/// Standard deviation of the swing at the beginning, rad.
pub const SWING_RAD: f64 = 0.15;

/// A change of the beginning up to which the swing is linear in it, rad: of what a wide swing of 0.3 rad adds, it moves
/// the square by 6 parts in 1000 of gravity.
const LARGE_RAD: f64 = 0.02;

/// The load of a model.
#[derive(Debug, Clone, Copy)]
pub struct Carried {
    /// The load.
    pub load: SlungLoad,
    /// Its mass over the craft's.
    pub share: f64,
    craft_kg: f64,
    pub(crate) gravity_m_s2: f64,
}

impl Carried {
    /// The part of a force along the cable that moves the load.
    pub fn part(&self) -> f64 {
        self.share / (1.0 + self.share)
    }

    /// zeta w0, by which a swing decays.
    pub(crate) fn decay_per_s(&self) -> f64 {
        self.load.damping_ratio * self.load.stiffness_rad2_s2(self.gravity_m_s2).sqrt()
    }

    /// What [`Self::part`] grows by with the mass where there is none yet, 1/kg.
    pub fn part_per_kg(&self) -> f64 {
        1.0 / self.craft_kg
    }

    /// Standard deviations of a swing of `angle_rad`: offset m, velocity m/s.
    pub(crate) fn usual(&self, angle_rad: f64) -> Vector2<f64> {
        let offset_m = angle_rad * self.load.cable_length_m;
        Vector2::new(offset_m, offset_m * self.load.stiffness_rad2_s2(self.gravity_m_s2).sqrt())
    }

    /// Whether a change of a beginning is too large for what enters linearly.
    pub(crate) fn is_large(&self, change: &Vector4<f64>) -> bool {
        let usual = self.usual(SWING_RAD);
        change.component_div(&Vector4::new(usual.x, usual.y, usual.x, usual.y)).amax() > LARGE_RAD / SWING_RAD
    }
}

/// The load of a model, if it has one.
pub fn of_model(model: &Model) -> Option<Carried> {
    let adjust = model.adjustments();
    adjust.load().map(|load| {
        let craft_kg = model.vehicle.mass + adjust.extra_mass_kg();
        Carried { load, share: load.mass_kg / craft_kg, craft_kg, gravity_m_s2: model.vehicle.gravity }
    })
}

/// A model with nothing on the cable.
pub fn without_load(model: &Model) -> Model {
    let mut model = model.clone();
    model.terms.retain(|term| !term.effect.info().special.hangs_load);
    model
}
