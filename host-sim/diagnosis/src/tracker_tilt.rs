//! A tracker whose vertical is off passes for a wind.
//!
//! In a frame that leans by some angle, gravity pulls to the side by its tangent, everywhere the same, as a steady wind pushes a craft at
//! rest. An accelerometer tells the two apart: it feels the push of a wind, and no gravity.

use model::{Effect, Model, Plant, State};
use nalgebra::{Vector2, Vector3};
use sysid::prepare::{ForceTarget, Prepared};

/// By how many degrees the vertical of the tracker would be off if it passed for the wind of a model that was fitted to flights; nothing for other
/// effects, and where accelerometers gave the forces.
pub(crate) fn tracker_tilt_deg(model: &Model, effect: Effect, flights: &[&Prepared]) -> Option<f64> {
    let mut calm = model.clone();
    calm.terms.retain(|term| term.effect != effect);
    changed_tilt_deg(&calm, model, effect, flights)
}

/// The same for a wind that has changed between two models.
pub(crate) fn changed_tilt_deg(
    before: &Model,
    after: &Model,
    effect: Effect,
    flights: &[&Prepared],
) -> Option<f64> {
    let is_felt = flights.iter().any(|flight| flight.force_target == ForceTarget::Imu);
    (effect == Effect::SteadyWind && !is_felt).then(|| {
        let push_m_s2 = (sideways_at_rest_m_s2(after) - sideways_at_rest_m_s2(before)).norm();
        (push_m_s2 / after.vehicle.gravity).atan().to_degrees()
    })
}

/// Horizontal specific force of a level craft at rest whose rotors stand still: what the air does to it.
pub(crate) fn sideways_at_rest_m_s2(model: &Model) -> Vector2<f64> {
    let plant = Plant::new(model);
    let state = State::at_rest(Vector3::zeros(), [0.0; 4]);
    let input = plant.input(&state, &[0.0; 4], model.reference.battery_v);
    let [u, v, ..] = plant.accelerations(&plant.sample_of(&input));
    Vector2::new(u, v)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.25 N s/m, 1.25 kg and a wind of 1.284 m/s: gravity in a frame that leans by 1.5 degrees.
    #[test]
    fn a_wind_pushes_as_gravity_does_in_a_frame_that_leans() {
        let mut model = Model::thesis();
        model.vehicle.mass = 1.25;
        model.set(Effect::LinearDrag, &[-0.25, -0.25, -0.25]);
        let tilt_deg = |model: &Model, effect| tracker_tilt_deg(model, effect, &[]);
        assert_eq!(tilt_deg(&model, Effect::SteadyWind), Some(0.0));
        let tilted_m_s2 = model.vehicle.gravity * 1.5_f64.to_radians().tan();
        model.set(Effect::SteadyWind, &[0.6 * tilted_m_s2 / 0.2, -0.8 * tilted_m_s2 / 0.2]);
        let found = tilt_deg(&model, Effect::SteadyWind).unwrap();
        assert!((found - 1.5).abs() < 1e-9, "{found}");
        assert_eq!(tilt_deg(&model, Effect::LinearDrag), None);
        // A wind that turned by a right angle.
        let mut turned = model.clone();
        turned.set(Effect::SteadyWind, &[0.8 * tilted_m_s2 / 0.2, 0.6 * tilted_m_s2 / 0.2]);
        let changed = |before: &Model| changed_tilt_deg(before, &turned, Effect::SteadyWind, &[]).unwrap();
        assert_eq!(changed(&turned), 0.0);
        let expected = (2.0_f64.sqrt() * 1.5_f64.to_radians().tan()).atan().to_degrees();
        assert!((changed(&model) - expected).abs() < 1e-9, "{}", changed(&model));
    }
}
