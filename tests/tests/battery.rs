//! The battery between commands and thrust: what a voltage that sags and a noisy voltmeter must not
//! do to a fit.
#![forbid(unsafe_code)]

use model::{Effect, Model};
use stories::world::{Pattern, Sensors, Size, World};
use sysid::{Prepared, fit};

fn identified(world: &World, sensors: &Sensors, effects: &[Effect]) -> Model {
    let flights = Pattern::TRAIN.map(|pattern| world.fly(pattern, 24.0, sensors, 0).unwrap());
    let prepared = flights.map(|flight| Prepared::new(&flight, &world.vehicle).unwrap());
    let all: Vec<&Prepared> = prepared.iter().collect();
    fit(&all, &world.vehicle, effects, None).unwrap().model
}

fn truth(world: &World, effect: Effect, index: usize) -> f64 {
    world.truth().iter().find(|t| t.effect == effect.id() && t.index == index).unwrap().value
}

/// The voltage acts on the motors all the while. Taken as it was at the start of each sample, the
/// sag (a tenth of the loop from rotor speed to rotor speed) is half a sample late, and the
/// vertical drag 0.7 % off.
#[test]
fn a_sagging_battery_does_not_show_as_drag() {
    for seed in [11, 22, 33] {
        let world = World::new(Size::F330, seed);
        let basic: Vec<Effect> = Effect::basic().collect();
        let model = identified(&world, &Sensors::noisy(0.02), &basic);
        let drag = model.term(Effect::LinearDrag).unwrap().coefficients[2].value;
        let ratio = drag / truth(&world, Effect::LinearDrag, 2);
        // The filters' own error is 0.08 %.
        assert!((ratio - 1.0).abs() < 2e-3, "seed {seed}: {ratio}");
    }
}

/// A voltmeter with 36 mV of noise pulls the coefficient of the voltage to zero by what noise is
/// left in: by 0.65 % with a smoother short enough for the sag.
#[test]
fn a_noisy_voltmeter_does_not_shrink_the_coefficient_of_the_voltage() {
    let mut ratios = Vec::new();
    for seed in [1, 2, 3, 4] {
        let world = World::new(Size::F330, seed).with("battery-voltage", 1.0).unwrap();
        let effects: Vec<Effect> = Effect::basic().chain([Effect::BatteryVoltage]).collect();
        let model = identified(&world, &Sensors::noisy(2.4), &effects);
        let found = model.term(Effect::BatteryVoltage).unwrap().coefficients[0];
        ratios.push(found.value / truth(&world, Effect::BatteryVoltage, 0));
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    // Seeds scatter by 0.5 %, their mean by half of that.
    assert!((mean - 1.0).abs() < 5e-3, "{mean} of {ratios:?}");
}
