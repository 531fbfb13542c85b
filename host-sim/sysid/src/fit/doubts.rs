//! Why a fitted model cannot be the craft's: signs that contradict its geometry or physics, a rotation that explains nothing.

use model::{Axis, Effect, EffectInfo, Kind, Model};
use report::number::{fixed, with_error};

use crate::fit::linearise::residuals_at_rows;
use crate::fit::residuals::{Residuals, errors};
use crate::prepare::Prepared;

/// A coefficient of the basic model whose sign contradicts the craft's geometry or physics by more than its error.
#[derive(Debug, Clone, PartialEq)]
pub struct SignDoubt {
    /// The effect that it belongs to.
    pub effect: Effect,
    /// The axis on which it acts.
    pub axis: Axis,
    /// The coefficient, its value and what to look at.
    pub sentence: String,
    /// How many of its standard errors the value lies beyond zero; without end for one without error.
    pub errors: f64,
}

/// Coefficients of the basic model whose sign contradicts the craft's geometry or physics by more than their error, each as
/// a sentence. A fit with a motor that pushes the wrong way can predict well and is no model: it holds rates and damps
/// them.
pub fn impossible_signs(model: &Model) -> Vec<String> {
    sign_doubts(model).into_iter().map(|doubt| doubt.sentence).collect()
}

/// Whether thrust points up. A term that makes it negative is no effect but a polynomial that happens to fit.
pub fn produces_thrust(model: &Model) -> bool {
    sign_doubts(model).iter().all(|doubt| doubt.effect != Effect::Thrust)
}

/// A model whose rotation explains less than this of every moment row knows nothing of it.
const LEAST_ROTATION_R2: f64 = 0.1;

/// Moment of inertia over mass times arm squared from which on no arm that was measured wrongly explains it: all mass in the motors gives
/// 0.5, an arm of half its length four times as much.
const INERT: f64 = 2.0;

/// Why the rotation is not identifiable from the flights a model was fitted to: rotors that push the wrong way, or moment
/// rows of which nothing is explained. Empty where it is.
pub fn rotation_doubts(model: &Model, flights: &[&Prepared]) -> Vec<String> {
    let mut found = rotor_signs(model);
    let all: Vec<Residuals> = flights.iter().map(|f| residuals_at_rows(f, model, f.fit_stride())).collect();
    let fitted = errors(&all);
    let largest =
        [Axis::P, Axis::Q, Axis::R].map(|axis| fitted[axis].r2).into_iter().fold(f64::MIN, f64::max);
    if largest < LEAST_ROTATION_R2 {
        found.push(format!(
            "motor commands explain {} % of the angular accelerations at best: clocks that drift within flights, or \
             too little excitation",
            fixed(100.0 * largest.max(0.0), 0)
        ));
    }
    found
}

/// Moments of inertia in roll and pitch over mass times arm squared, as thrust and moments of a model give them; nothing without rotation.
pub fn inertia_ratios(model: &Model) -> Option<[f64; 2]> {
    let (thrust, moments) = (model.term(Effect::Thrust)?, model.term(Effect::RotorMoments)?.values());
    let thrust = thrust.coefficients.first()?.value;
    let scale = model.vehicle.mass * model.vehicle.arm_length.powi(2);
    let of = |range: std::ops::Range<usize>| {
        let some = moments.get(range)?;
        // C_i of (2.7) is C_T / (2 I): the thesis' arm is sqrt(2) l, geometry's l / sqrt(2).
        Some(0.5 * thrust * some.len() as f64 / some.iter().sum::<f64>() / scale)
    };
    Some([of(0..4)?, of(4..8)?])
}

/// Whether motors that turn the craft as weakly as a model says could not be those of any craft of its mass and arm, even if these were
/// measured wrongly: their coefficients are not the craft's.
pub fn turns_too_weakly(model: &Model) -> bool {
    inertia_ratios(model)
        .is_some_and(|ratios| ratios.into_iter().any(|ratio| !(0.0..=INERT).contains(&ratio)))
}

/// Rotors that push the wrong way, each as a sentence.
pub fn rotor_signs(model: &Model) -> Vec<String> {
    let of_rotors = sign_doubts(model).into_iter().filter(|doubt| doubt.effect == Effect::RotorMoments);
    of_rotors.map(|doubt| doubt.sentence).collect()
}

/// Coefficients of the basic model with an impossible sign: see [`impossible_signs`].
pub fn sign_doubts(model: &Model) -> Vec<SignDoubt> {
    let spin = model.vehicle.motors.spin.map(|s| s.yaw_sign());
    let rotors = model.rotor_quantity();
    let mut found = Vec::new();
    for term in model.terms.iter().filter(|t| t.effect.info().kind == Kind::Basic) {
        let EffectInfo { axes, coefficients, .. } = term.effect.info();
        for (k, (estimate, info)) in term.coefficients.iter().zip(*coefficients).enumerate() {
            let Some(expected) = info.expected_sign(&spin) else { continue };
            let slack = 2.0 * estimate.std_error.unwrap_or(0.0);
            if estimate.value * expected < -slack {
                let should = if expected > 0.0 { "positive" } else { "negative" };
                found.push(SignDoubt {
                    effect: term.effect,
                    // Each axis has as many coefficients as the others, and they are in its order.
                    axis: axes[k * axes.len() / coefficients.len()],
                    errors: 2.0 * estimate.value.abs() / slack,
                    sentence: format!(
                        "{} = {} should be {should}: {}",
                        info.name,
                        with_error(estimate.value, 0.5 * slack, info.unit_for(rotors)),
                        to_check(term.effect, k)
                    ),
                });
            }
        }
    }
    found
}

/// What can turn the sign of a coefficient of the basic model: of a force, the order of the rotors cannot.
fn to_check(effect: Effect, coefficient: usize) -> &'static str {
    match (effect, coefficient) {
        (Effect::Thrust, _) => {
            "check the sign of z and of az, the clock offset between commands and motion, and the excitation"
        }
        (Effect::LinearDrag, 2) => {
            "check the sign of z, whether an effect of the vertical axis is missing (ground effect, battery voltage), and whether \
             the craft climbs and sinks enough"
        }
        (Effect::LinearDrag, _) => {
            "check the signs of x, y and the attitude, whether there was wind, and whether the craft flies fast enough"
        }
        _ => {
            "check the rotor order and spin in the vehicle file, the clock offset between commands and motion, and the excitation"
        }
    }
}

#[cfg(test)]
mod tests {
    use model::{Estimate, MotorMapKind};

    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn with_thrust(value: f64, std_error: Option<f64>) -> Model {
        let mut model = truth();
        let term = model.terms.iter_mut().find(|t| t.effect == Effect::Thrust).unwrap();
        term.coefficients[0] = Estimate { value, std_error };
        model
    }

    #[test]
    fn a_craft_whose_motors_push_as_they_are_placed_is_possible() {
        assert_eq!(impossible_signs(&truth()), [""; 0]);
        assert!(produces_thrust(&truth()));
    }

    #[test]
    fn a_wrong_sign_counts_beyond_twice_its_error() {
        let sign = truth().term(Effect::Thrust).unwrap().coefficients[0].value.signum();
        for (value, std_error, produces) in
            [(-0.01, None, false), (-0.01, Some(0.004), false), (-0.01, Some(0.006), true), (0.0, None, true)]
        {
            let model = with_thrust(sign * value, std_error);
            assert_eq!(produces_thrust(&model), produces, "{value} {std_error:?}");
        }
    }

    #[test]
    fn the_sentence_gives_value_error_and_what_to_look_at() {
        let model = with_thrust(-0.01, Some(0.002));
        let info = &Effect::Thrust.info().coefficients[0];
        let expected = format!(
            "{} = -0.0100 ± 0.0020 should be positive: check the sign of z and of az, the clock offset between commands \
             and motion, and the excitation",
            info.name
        );
        assert_eq!(impossible_signs(&model), [expected]);
    }

    #[test]
    fn drag_of_the_wrong_sign_is_not_blamed_on_the_rotors() {
        let mut model = truth();
        let term = model.terms.iter_mut().find(|t| t.effect == Effect::LinearDrag).unwrap();
        term.coefficients[2] = Estimate { value: 0.149, std_error: Some(0.058) };
        let [said] = &impossible_signs(&model)[..] else { panic!("one coefficient is impossible") };
        assert!(said.contains("sign of z") && !said.contains("rotor order"), "{said}");
    }

    #[test]
    fn rotors_that_spin_the_other_way_make_the_yaw_of_all_four_impossible() {
        let mut model = truth();
        model.vehicle.motors.spin.rotate_left(1);
        let doubts = sign_doubts(&model);
        assert_eq!(doubts.len(), 4, "{doubts:?}");
        assert!(doubts.iter().all(|doubt| doubt.axis == Axis::R), "{doubts:?}");
        assert_eq!(rotor_signs(&model), impossible_signs(&model));
    }

    #[test]
    fn a_doubt_names_the_axis_on_which_its_coefficient_acts() {
        for (effect, k, axis) in [
            (Effect::LinearDrag, 1, Axis::V),
            (Effect::RotorMoments, 3, Axis::P),
            (Effect::RotorMoments, 4, Axis::Q),
            (Effect::Thrust, 0, Axis::W),
        ] {
            let mut model = truth();
            let mut values = model.term(effect).unwrap().values();
            values[k] *= -1.0;
            model.set(effect, &values);
            let doubts = sign_doubts(&model);
            assert_eq!(doubts.iter().map(|d| (d.effect, d.axis)).collect::<Vec<_>>(), [(effect, axis)]);
        }
        let mut model = truth();
        let drag: Vec<f64> = model.term(Effect::LinearDrag).unwrap().values().iter().map(|c| -c).collect();
        model.set(Effect::LinearDrag, &drag);
        assert_eq!(rotor_signs(&model), [""; 0]);
    }

    /// Of commands or of speeds: the moments of inertia are their ratio to the thrust.
    #[test]
    fn motors_that_hardly_turn_the_craft_are_not_the_craft_s() {
        let mut model = truth();
        let moments = model.term(Effect::RotorMoments).unwrap().values();
        for map in [None, Some(MotorMapKind::Identify)] {
            model.vehicle.motors.map = map;
            for (weaker, too_weak) in [(1.0, false), (3.0, false), (6.0, true)] {
                model.set(Effect::RotorMoments, &moments.iter().map(|c| c / weaker).collect::<Vec<_>>());
                assert_eq!(turns_too_weakly(&model), too_weak, "{weaker}");
            }
        }
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        assert!(!turns_too_weakly(&model) && inertia_ratios(&model).is_none());
    }

    #[test]
    fn a_rotation_that_explains_nothing_is_doubted_and_the_true_one_is_not() {
        let mut model = truth();
        let flight = Prepared::new(&fly(&model, 1, 8.0, &NONE), &model.vehicle).unwrap();
        assert_eq!(rotation_doubts(&model, &[&flight]), [""; 0]);
        let tiny: Vec<f64> =
            model.term(Effect::RotorMoments).unwrap().values().iter().map(|c| 1e-6 * c).collect();
        model.terms.retain(|term| term.effect == Effect::Thrust);
        model.set(Effect::RotorMoments, &tiny);
        assert_eq!(
            rotation_doubts(&model, &[&flight]),
            ["motor commands explain 0 % of the angular accelerations at best: clocks that drift within \
              flights, or too little excitation"]
        );
    }
}
