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

    /// Time of a swing, s.
    pub fn swing_s(&self) -> f64 {
        std::f64::consts::TAU / self.load.stiffness_rad2_s2(self.gravity_m_s2).sqrt()
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

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::testing::truth;

    /// 0.2 kg on a metre under 1.214 kg; damped by a tenth.
    fn loaded() -> Model {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.2, 1.0, 0.1]);
        model
    }

    #[test]
    fn a_load_is_known_by_its_share_its_swing_and_its_decay() {
        let carried = of_model(&loaded()).unwrap();
        assert!((carried.share - 0.2 / 1.214).abs() < 1e-12);
        // Of the mass that hangs together, 1.414 kg.
        assert!((carried.part() - 0.2 / 1.414).abs() < 1e-12);
        assert!((carried.part_per_kg() - 1.0 / 1.214).abs() < 1e-12);
        let frequency_rad_s = 9.81_f64.sqrt();
        assert!((carried.decay_per_s() - 0.1 * frequency_rad_s).abs() < 1e-12);
        let usual = carried.usual(0.3);
        assert!((usual.x - 0.3).abs() < 1e-12 && (usual.y - 0.3 * frequency_rad_s).abs() < 1e-12);
    }

    #[test]
    fn a_heavier_craft_has_a_smaller_share_on_its_cable() {
        let mut model = loaded();
        model.set(Effect::MassChange, &[0.786]);
        assert!((of_model(&model).unwrap().share - 0.1).abs() < 1e-12);
    }

    #[test]
    fn the_part_grows_with_the_first_gram_as_the_slope_says() {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[1e-6, 1.0, 0.0]);
        let carried = of_model(&model).unwrap();
        assert!((carried.part() / 1e-6 / carried.part_per_kg() - 1.0).abs() < 1e-5);
    }

    /// On a cable of a metre, 0.02 rad are 2 cm or 6.3 cm/s.
    #[test]
    fn a_change_is_large_beyond_two_centimetres_on_a_metre_whichever_way() {
        let carried = of_model(&loaded()).unwrap();
        for way in 0..4 {
            let limit = if way % 2 == 0 { 0.02 } else { 0.02 * 9.81_f64.sqrt() };
            for (part, large) in [(0.99, false), (1.01, true), (-1.01, true)] {
                let mut change = Vector4::zeros();
                change[way] = part * limit;
                assert_eq!(carried.is_large(&change), large, "{way}, {part}");
            }
        }
    }

    #[test]
    fn without_its_load_a_model_is_as_before() {
        assert!(of_model(&truth()).is_none());
        assert_eq!(without_load(&loaded()), truth());
        assert_eq!(without_load(&truth()), truth());
    }
}
