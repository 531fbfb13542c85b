//! Rotor speed follows the battery voltage in a way the motor map leaves out: speed = map + k (V - V_ref - shift), (4.10).
//! V_ref is the mean voltage of the training flights, kept in the model file; V_ref + shift is where the map is right.

use crate::{Adjustments, Axis, Coefficient, EffectInfo, Kind, Question};

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "battery-voltage",
    sentence: "Thrust follows the battery voltage in a way the motor map leaves out.",
    kind: Kind::Adjusting,
    question: Question::Both,
    axes: &[Axis::W, Axis::P, Axis::Q, Axis::R],
    coefficients: &[
        Coefficient {
            name: "speed_per_volt",
            unit: "rad/s/V",
            possible: (-2000.0, 2000.0),
            typical: 40.0,
            prior: None,
        },
        // A map is measured somewhere between a full and an empty battery: a volt or two from the mean.
        Coefficient { name: "voltage_shift", unit: "V", possible: (-50.0, 50.0), typical: 1.0, prior: Some(1.5) },
    ],
    excitation: "fly from a full battery to an empty one",
    confused_with: &[("mass-change", "fly on: a heavier craft stays heavier, a battery goes on falling")],
};

pub(super) fn adjust(c: &[f64], adjust: &mut Adjustments) {
    adjust.rotor_speed_per_volt = c[0];
    adjust.reference_voltage_v += c[1];
}
