//! Changes named on real flights whose truth is known (shared data): a quadcopter before a fan wall. None of it is in the repository;
//! the test passes without it, and says so.

mod common;

use std::path::{Path, PathBuf};

use common::shared;
use diagnosis::workflow::{FlightSets, FlightsOfOneKind, Reading, Silent, changed, explain};
use diagnosis::{Diagnosis, Options, Verdict};
use model::{Effect, Model, Vehicle};

fn files(root: &Path, names: &[&str]) -> Vec<PathBuf> {
    names.iter().map(|name| root.join(format!("{name}.csv"))).collect()
}

/// What calm flights explain: the craft as it was.
fn calm(root: &Path) -> Model {
    let path = root.join("vehicle.toml");
    let vehicle = Vehicle::parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
    let train = files(root, &["L1_nowind", "NF-C_nowind", "NF_nowind"]);
    let validate = files(root, &["baseline_nowind"]);
    let mut sets = FlightSets::read(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap();
    let explanation = explain(&vehicle, &[], &mut sets, &Options::default(), None, &Silent).unwrap();
    assert!(explanation.found().contains(&Effect::AttitudeOffset), "{}", explanation.conclusion());
    explanation.last_model().clone()
}

fn since(model: &Model, root: &Path, name: &str) -> Diagnosis {
    let flights = files(root, &[name]);
    let mut held = FlightsOfOneKind::read(&flights, &model.vehicle, Reading::default(), &Silent).unwrap();
    changed(model, &[], &mut held, &Options::default(), &Silent).unwrap()
}

/// Within a quarter of the wind, which is known in the empty test section alone, or inside three of its own standard errors.
#[test]
fn a_fan_wall_is_a_wind_from_the_north_of_its_own_speed_and_calm_air_is_none() {
    let Some(root) = shared("data/neuralfly") else { return };
    let model = calm(&root);
    let mut before = 0.0;
    for (name, truth_m_s) in [("NF_35wind", -4.2), ("L1_70wind", -8.5), ("NF_100wind", -12.1)] {
        let diagnosis = since(&model, &root, name);
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
    assert_eq!(since(&model, &root, "baseline_nowind").verdict, Verdict::Adequate);
}
