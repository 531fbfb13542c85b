//! A rotor whose thrust leans (`motor-tilt`): whether the yaw it is said to cause is that of its sideways push, and by what angle it leans.

use model::{Effect, Group, Model, PhysicalParameter, Verdict, physical_parameters};

use crate::change::Change;
use crate::finding::CoefficientFigures;

/// By what part the yaw may differ from the lever times the sideways push: what bends an arm moves the rotor too.
const LEVER_PART: f64 = 0.2;
/// The moment of inertia about z of a craft over that of a flat body, and by what part it may differ, where the couplings do not tell it better.
const FLAT_SHARE: f64 = 0.75;
const FLAT_PART: f64 = 0.25;
/// By what part of a rotor's reaction torque it may differ: what bends an arm can damage the propeller.
const TORQUE_PART: f64 = 0.1;
/// And by how many standard errors.
const ERRORS: f64 = 3.0;

/// What is asked of a rotor that leans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Leaning {
    /// How far its yaw is from what its sideways push gives, as a share of what is allowed, percent.
    pub(crate) difference_percent: f64,
    /// Its sideways push over the standard error, the larger of forward and right.
    pub(crate) push_errors: f64,
    /// Its yaw as a share of a rotor's reaction torque, less its errors, percent.
    pub(crate) yaw_percent: f64,
    /// Whether its push by itself says nothing: the model leaves the translation of its own flights unexplained.
    pub(crate) push_is_doubted: bool,
}

/// Least push of a leaning rotor, standard errors: without one, it is a torque.
pub(crate) const PUSH_ERRORS: f64 = 5.0;
/// Least yaw of a leaning rotor that says something by itself, percent of a reaction torque.
pub(crate) const YAW_PERCENT: f64 = 100.0 * TORQUE_PART;

/// Largest change of a reaction torque, as a part of it, that a propeller which still lifts has.
pub(crate) const PROPELLER_TORQUE: f64 = 0.3;

/// Holds the yaw of a rotor against its push. A wind, a tilted tracker or the offset of an accelerometer pushes without the yaw; a damaged
/// propeller yaws without the push. Nothing for other changes.
pub(crate) fn leaning(model: &Model, change: Change, coefficients: &[CoefficientFigures]) -> Option<Leaning> {
    let motor = usize::from(change.motor.filter(|_| change.effect == Effect::MotorTilt)?) - 1;
    let [forward, right, yaw] = coefficients else { return None };
    let [x, y] = model.vehicle.hubs_m()[motor];
    let physical = physical_parameters(model);
    let inertia = yaw_inertia(&physical)?;
    let per_push = 1.0 / (model.vehicle.rotor_radius * inertia.kg_m2);
    let by_lever = per_push * (x * right.value - y * forward.value);
    let error = yaw.std_error.hypot(per_push * (x * right.std_error).hypot(y * forward.std_error));
    // A mean coefficient of (2.7) about z, as the yaw has it.
    let reach_kg_m2 = model.vehicle.beta_kg_m() * model.vehicle.rotor_radius;
    let torque = find(&physical, "k_Q/I_zz")?.value / reach_kg_m2;
    let allowed = (LEVER_PART + inertia.part) * by_lever.abs() + TORQUE_PART * torque + ERRORS * error;
    let verdicts = model.fit.as_ref().and_then(|fit| fit.verdicts);
    let firm = |push: &CoefficientFigures| push.value.abs() / push.std_error.max(f64::MIN_POSITIVE);
    Some(Leaning {
        push_errors: firm(forward).max(firm(right)),
        difference_percent: 100.0 * (yaw.value - by_lever).abs() / allowed.max(f64::MIN_POSITIVE),
        yaw_percent: 100.0 * (yaw.value.abs() - ERRORS * yaw.std_error) / torque,
        push_is_doubted: verdicts.is_some_and(|of| of[Group::Translation] == Verdict::Unexplained),
    })
}

/// By how much the thrust of a rotor leans, and where to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lean {
    /// From the body's -z, deg.
    pub(crate) angle_deg: f64,
    /// Direction of the push: clockwise from ahead, seen from above, deg.
    pub(crate) towards_deg: f64,
}

/// By how much the thrust of a rotor leans, by the three coefficients of `motor-tilt`; nothing where the model has no thrust.
/// With what the model has of it already.
pub(crate) fn lean(model: &Model, motor: u8, coefficients: &[CoefficientFigures]) -> Option<Lean> {
    let thrust = model.term(Effect::Thrust)?.values()[0];
    let [forward, right, _] = coefficients else { return None };
    let change = Change { effect: Effect::MotorTilt, motor: Some(motor) };
    let own = model.term(Effect::MotorTilt).map(model::Term::values);
    let known = |k: usize| own.as_ref().map_or(0.0, |own| own[change.coefficients()[k]]);
    let [forward, right] = [forward.value + known(0), right.value + known(1)].map(|push| push / thrust);
    let angle_deg = forward.hypot(right).atan().to_degrees();
    Some(Lean { angle_deg, towards_deg: right.atan2(forward).to_degrees() })
}

/// Moment of inertia about z, and the part of it within which it is known.
struct YawInertia {
    kg_m2: f64,
    part: f64,
}

/// By the couplings of the rates where these tell it, and otherwise as a share of the sum of the two across it, which a flat body has.
fn yaw_inertia(physical: &[PhysicalParameter]) -> Option<YawInertia> {
    let flat_kg_m2 = find(physical, "I_xx")?.value + find(physical, "I_yy")?.value;
    let known = find(physical, "I_zz").and_then(|inertia| {
        let part = ERRORS * inertia.std_error? / inertia.value;
        (part < FLAT_PART && inertia.value < flat_kg_m2).then_some(YawInertia { kg_m2: inertia.value, part })
    });
    Some(known.unwrap_or(YawInertia { kg_m2: FLAT_SHARE * flat_kg_m2, part: FLAT_PART }))
}

fn find<'a>(physical: &'a [PhysicalParameter], symbol: &str) -> Option<&'a PhysicalParameter> {
    physical.iter().find(|parameter| parameter.symbol == symbol)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(index: usize, value: f64) -> CoefficientFigures {
        CoefficientFigures::of_change((Effect::MotorTilt, index), value, 1e-3 * value.abs(), &Model::thesis())
    }

    /// A force at a hub, by hand: N = x F_y - y F_x.
    #[test]
    fn the_yaw_of_one_force_at_a_hub_fits_that_hub_alone() {
        let model = Model::thesis();
        let thrust = model.term(Effect::Thrust).unwrap().values()[0];
        let moments = model.term(Effect::RotorMoments).unwrap().values();
        let mean = |axis: usize| moments[4 * axis..4 * axis + 4].iter().sum::<f64>() / 4.0;
        let inertia_kg_m2 = FLAT_SHARE * (thrust / (2.0 * mean(0)) + thrust / (2.0 * mean(1)));
        // Motor 2, ahead on the right, leans by 10 deg straight to the right.
        let push = thrust * 10_f64.to_radians().tan();
        let x = model.vehicle.arm_length / 2_f64.sqrt();
        let yaw = x * push / (model.vehicle.rotor_radius * inertia_kg_m2);
        let found = [figures(3, 0.0), figures(4, push), figures(5, yaw)];
        let by = |motor| {
            let change = Change { effect: Effect::MotorTilt, motor: Some(motor) };
            leaning(&model, change, &found).unwrap().difference_percent
        };
        assert!(by(1) < 1e-6 && by(2) < 1e-6, "ahead");
        assert!(by(3) > 100.0 && by(4) > 100.0, "behind: {} {}", by(3), by(4));
        let without_yaw = [figures(3, 0.0), figures(4, push), figures(5, 0.0)];
        let change = Change { effect: Effect::MotorTilt, motor: Some(2) };
        assert!(leaning(&model, change, &without_yaw).unwrap().difference_percent > 100.0);
        let lean = lean(&model, 2, &found).unwrap();
        assert!((lean.angle_deg - 10.0).abs() < 1e-9 && (lean.towards_deg - 90.0).abs() < 1e-9, "{lean:?}");
    }

    #[test]
    fn of_other_changes_nothing_is_asked() {
        let change = Change { effect: Effect::MotorEfficiency, motor: Some(2) };
        assert_eq!(leaning(&Model::thesis(), change, &[figures(0, 1.0)]), None);
        let all = Change { effect: Effect::MotorTilt, motor: None };
        assert_eq!(leaning(&Model::thesis(), all, &[]), None);
    }
}
