//! Forms in real flights (shared data): an effect that the catalogue is not allowed to know comes back as a formula. None of the flights
//! is in the repository; the tests pass without them, and say so.

mod common;

use std::path::Path;

use common::shared;
use diagnosis::workflow::{FlightSets, Reading, Silent, discover, identify, prepare_to_discover};
use diagnosis::{Discovery, Options};
use model::{Effect, Vehicle};

/// What flights discover without an effect of the catalogue.
fn discovered(root: &Path, vehicle: &str, [train, held_out]: [&[&str]; 2], without: Effect) -> Discovery {
    prepare_to_discover();
    let vehicle = Vehicle::read(&root.join(vehicle)).unwrap();
    let files =
        |names: &[&str]| names.iter().map(|name| root.join(format!("{name}.csv"))).collect::<Vec<_>>();
    let (train, held_out) = (files(train), files(held_out));
    let mut sets = FlightSets::read(&train, &held_out, &vehicle, Reading::default(), &Silent).unwrap();
    let model = identify(&vehicle, &[], &mut sets, None, &Silent).unwrap().model;
    let options = Options { without: vec![without] };
    discover(&model, &[], &mut sets, &options, &Silent).unwrap()
}

/// On the test stand of those who flew it, the thrust is 13 % larger 6 cm above the floor, 7 % larger at 8 cm, and the same from 14 cm on.
#[test]
#[ignore = "a minute and more: part `real flights` of the night"]
fn the_ground_effect_of_a_small_craft_comes_back_as_a_formula_of_the_height() {
    let Some(root) = shared("data/neuralswarm") else { return };
    let craft = |k: usize| format!("c21_randomwalk_s_cf50_0{k}");
    let names: Vec<String> = (0..5).map(craft).collect();
    let flights: [&[&str]; 2] = [&[&names[0], &names[1], &names[3]], &[&names[2], &names[4]]];
    let discovery = discovered(&root, "vehicle_small.toml", flights, Effect::GroundEffect);
    let best = &discovery.proposals[0];
    assert!(discovery.known.contains(&Effect::BatteryVoltage), "{:?}", discovery.known);
    assert_eq!(best.quantities, ["height"], "{}", best.formula);
    assert!(best.physics.is_some_and(|physics| physics.starts_with("ground effect")), "{}", best.sentence);
    assert_eq!(best.flights_improved, [2, 2]);
    let part = best.sentence.strip_prefix("Extra thrust, up to ").and_then(|rest| rest.split(' ').next());
    let percent: f64 = part.unwrap_or_default().parse().unwrap_or_else(|_| panic!("{}", best.sentence));
    assert!((7.0..15.0).contains(&percent), "{}", best.sentence);
}

#[test]
fn the_thrust_of_brushed_motors_comes_back_as_a_formula_of_the_battery_voltage() {
    let Some(root) = shared("data/nanobench") else { return };
    let flights: [&[&str]; 2] = [
        &[
            "B2_circle_fast_rep1",
            "B3_figure8_fast_rep1",
            "B5_helix_fast_mell_rep1",
            "B7_oval_fast_rep2",
            "B9_trefoil_slow_rep2",
        ],
        &["B2_circle_slow_rep2", "B3_figure8_slow_rep1", "B5_helix_medium_rep1", "B7_oval_medium_rep1"],
    ];
    let discovery = discovered(&root, "vehicle.toml", flights, Effect::BatteryVoltage);
    let best = &discovery.proposals[0];
    assert_eq!(best.quantities, ["vbat"], "{}", best.formula);
    assert_eq!(best.axes, [model::Axis::W]);
    assert_eq!(best.flights_improved, [4, 4]);
}
