//! Any model file can be flown: one with a user's effect too, and a formula without a value ends
//! the flight with a line that names it.

use std::path::Path;
use std::process::{Command, Output};

use control::supervision_limits::Fence;
use model::{Model, user_effect};
use serde_json::Value;
use sil::{FlightPlan, SilError, fly};

fn with_effect(folder: &Path, id: &str, formula: &str, unit: &str, value: f64) -> Model {
    let path = folder.join("my.toml");
    let text = format!(
        "[[effect]]\nid = \"{id}\"\nacceleration.north = \"{formula}\"\n\
         coefficient = [{{ name = \"k\", unit = \"{unit}\", possible = [-10.0, 10.0], typical = 1.0 }}]\n\
         constant = [{{ name = \"low\", unit = \"m\", value = 0.8 }}]\n"
    );
    std::fs::write(&path, text).unwrap();
    let effect = user_effect::read(&path).unwrap()[0];
    let mut model = Model::thesis();
    model.set(effect, &[value]);
    model
}

fn sil(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sil")).current_dir(folder).args(arguments).output().unwrap()
}

#[test]
fn a_model_with_a_users_effect_flies() {
    let folder = tempfile::tempdir().unwrap();
    // A cable to the middle, soft enough for the loops.
    let model = with_effect(folder.path(), "soft-cable", "-k * north / mass", "N/m", 0.5);
    std::fs::write(folder.path().join("model.toml"), model.to_toml()).unwrap();
    let step = |model: &[&str]| -> Value {
        let arguments = [&["--scenario", "x-1", "--json", "--out", "out"], model].concat();
        let output = sil(folder.path(), &arguments);
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let (with, without) = (step(&["--model", "model.toml"]), step(&[]));
    assert_eq!(with["scenarios"][0]["lost_control"], false, "{with}");
    assert_ne!(with["pwm_sha256"], without["pwm_sha256"]);
    // It holds against 0.5 N at the end of the step: the response is another, and not by a little.
    let last = |json: &Value| json["scenarios"][0]["samples"][8][1].as_f64().unwrap();
    assert!((last(&with) - last(&without)).abs() > 0.02, "{} {}", last(&with), last(&without));
}

#[test]
fn a_formula_without_a_value_ends_the_flight_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let model = with_effect(folder.path(), "own", "k * sqrt(height - low)", "m^0.5/s^2", 0.1);
    let mut plan = FlightPlan::thesis_step(sil::StepAxis::Z, 0.5);
    plan.model = model.clone();
    let SilError::Undefined { undefined, time_s } = fly(&plan).unwrap_err() else { panic!("another error") };
    assert_eq!((undefined.row.as_str(), undefined.effect.id()), ("north", "own"));
    // 0.2 m of the 0.5 m that it sinks after 1 s.
    assert!((1.1..3.0).contains(&time_s), "{time_s}");
    // Higher up there is nothing to object to.
    plan = FlightPlan::thesis_step(sil::StepAxis::Z, -0.5);
    plan.model = model.clone();
    // The push north goes on for twenty seconds.
    plan.config.supervision.fence = Fence::NONE;
    assert!(fly(&plan).unwrap().complete);

    std::fs::write(folder.path().join("model.toml"), model.to_toml()).unwrap();
    let output = sil(folder.path(), &["--scenario", "excitation", "--model", "model.toml", "--out", "out"]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("\"k * sqrt(height - low)\" is not a finite number"), "{stderr}");
}

#[test]
fn models_that_cannot_be_flown_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = Model::thesis().to_toml();
    for (from, to, expected) in [
        ("command_range = [1000.0, 2000.0]", "command_range = [0.0, 1.0]", "command_range: is [0.0, 1.0]"),
        ("id = \"thrust\"", "id = \"trust\"", "unknown effect"),
    ] {
        assert!(text.contains(from), "{text}");
        std::fs::write(folder.path().join("model.toml"), text.replacen(from, to, 1)).unwrap();
        let output = sil(folder.path(), &["--scenario", "hover", "--model", "model.toml", "--out", "out"]);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains("model.toml") && stderr.contains(expected), "{stderr}");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
    }
}

/// The thesis' gains from their file are the thesis' gains: not a bit of a flight differs. Those of
/// another vehicle, by name, by what was measured of it or by what they do on the model, are
/// refused with one line and status 2.
#[test]
fn gains_files_fly_and_those_of_another_vehicle_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let thesis = include_str!("../../model/vehicles/f330-gains.toml");
    write("thesis.toml", thesis);
    let hash = |gains: &[&str]| {
        let output = sil(folder.path(), &[&["--scenario", "y-1", "--json", "--out", "out"], gains].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        json["pwm_sha256"].as_str().unwrap().to_owned()
    };
    assert_eq!(hash(&["--gains", "thesis.toml"]), hash(&[]));

    let named = "vehicle = \"F330 (thesis)\"";
    assert!(thesis.contains(named));
    write("name.toml", &thesis.replace(named, "vehicle = \"F450\""));
    write("hash.toml", &thesis.replace(named, &format!("{named}\nvehicle_sha256 = \"{}\"", "0".repeat(64))));
    write("hover.toml", &thesis.replace("hover_thrust_n = 11.9093", "hover_thrust_n = 5.0"));
    write("broken.toml", &thesis.replace("anti_windup", "anti_windupp"));
    let mut heavy = Model::thesis();
    heavy.vehicle.mass *= 2.0;
    write("heavy-model.toml", &heavy.to_toml());
    for (gains, model, expected) in [
        ("name.toml", None, "they are for \"F450\""),
        ("hash.toml", None, "with other measurements"),
        ("hover.toml", None, "hover_thrust_n"),
        ("broken.toml", None, "anti_windupp"),
        ("missing.toml", None, "cannot read"),
        ("thesis.toml", Some("heavy-model.toml"), "hover_thrust_n"),
    ] {
        let model = model.map_or(vec![], |model| vec!["--model", model]);
        let output = sil(folder.path(), &[&["--gains", gains, "--out", "out"], &model[..]].concat());
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), stderr.lines().count()), (Some(2), 1), "{gains}: {stderr}");
        assert!(stderr.contains(gains) && stderr.contains(expected), "{gains}: {stderr}");
    }
}
