//! A craft as simulators of rigid bodies take it: mass, moments of inertia, and four rotors with places, thrust and torque.
//!
//! What each rotor does is read off the model's own equations, so that a simulator's rotor does the same: the rotor stands where its
//! thrust rolls and pitches the craft as the model says, which is near its hub.

use model::{Effect, Model, Plant, RotorQuantity, State, physical_parameters};
use nalgebra::{Matrix4, Vector3, Vector4};

use crate::error::ExportError;

/// A craft as a rigid body. Axes are forward, right, down.
#[derive(Debug, Clone, PartialEq)]
pub struct Craft {
    /// kg.
    pub mass_kg: f64,
    /// About the body axes, kg m^2.
    pub inertia_kg_m2: [f64; 3],
    /// In the order of the commands: front left, front right, rear right, rear left.
    pub rotors: [Rotor; 4],
    /// Thrust of each rotor that holds the craft, N.
    pub hover_n: [f64; 4],
    /// Speed of a rotor at the largest command with the battery of the flights, rad/s.
    pub most_rad_s: f64,
    /// First-order lag of the rotors' speeds, rad/s; nothing where they follow at once or it is unknown.
    pub lag_rad_s: Option<f64>,
    /// Dead time between command and rotor, s.
    pub dead_time_s: f64,
    /// Drag against the air along the body axes, N s/m.
    pub drag_n_s_m: [f64; 3],
    /// m/s^2.
    pub gravity_m_s2: f64,
    /// Radius of the rotors, m.
    pub rotor_radius_m: f64,
}

/// A rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotor {
    /// Where its thrust acts, forward of the center of mass, m.
    pub forward_m: f64,
    /// To the right of it, m.
    pub right_m: f64,
    /// Thrust over the square of its speed, N/(rad/s)^2.
    pub thrust: f64,
    /// Torque about the axis down over the square of its speed, N m/(rad/s)^2: positive turns the nose to the right.
    pub torque: f64,
}

impl Craft {
    /// Of a model.
    ///
    /// # Errors
    /// When the model does not tell enough of the craft.
    pub fn new(model: &Model) -> Result<Self, ExportError> {
        if model.rotor_quantity() == RotorQuantity::Command {
            return Err(ExportError::NoRotorSpeeds);
        }
        let all = physical_parameters(model);
        let value = |symbol: &'static str, name: &'static str, effects: &'static str| {
            let found = all.iter().find(|one| one.symbol == symbol);
            found.map(|one| one.value).ok_or(ExportError::Unknown { symbol, name, effects })
        };
        let mass_kg = value("m", "the mass", "mass-change")?;
        let thrust = value("k_T", "the thrust coefficient of a rotor", "thrust")?;
        let across = "thrust and rotor-moments";
        let inertia_kg_m2 = [
            value("I_xx", "the moment of inertia in roll", across)?,
            value("I_yy", "the moment of inertia in pitch", across)?,
            value("I_zz", "the moment of inertia in yaw", "thrust, rotor-moments and inertia-coupling")?,
        ];
        let sum: f64 = inertia_kg_m2.iter().sum();
        if inertia_kg_m2.iter().any(|own| !(*own > 0.0) || 2.0 * own > sum) {
            return Err(ExportError::NoRigidBody(inertia_kg_m2));
        }
        let gravity_m_s2 = model.vehicle.gravity;
        let weight_n = mass_kg * gravity_m_s2;
        let rotors = rotors(model, mass_kg, &inertia_kg_m2, (weight_n / (4.0 * thrust)).sqrt());
        let adjust = model.adjustments();
        let drag = model.term(Effect::LinearDrag).map_or_else(Vec::new, |term| term.values());
        let largest = model.vehicle.motors.command_range[1];
        Ok(Self {
            mass_kg,
            inertia_kg_m2,
            hover_n: hover_n(&rotors, weight_n).ok_or(ExportError::NoHover)?,
            rotors,
            most_rad_s: Plant::new(model).commanded_rad_s(&[largest; 4], model.reference.battery_v)[0],
            lag_rad_s: adjust.lag_rad_s(model.vehicle.motors.lag),
            dead_time_s: adjust.dead_time_s().max(0.0),
            drag_n_s_m: std::array::from_fn(|axis| -drag.get(axis).copied().unwrap_or(0.0)),
            gravity_m_s2,
            rotor_radius_m: model.vehicle.rotor_radius,
        })
    }

    /// Mean thrust coefficient of the rotors, N/(rad/s)^2.
    pub fn mean_thrust(&self) -> f64 {
        self.rotors.iter().map(|rotor| rotor.thrust).sum::<f64>() / 4.0
    }

    /// Mean of the sizes of their torque coefficients, N m/(rad/s)^2.
    pub fn mean_torque(&self) -> f64 {
        self.rotors.iter().map(|rotor| rotor.torque.abs()).sum::<f64>() / 4.0
    }
}

/// What each rotor does by itself, as the effects of [`is_of_rotors`] have it.
fn rotors(model: &Model, mass_kg: f64, inertia_kg_m2: &[f64; 3], speed_rad_s: f64) -> [Rotor; 4] {
    let mut own = model.clone();
    own.terms.retain(|term| is_of_rotors(term.effect));
    let plant = Plant::new(&own);
    let by = |rotors: [f64; 4]| {
        let state = State::at_rest(Vector3::zeros(), rotors);
        plant.accelerations(&plant.sample_of(&plant.input(&state, &rotors, model.reference.battery_v)))
    };
    let still = by([0.0; 4]);
    std::array::from_fn(|k| {
        let mut alone = [0.0; 4];
        alone[k] = speed_rad_s;
        let turning = by(alone);
        let per_square = |row: usize| (turning[row] - still[row]) / (speed_rad_s * speed_rad_s);
        let thrust = -per_square(2) * mass_kg;
        let moment = |axis: usize| per_square(3 + axis) * inertia_kg_m2[axis];
        // A force up at the right rolls to the left, one in front pitches up.
        Rotor { forward_m: moment(1) / thrust, right_m: -moment(0) / thrust, thrust, torque: moment(2) }
    })
}

/// The thrusts of rotors that carry a weight without a moment, N; nothing where one of them would have to push down.
pub(crate) fn hover_n(rotors: &[Rotor; 4], weight_n: f64) -> Option<[f64; 4]> {
    let per_n =
        rotors.map(|rotor| Vector4::new(1.0, rotor.forward_m, rotor.right_m, rotor.torque / rotor.thrust));
    let thrusts = Matrix4::from_columns(&per_n).lu().solve(&Vector4::new(weight_n, 0.0, 0.0, 0.0))?;
    thrusts.iter().all(|thrust| *thrust > 0.0).then(|| thrusts.into())
}

/// Whether places, thrust and torque of rotors say all of an effect.
pub(crate) fn is_of_rotors(effect: Effect) -> bool {
    let of_all =
        matches!(effect, Effect::Thrust | Effect::RotorMoments | Effect::ComOffset | Effect::MassChange);
    of_all || differs_by_rotor(effect) || effect == Effect::MotorTorque
}

/// Whether an effect gives the rotors different thrusts at the same speed.
pub(crate) fn differs_by_rotor(effect: Effect) -> bool {
    matches!(effect, Effect::UnequalThrust | Effect::MotorEfficiency)
}

/// What a rigid body makes of the coupling of the rates.
pub(crate) fn rigid_coupling(craft: &Craft, model: &Model) -> Option<String> {
    let [x, y, z] = craft.inertia_kg_m2;
    let told = |values: &[f64]| {
        let named = ["p", "q", "r"].into_iter().zip(values);
        named
            .map(|(axis, value)| format!("{axis} {}", report::significant(*value, 3)))
            .collect::<Vec<_>>()
            .join(", ")
    };
    Some(format!(
        "the gyroscopic coupling is that of a rigid body with these moments of inertia ({}) instead of the model's ({})",
        told(&[(y - z) / x, (z - x) / y, (x - y) / z]),
        told(&model.term(Effect::InertiaCoupling)?.values())
    ))
}
