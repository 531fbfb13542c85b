//! The world's physics in the model's terms: which coefficient ought to come out with which value.
//!
//! The model divides forces by the vehicle file's mass, and torques by moments of inertia that it
//! never sees; a thrust arm there is sqrt(2) l, a reaction torque's arm the rotor's radius. What
//! has no such coefficient is left out.

use model::Vehicle;

use super::craft::Craft;
use super::planted::Planted;

/// A coefficient's true value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct True {
    /// Identifier of the effect.
    pub effect: &'static str,
    /// Which of its coefficients.
    pub index: usize,
    /// Value in the model's unit.
    pub value: f64,
}

const ROLL: [f64; 4] = [1.0, -1.0, -1.0, 1.0];
const PITCH: [f64; 4] = [1.0, 1.0, -1.0, -1.0];

pub(super) fn of(craft: &Craft, vehicle: &Vehicle, planted: &[Planted]) -> Vec<True> {
    // What the rotors differ by is no matter of their moments where it has an effect of its own.
    let differences = match planted.iter().any(|planted| planted.id == "unequal-thrust") {
        true => [1.0; 4],
        false => craft.efficiency,
    };
    let mut all = basic(craft, vehicle, differences);
    for planted in planted {
        all.extend(own(craft, vehicle, planted.id));
    }
    all
}

fn list(effect: &'static str, values: impl IntoIterator<Item = f64>) -> impl Iterator<Item = True> {
    values.into_iter().enumerate().map(move |(index, value)| True { effect, index, value })
}

fn basic(craft: &Craft, vehicle: &Vehicle, efficiency: [f64; 4]) -> Vec<True> {
    let beta = vehicle.beta_kg_m();
    let per_mass = vehicle.mass / craft.mass_kg;
    // A product of inertia is a term of its own there: torques are divided by the tensor's
    // diagonal.
    let inertia = craft.inertia_kg_m2.diagonal();
    let mut all = Vec::new();
    all.extend(list("thrust", [craft.thrust_n_s2 / beta * per_mass]));
    all.extend(list("linear-drag", craft.drag_n_s_m.map(|d| -d * per_mass)));
    all.extend(list("angular-damping", (0..3).map(|i| -craft.damping_nm_s[i] / inertia[i])));
    let arm = std::f64::consts::SQRT_2 * vehicle.arm_length * beta;
    let reach = beta * vehicle.rotor_radius;
    let hubs = craft.hubs_m();
    let thrust = |i: usize| efficiency[i] * craft.thrust_n_s2;
    let roll = (0..4).map(|i| -hubs[i][1] * thrust(i) / (inertia.x * arm * ROLL[i]));
    let pitch = (0..4).map(|i| hubs[i][0] * thrust(i) / (inertia.y * arm * PITCH[i]));
    let yaw =
        (0..4).map(|i| craft.spin[i] * craft.torque_efficiency[i] * craft.torque_nm_s2 / (inertia.z * reach));
    all.extend(list("rotor-moments", roll.chain(pitch).chain(yaw)));
    let [x, y, z] = [inertia.x, inertia.y, inertia.z];
    all.extend(list("inertia-coupling", [(y - z) / x, (z - x) / y, (x - y) / z]));
    let rotor = craft.rotor_inertia_kg_m2;
    all.extend(list("gyroscopic", [rotor / x, -rotor / y]));
    all
}

/// The coefficients of a planted effect, where the model means the same by them.
fn own(craft: &Craft, vehicle: &Vehicle, id: &'static str) -> Vec<True> {
    let inertia = craft.inertia_kg_m2.diagonal();
    let values: Vec<f64> = match id {
        "quadratic-drag" => craft.quadratic_drag.map(|d| -d).to_vec(),
        "flapping-moment" => {
            let [pitching, rolling] = craft.flapping_n_s;
            vec![-rolling / inertia.x, pitching / inertia.y]
        }
        "rate-coupling" => craft.rate_coupling_n_s.to_vec(),
        "ground-effect" => vec![craft.ground_gain, craft.ground_offset_m],
        "translational-lift" => vec![craft.translational_lift_s2_m2],
        "thrust-linear" => vec![craft.thrust_n_s / craft.thrust_n_s2],
        "motor-lag" => vec![1.0 / craft.lag_rad_s - 1.0 / vehicle.motors.lag.unwrap_or(f64::INFINITY)],
        "input-delay" => vec![craft.delay_s],
        "rotor-inertia" => vec![craft.spin_up_share * craft.rotor_inertia_kg_m2 / inertia.z],
        "product-of-inertia" => {
            let ixz = -craft.inertia_kg_m2[(0, 2)];
            vec![ixz / inertia.x, ixz / inertia.y, ixz / inertia.z]
        }
        "quadratic-yaw-damping" => vec![-craft.quadratic_yaw_nm_s2 / inertia.z],
        "tether" => craft.tether.map_or_else(Vec::new, |tether| {
            let pull = tether.anchor_ned_m * tether.stiffness_n_m;
            vec![tether.stiffness_n_m, pull.x, pull.y, pull.z]
        }),
        "slung-load" => craft.load.map_or_else(Vec::new, |load| {
            let swing_rad_s = (craft.gravity_m_s2 / load.length_m).sqrt();
            vec![load.mass_kg, load.length_m, 0.5 * load.damping_s / swing_rad_s]
        }),
        "mass-change" => vec![craft.mass_kg - vehicle.mass],
        "com-offset" => craft.centre_m.to_vec(),
        "unequal-thrust" => {
            let [a, b, c, d] = craft.efficiency;
            vec![0.25 * (a - b - c + d), 0.25 * (a + b - c - d), 0.25 * (a - b + c - d)]
        }
        "motor-efficiency" => craft.efficiency.map(|part| 1.0 - part).to_vec(),
        "motor-torque" => craft.torque_efficiency.map(|part| part - 1.0).to_vec(),
        "motor-tilt" => {
            let thrust = craft.thrust_n_s2 / vehicle.beta_kg_m();
            let reach_m = vehicle.rotor_radius * inertia.z;
            let of_rotor = |([x, y], lean): ([f64; 2], [f64; 2])| {
                let [forward, right] = lean.map(|angle| thrust * angle.sin());
                [forward, right, (x * right - y * forward) / reach_m]
            };
            craft.hubs_m().into_iter().zip(craft.lean_rad).flat_map(of_rotor).collect()
        }
        "steady-wind" => vec![craft.wind_ned_m_s.x, craft.wind_ned_m_s.y],
        "wind-shear" => vec![craft.strange.shear_per_s, 0.0],
        "battery-voltage" => vec![craft.map.voltage - vehicle.motors.voltage.unwrap_or(0.0)],
        "attitude-offset" => craft.tilt_rad.to_vec(),
        "tracking-offset" => craft.lever_m.iter().copied().collect(),
        _ => Vec::new(),
    };
    list(id, values).collect()
}
