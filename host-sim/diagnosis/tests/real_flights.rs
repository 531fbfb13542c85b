//! Real flights whose truth is known (shared data): a quadcopter before a fan wall, small ones with a load on a cable, near the floor, and
//! over each other. None of it is in the repository; the tests pass without it, and say so.

mod common;

use std::path::{Path, PathBuf};

use common::shared;
use diagnosis::workflow::{Explanation, FlightSets, FlightsOfOneKind, Reading, Silent, changed, explain};
use diagnosis::{Diagnosis, Options, Verdict};
use model::{Effect, Model, Vehicle};

fn files(root: &Path, names: &[&str]) -> Vec<PathBuf> {
    names.iter().map(|name| root.join(format!("{name}.csv"))).collect()
}

/// What flights explain, with some of them held out.
fn explained(root: &Path, vehicle: &str, train: &[&str], held_out: &[&str]) -> Explanation {
    let path = root.join(vehicle);
    let vehicle = Vehicle::parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    let (train, held_out) = (files(root, train), files(root, held_out));
    let mut sets = FlightSets::read(&train, &held_out, &vehicle, Reading::default(), &Silent).unwrap();
    explain(&vehicle, &[], &mut sets, &Options::default(), None, &Silent).unwrap()
}

/// What calm flights explain: the craft as it was. No cable holds it, whichever of them is held out.
fn calm(root: &Path, held_out: &str) -> Model {
    let all = ["L1_nowind", "NF-C_nowind", "NF_nowind", "baseline_nowind"];
    let train: Vec<&str> = all.into_iter().filter(|name| *name != held_out).collect();
    let explanation = explained(root, "vehicle.toml", &train, &[held_out]);
    let found = explanation.found();
    assert!(found.contains(&Effect::AttitudeOffset), "{}", explanation.conclusion());
    assert!(!found.contains(&Effect::Tether), "{}", explanation.conclusion());
    explanation.last_model().clone()
}

fn since(model: &Model, root: &Path, names: &[&str]) -> Diagnosis {
    let flights = files(root, names);
    let mut held = FlightsOfOneKind::read(&flights, &model.vehicle, Reading::default(), &Silent).unwrap();
    changed(model, &[], &mut held, &Options::default(), &Silent).unwrap()
}

/// Within a quarter of the wind, which is known in the empty test section alone, or inside three of its own standard errors.
#[test]
fn a_fan_wall_is_a_wind_from_the_north_of_its_own_speed_and_calm_air_is_none() {
    let Some(root) = shared("data/neuralfly") else { return };
    let model = winds_against_calm(&root, "baseline_nowind");
    // Two days: 4.2 and 12.1 m/s, 8.15 in the mean, which one wind for both took for a weak motor. The flights without NF_nowind tell no
    // drag to the side, and with them it still is.
    let diagnosis = since(&model, &root, &["L1_35wind", "NF_100wind"]);
    assert_eq!(diagnosis.best(), Some(Effect::SteadyWind), "{}", diagnosis.summary);
    let north = &diagnosis.effects[0].coefficients[0];
    assert!((north.value + 8.15).abs() < 0.25 * 8.15, "{} +- {} m/s", north.value, north.std_error);
}

#[test]
#[ignore = "minutes: part `real flights` of the night"]
fn a_fan_wall_is_found_against_other_calm_flights_as_well() {
    let Some(root) = shared("data/neuralfly") else { return };
    winds_against_calm(&root, "NF_nowind");
}

/// The model of calm flights, against which three winds are found, each stronger than the one before, and none in the calm flight that
/// was held out.
fn winds_against_calm(root: &Path, held_out: &str) -> Model {
    let model = calm(root, held_out);
    let mut before = 0.0;
    for (name, truth_m_s) in [("NF_35wind", -4.2), ("L1_70wind", -8.5), ("NF_100wind", -12.1)] {
        let diagnosis = since(&model, root, &[name]);
        assert_eq!(diagnosis.best(), Some(Effect::SteadyWind), "{name}: {}", diagnosis.summary);
        let north = &diagnosis.effects[0].coefficients[0];
        let off = (north.value - truth_m_s).abs();
        assert!(
            off < 0.25 * -truth_m_s || off < 3.0 * north.std_error,
            "{name}: {} +- {} m/s",
            north.value,
            north.std_error
        );
        assert!(north.value < before, "{name}: {} m/s is no stronger than {before} m/s", north.value);
        before = north.value;
    }
    assert_eq!(since(&model, root, &[held_out]).best(), None);
    model
}

/// Flights in four winds together: each has its own, and what holds a craft against them is no cable and no center of mass but a drag that
/// grows with the airspeed. What the calm ones have is the tilt of the tracked attitude, which pushes all alike and passes for 2 m/s.
#[test]
#[ignore = "a minute and more: part `real flights` of the night"]
fn winds_that_differ_between_flights_are_the_flights_own() {
    let Some(root) = shared("data/neuralfly") else { return };
    let path = root.join("vehicle.toml");
    let vehicle = Vehicle::parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    let train = files(&root, &["NF-C_nowind", "NF_35wind", "baseline_70wind"]);
    let held_out = files(&root, &["NF_nowind", "NF_100wind"]);
    let mut sets = FlightSets::read(&train, &held_out, &vehicle, Reading::default(), &Silent).unwrap();
    let explanation = explain(&vehicle, &[], &mut sets, &Options::default(), None, &Silent).unwrap();
    let pushes =
        [Effect::Tether, Effect::SteadyWind, Effect::ComOffset, Effect::MassChange, Effect::AttitudeOffset];
    let wrong = explanation.found().into_iter().find(|effect| pushes.contains(effect));
    assert_eq!(wrong, None, "{}", explanation.conclusion());
    assert!(explanation.found().contains(&Effect::QuadraticDrag), "{}", explanation.conclusion());
    let found: Vec<f64> = sets.all().map(|flight| flight.prepared.wind_ned_m_s.x).collect();
    for (found, truth_m_s) in found.iter().zip([0.0, -4.2, -8.5, 0.0, -12.1]) {
        let off = (found - truth_m_s).abs();
        assert!(off < 2.5 && (truth_m_s == 0.0 || off < 0.25 * -truth_m_s), "{found} of {truth_m_s} m/s");
    }
    assert!((found[3] - found[0]).abs() < 1.0 && found[4] < found[2] - 2.0, "{found:?}");
}

/// 5 g on half a metre of cable, and nothing else, whichever of the four flights is held out: in the slowest, the load hardly swings.
#[test]
fn a_load_on_a_cable_is_found_whichever_flight_is_held_out() {
    let Some(root) = shared("data/crazyswarm2") else { return };
    let all = ["log201", "log202", "log203", "log205"];
    for held_out in all {
        let train: Vec<&str> = all.into_iter().filter(|name| *name != held_out).collect();
        let explanation = explained(&root, "vehicle.toml", &train, &[held_out]);
        assert_eq!(explanation.found(), [Effect::SlungLoad], "{held_out}: {}", explanation.conclusion());
        let load = explanation.last_model().term(Effect::SlungLoad).unwrap().values();
        assert!((load[0] - 0.005).abs() < 0.001, "{held_out}: {} kg", load[0]);
        assert!((load[1] - 0.5).abs() < 0.03, "{held_out}: {} m", load[1]);
    }
}

/// The craft without the load has none, and flights with it show one that is heavier.
#[test]
fn a_craft_without_a_load_has_none_and_is_lighter() {
    let Some(root) = shared("data/crazyswarm2") else { return };
    let all = ["log160", "log164", "log166", "log168", "log172", "log176", "log178", "log180"];
    let held_out = ["log164", "log172"];
    let train: Vec<&str> = all.into_iter().filter(|name| !held_out.contains(name)).collect();
    let explanation = explained(&root, "vehicle.toml", &train, &held_out);
    assert!(!explanation.found().contains(&Effect::SlungLoad), "{}", explanation.conclusion());
    let model = explanation.last_model();
    for flights in held_out {
        let diagnosis = since(model, &root, &[flights]);
        assert_eq!(diagnosis.best(), None, "{flights}: {}", diagnosis.summary);
    }
    let loaded = since(model, &root, &["log201", "log202", "log203", "log205"]);
    assert_eq!(loaded.best(), Some(Effect::MassChange), "{}", loaded.summary);
    assert!(loaded.effects[0].coefficients[0].value > 0.003, "{}", loaded.summary);
}

const SPLIT: [&[usize]; 2] = [&[0, 1, 3], &[2, 4]];

/// Two craft close to the floor, with an unknown motor map; and one of them over another craft, whose downwash is in no catalogue.
#[test]
fn thrust_rises_near_the_floor_and_a_downwash_is_unexplained() {
    let Some(root) = shared("data/neuralswarm") else { return };
    let model = near_the_floor(&root, "c21_randomwalk_s_cf50_0");
    let swaps = ["00", "01", "02", "04"].map(|k| format!("c21_swap_ss_cf50_{k}"));
    let swaps: Vec<&str> = swaps.iter().map(String::as_str).collect();
    for flights in swaps.chunks(1).chain([&swaps[..]]) {
        let diagnosis = since(&model, &root, flights);
        assert_eq!(diagnosis.verdict, Verdict::Unexplained, "{flights:?}: {}", diagnosis.summary);
    }
}

#[test]
#[ignore = "minutes: part `real flights` of the night"]
fn thrust_of_a_second_craft_rises_near_the_floor() {
    let Some(root) = shared("data/neuralswarm") else { return };
    near_the_floor(&root, "c23_randomwalk_s_2_cf51_0");
}

/// The model of flights close to the floor.
fn near_the_floor(root: &Path, craft: &str) -> Model {
    let names = SPLIT.map(|split| split.iter().map(|k| format!("{craft}{k}")).collect::<Vec<_>>());
    let [train, held_out] = [0, 1].map(|k| names[k].iter().map(String::as_str).collect::<Vec<_>>());
    let explanation = explained(root, "vehicle_small.toml", &train, &held_out);
    let found = explanation.found();
    assert_eq!(found[..2], [Effect::BatteryVoltage, Effect::GroundEffect], "{}", explanation.conclusion());
    explanation.last_model().clone()
}
