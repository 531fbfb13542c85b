//! An attitude that is late against the position passes for a force that follows the body rates.
//!
//! A craft that pitches up at `q` accelerates back by `g q tau` more than an attitude says that is late by `tau`; one that rolls right at `p`,
//! right by `g p tau` more. So `rate-coupling` finds `C_dq^u = -m g tau` and `C_dp^v = m g tau`. Accelerometers tell the two apart: what they
//! measure is in body axes already, and needs no attitude.

use model::{Effect, Model};
use sysid::prepare::{ForceTarget, Prepared};

/// Standard errors within which the two are the same delay.
const DEVIATIONS: f64 = 4.0;
/// Part of the delay by which they may differ in any case: filters and drag blur it.
const BLUR: f64 = 0.15;

/// How late the attitude would be against the position if that passed for the rate coupling of a model that was fitted to flights, s; negative:
/// early. Nothing for other effects, for forces that are not one delay, and where accelerometers gave the forces.
pub(crate) fn attitude_late_s(model: &Model, effect: Effect, flights: &[&Prepared]) -> Option<f64> {
    let is_felt = flights.iter().any(|flight| flight.force_target == ForceTarget::Imu);
    let term = model.term(effect).filter(|_| effect == Effect::RateCoupling && !is_felt)?;
    let [pitch, roll] = [&term.coefficients[0], &term.coefficients[1]];
    let (late, sum) = (0.5 * (roll.value - pitch.value), roll.value + pitch.value);
    let error = roll.std_error.unwrap_or(0.0).hypot(pitch.std_error.unwrap_or(0.0));
    let is_one_delay = sum.abs() <= f64::max(DEVIATIONS * error, BLUR * 2.0 * late.abs());
    (is_one_delay && late != 0.0).then(|| late / (model.vehicle.mass * model.vehicle.gravity))
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::Estimate;

    #[test]
    fn equal_and_opposite_forces_are_one_delay() {
        let mut model = Model::thesis();
        let weight_n = model.vehicle.mass * model.vehicle.gravity;
        let mut late = |pitch: f64, roll: f64, effect| {
            model.set(Effect::RateCoupling, &[0.0; 2]);
            let term = model.terms.iter_mut().find(|term| term.effect == Effect::RateCoupling).unwrap();
            term.coefficients =
                [pitch, roll].map(|value| Estimate { value, std_error: Some(0.002) }).to_vec();
            attitude_late_s(&model, effect, &[]).map(|late_s| late_s * weight_n)
        };
        let of_coupling = Effect::RateCoupling;
        assert!((late(-0.058, 0.060, of_coupling).unwrap() - 0.059).abs() < 1e-12);
        assert!((late(0.6, -0.62, of_coupling).unwrap() + 0.61).abs() < 1e-12, "early");
        for (pitch, roll) in [(0.06, 0.06), (-0.06, 0.02), (-0.06, 0.0)] {
            assert_eq!(late(pitch, roll, of_coupling), None, "{pitch} {roll}");
        }
        assert_eq!(late(-0.058, 0.060, Effect::LinearDrag), None);
    }
}
