//! Flights of an independent simulator with known hidden effects (shared data): the real commands rank the hidden effect
//! first, and find nothing where nothing is hidden.

mod common;

use std::path::Path;

use common::{json_of_case, run_in, shared};
use serde_json::Value;

/// A folder with the basic model of a case in model.toml.
fn identified(case: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let vehicle = case.join("vehicle.toml").display().to_string();
    json_of_case(folder.path(), &["identify", "--vehicle", &vehicle, "--out", "model.toml"], case);
    folder
}

/// Effects hidden in a case, the stronger first.
fn truth(root: &Path, case: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root.join("truth.json")).unwrap();
    let truth: Value = serde_json::from_str(&text).unwrap();
    let effects = truth[case]["effects"].as_array().unwrap();
    effects.iter().map(|e| e.as_str().unwrap().to_owned()).collect()
}

#[test]
fn hidden_effects_are_ranked_first_one_after_the_other() {
    let Some(root) = shared("data/hidden") else { return };
    for case in ["case-01", "case-02", "case-03", "case-04", "case-05", "case-06"] {
        let flights = root.join(case);
        let folder = identified(&flights);
        let mut model = "model.toml".to_owned();
        for effect in truth(&root, case) {
            let diagnosis = json_of_case(folder.path(), &["diagnose", "--model", &model], &flights);
            assert_eq!(diagnosis["verdict"], "missing-effect", "{case}");
            assert_eq!(diagnosis["effects"][0]["effect"], effect.as_str(), "{case}");
            assert_eq!(diagnosis["effects"][0]["supported"], true, "{case}");
            let better = format!("{effect}.toml");
            let added =
                json_of_case(folder.path(), &["add", &effect, "--model", &model, "--out", &better], &flights);
            assert_eq!(added["supported"], true, "{case}: {effect}");
            model = better;
        }
    }
}

#[test]
fn nothing_is_found_where_nothing_is_hidden() {
    let Some(root) = shared("data/hidden") else { return };
    let flights = root.join("calm");
    let folder = identified(&flights);
    let diagnosis = json_of_case(folder.path(), &["diagnose", "--model", "model.toml"], &flights);
    assert_eq!(diagnosis["verdict"], "adequate", "{diagnosis}");
    assert!(diagnosis["effects"].as_array().unwrap().iter().all(|e| e["supported"] == false));
}

/// What nobody knows is not called by another name: without the tether in the catalogue, what is left depends on the place.
#[test]
fn an_unknown_tether_is_unexplained_and_depends_on_the_position() {
    let Some(root) = shared("data/hidden") else { return };
    let flights = root.join("case-08");
    let folder = identified(&flights);
    let without = ["diagnose", "--model", "model.toml", "--without", "tether"];
    let diagnosis = json_of_case(folder.path(), &without, &flights);
    assert_eq!(diagnosis["verdict"], "unexplained", "{diagnosis}");
    assert!(diagnosis["effects"].as_array().unwrap().iter().all(|e| e["effect"] != "tether"));
    let left = diagnosis["unexplained"].as_array().unwrap();
    let on_place = |u: &Value| {
        ["north position", "east position", "height"].contains(&u["depends_on"].as_str().unwrap())
    };
    assert!(left.iter().any(on_place), "{left:?}");

    let vehicle = flights.join("vehicle.toml").display().to_string();
    let loop_ = ["explain", "--vehicle", &vehicle, "--out", "out.toml", "--without", "tether"];
    let story = json_of_case(folder.path(), &loop_, &flights);
    assert_eq!(story["verdict"], "unexplained", "{story}");
    assert!(story["added"].as_array().unwrap().is_empty());
}

#[test]
fn why_shows_the_evidence_for_and_against() {
    let Some(root) = shared("data/hidden") else { return };
    let flights = root.join("case-01");
    let folder = identified(&flights);
    let why = |effect: &str, model: &str| {
        json_of_case(folder.path(), &["diagnose", "--model", model, "--why", effect], &flights)
    };
    let right = why("ground-effect", "model.toml");
    assert_eq!(right["supported"], true);
    assert!(right["criteria"].as_array().unwrap().iter().all(|c| c["met"] == true));
    assert!(
        right["flights"]
            .as_array()
            .unwrap()
            .iter()
            .all(|f| f["axes"]["w"]["drop_percent"].as_f64().unwrap() > 20.0)
    );
    let wrong = why("translational-lift", "model.toml");
    assert_eq!(wrong["supported"], false);
    assert!(wrong["criteria"].as_array().unwrap().iter().any(|c| c["met"] == false));
    assert_eq!(wrong["found"], serde_json::json!(["ground-effect"]));
    assert!(wrong["drop_percent_beside_found"].as_f64().unwrap() < 1.0);

    // In the model, it is taken out: the same evidence but for where the fits start from.
    json_of_case(
        folder.path(),
        &["add", "ground-effect", "--model", "model.toml", "--out", "with.toml"],
        &flights,
    );
    let inside = why("ground-effect", "with.toml");
    assert_eq!(inside["in_model"], true);
    assert_eq!(inside["supported"], true);
    let value = |why: &Value| why["coefficients"][0]["value"].as_f64().unwrap();
    let half = right["coefficients"][0]["half_width_95"].as_f64().unwrap();
    assert!((value(&inside) - value(&right)).abs() < 0.1 * half);
}

#[test]
fn a_flight_of_another_craft_is_refused() {
    let Some(root) = shared("data") else { return };
    let crazypad = root.join("crazypad");
    let Some(flight) = std::fs::read_dir(&crazypad).ok().and_then(|mut entries| {
        entries.find_map(|e| e.ok().map(|e| e.path()).filter(|p| p.extension().is_some_and(|x| x == "csv")))
    }) else {
        println!("SKIPPED: no flight in {}", crazypad.display());
        return;
    };
    let folder = identified(&root.join("hidden/calm"));
    let flight = flight.display().to_string();
    let output = run_in(folder.path(), &["compare", "--model", "model.toml", "--flights", &flight]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("cmd1") && stderr.contains("vehicle file") && stderr.lines().count() == 1,
        "{stderr}"
    );
}
