//! The same physics in the model's terms: which coefficient ought to come out with which value.
//!
//! The model divides forces by the vehicle file's mass, and torques by moments of inertia that it never sees; a thrust
//! arm there is sqrt(2) l, a reaction torque's arm the rotor's radius. What has no such coefficient is left out.

use nalgebra::Vector3;

use super::World;

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

pub(super) fn of(world: &World) -> Vec<True> {
    let mut all = basic(world);
    for planted in &world.planted {
        all.extend(own(world, planted.id));
    }
    all
}

fn list(effect: &'static str, values: impl IntoIterator<Item = f64>) -> impl Iterator<Item = True> {
    values.into_iter().enumerate().map(move |(index, value)| True { effect, index, value })
}

fn basic(world: &World) -> Vec<True> {
    let (craft, vehicle) = (&world.craft, &world.vehicle);
    let beta = vehicle.beta_kg_m();
    let carried = craft.mass_kg;
    let per_mass = vehicle.mass / carried;
    let inertia = craft.inertia_kg_m2;
    let inverse = inertia.try_inverse().unwrap_or_default();
    let mut all = Vec::new();
    all.extend(list("thrust", [craft.thrust_n_s2 / beta * per_mass]));
    all.extend(list("linear-drag", craft.drag_n_s_m.map(|d| -d * per_mass)));
    let damping = craft.damping_nm_s;
    all.extend(list("angular-damping", (0..3).map(|i| -damping[i] * inverse[(i, i)])));
    let arm = std::f64::consts::SQRT_2 * vehicle.arm_length * beta;
    let reach = beta * vehicle.rotor_radius;
    let turned: Vec<Vector3<f64>> = (0..4)
        .map(|i| {
            let [x, y] = craft.hubs_m()[i];
            let (thrust, reaction) = (craft.thrust_n_s2, craft.spin[i] * craft.torque_nm_s2);
            craft.efficiency[i] * (inverse * Vector3::new(-y * thrust, x * thrust, reaction))
        })
        .collect();
    let roll = (0..4).map(|i| turned[i].x / (arm * ROLL[i]));
    let pitch = (0..4).map(|i| turned[i].y / (arm * PITCH[i]));
    let yaw = (0..4).map(|i| turned[i].z / reach);
    all.extend(list("rotor-moments", roll.chain(pitch).chain(yaw)));
    if inertia[(0, 2)] == 0.0 {
        let [x, y, z] = [inertia[(0, 0)], inertia[(1, 1)], inertia[(2, 2)]];
        all.extend(list("inertia-coupling", [(y - z) / x, (z - x) / y, (x - y) / z]));
        let rotor = craft.rotor_inertia_kg_m2;
        all.extend(list("gyroscopic", [rotor / x, -rotor / y]));
    }
    all
}

/// The coefficients of a planted effect, where the model means the same by them.
fn own(world: &World, id: &'static str) -> Vec<True> {
    let (craft, vehicle) = (&world.craft, &world.vehicle);
    let inertia = craft.inertia_kg_m2.diagonal();
    let values: Vec<f64> = match id {
        "quadratic-drag" => craft.quadratic_drag.map(|d| -d).to_vec(),
        "flapping-moment" => {
            let [pitching, rolling] = craft.flapping_n_s;
            vec![-rolling / inertia.x, pitching / inertia.y]
        }
        "rate-coupling" => craft.rate_coupling_n_s.to_vec(),
        "ground-effect" => vec![craft.ground_gain],
        "steady-wind" => vec![craft.wind_ned_m_s.x, craft.wind_ned_m_s.y],
        "battery-voltage" => vec![craft.map.voltage - vehicle.motors.voltage.unwrap_or(0.0)],
        "attitude-offset" => craft.tilt_rad.to_vec(),
        "tracking-offset" => craft.lever_m.iter().copied().collect(),
        _ => Vec::new(),
    };
    list(id, values).collect()
}
