//! Flights of an independent simulator with known hidden effects (shared data): the real commands rank the hidden effect
//! first, and find nothing where nothing is hidden.

mod common;

use std::path::Path;

use common::{json_in, run_in, shared};
use serde_json::Value;

fn with_flights(first: &[&str], case: &Path) -> Vec<String> {
    let flight = |name: &str| case.join(format!("{name}.csv")).display().to_string();
    let mut arguments: Vec<String> = first.iter().map(|a| (*a).to_owned()).collect();
    arguments.push("--train".into());
    arguments.extend(["A", "B", "C"].map(flight));
    arguments.push("--validate".into());
    arguments.extend(["D", "E"].map(flight));
    arguments
}

fn json(folder: &Path, first: &[&str], case: &Path) -> Value {
    let arguments = with_flights(first, case);
    json_in(folder, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// A folder with the basic model of a case in model.toml.
fn identified(case: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let vehicle = case.join("vehicle.toml").display().to_string();
    json(folder.path(), &["identify", "--vehicle", &vehicle, "--out", "model.toml"], case);
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
            let diagnosis = json(folder.path(), &["diagnose", "--model", &model], &flights);
            assert_eq!(diagnosis["verdict"], "missing-effect", "{case}");
            assert_eq!(diagnosis["effects"][0]["effect"], effect.as_str(), "{case}");
            assert_eq!(diagnosis["effects"][0]["supported"], true, "{case}");
            let better = format!("{effect}.toml");
            let added = json(folder.path(), &["add", &effect, "--model", &model, "--out", &better], &flights);
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
    let diagnosis = json(folder.path(), &["diagnose", "--model", "model.toml"], &flights);
    assert_eq!(diagnosis["verdict"], "adequate", "{diagnosis}");
    assert!(diagnosis["effects"].as_array().unwrap().iter().all(|e| e["supported"] == false));
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
