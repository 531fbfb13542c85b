//! What the law's outputs do to a craft: its mixing and motor map on one side, the model's rotors
//! on the other.

use control::gains::{Config, Law, Mixing};
use control::mixer;
use model::Model;
use nalgebra::Matrix4;

use crate::error::{DesignError, Result};
use crate::plant::{Linear, sign_matrix};

/// What thrust and angular accelerations come of the law's four outputs (thrust, roll, pitch, yaw)
/// about hover at a battery voltage: the law's own mixing and motor map on one side, the model's on
/// the other. The identity where both agree.
pub fn law_effect(model: &Model, linear: &Linear, config: &Config, battery_v: f64) -> Result<Matrix4<f64>> {
    let plant = model::Plant::new(model);
    let rotor = linear.equilibrium.rotor_rad_s;
    let effort_by_speed = Matrix4::from_fn(|i, j| linear.effectiveness[(i, j)] * 2.0 * rotor[j]);
    let numerics = DesignError::Numerics("the law's motor map at hover");
    let speeds_by_output = match &config.law {
        Law::ModelBased(law) => {
            let map = &law.motor_map;
            let (speed, offset) = match map.inverse {
                Some(inverse) => (inverse.speed, inverse.voltage * battery_v + inverse.offset),
                None => (1.0 / map.command, -(map.voltage * battery_v + map.offset) / map.command),
            };
            let flown = |asked: f64| plant.commanded_rad_s(&[speed * asked + offset; 4], battery_v)[0];
            let inverse_mixing = inverse_mixing(&law.mixing)?;
            let mut rows = Matrix4::zeros();
            for i in 0..4 {
                // The map is affine where the motor turns, so two points give it exactly.
                let slope = flown(rotor[i] + 1.0) - flown(rotor[i]);
                let asked = rotor[i] + (rotor[i] - flown(rotor[i])) / slope;
                if !(slope > 0.0 && asked > 0.0) {
                    return Err(numerics);
                }
                for j in 0..4 {
                    rows[(i, j)] = slope * inverse_mixing[i][j] / (2.0 * asked);
                }
            }
            rows
        }
        Law::HandTuned(_) => {
            let command = plant.command_for(&rotor, battery_v);
            let flown = |by: f64| plant.commanded_rad_s(&command.map(|c| c + by), battery_v);
            let (more, less) = (flown(1.0), flown(-1.0));
            let signs = sign_matrix();
            Matrix4::from_fn(|i, j| 0.5 * (more[i] - less[i]) * signs[(i, j)])
        }
    };
    let effect = effort_by_speed * speeds_by_output;
    if effect.iter().all(|x| x.is_finite()) { Ok(effect) } else { Err(numerics) }
}

/// The inverse mixing matrix that a law flies with.
fn inverse_mixing(mixing: &Mixing) -> Result<[[f64; 4]; 4]> {
    let invert = |matrix: &[[f64; 4]; 4]| {
        mixer::inverse(matrix).map_err(|_| DesignError::Numerics("the inverse of the law's mixing matrix"))
    };
    match mixing {
        Mixing::Inverse(inverse) => Ok(*inverse),
        Mixing::Matrix(matrix) => invert(matrix),
        Mixing::Coefficients(coefficients) => invert(&mixer::effectiveness(coefficients)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::TrimTarget;

    /// The thesis' law is made from the thesis' model: 1 of each output is 1 of thrust or angular
    /// acceleration, and nothing of another axis. Its K is printed with 4 to 5 digits. A battery
    /// that the motor map takes out changes nothing.
    #[test]
    fn the_thesis_law_does_what_it_asks_for() {
        let (model, config) = (Model::thesis(), Config::thesis());
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        for battery_v in [10.0, 11.1, 12.6] {
            let effect = law_effect(&model, &linear, &config, battery_v).unwrap();
            let off = (effect - Matrix4::identity()).abs().max();
            assert!(off < 1e-3, "{battery_v} V: {effect}");
        }
    }

    /// A law that commands 1.25 times the speed it means, w' = 1.25 w: it gets its thrust at w /
    /// 1.25, where each unit asked for is 1.25 squared.
    #[test]
    fn a_motor_map_that_is_too_steep_is_gain() {
        let (model, mut config) = (Model::thesis(), Config::thesis());
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        let Law::ModelBased(law) = &mut config.law else { panic!("the thesis' law is model based") };
        let inverse = law.motor_map.inverse.as_mut().unwrap();
        inverse.speed *= 1.25;
        let effect = law_effect(&model, &linear, &config, 11.1).unwrap();
        assert!((0..4).all(|k| (effect[(k, k)] / 1.5625 - 1.0).abs() < 1e-3), "{effect}");
    }
}
