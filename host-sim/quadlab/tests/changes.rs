//! `quadlab diagnose --changed` on flights that nobody here made (shared data): a simulated craft with a weak motor, and two real
//! ones with a weight at a motor and cut propellers.

mod common;

use std::path::{Path, PathBuf};

use common::{copies, done_in, identify, json_in, run_in, shared};
use serde_json::Value;

fn paths(files: &[PathBuf]) -> impl Iterator<Item = String> {
    files.iter().map(|file| file.display().to_string())
}

/// Identifies a craft from its flights as it was; the model is model.toml in the folder.
fn identified(vehicle: &Path, train: &[PathBuf], validate: &[PathBuf]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut arguments: Vec<String> = ["identify", "--vehicle"].map(str::to_owned).to_vec();
    arguments.push(vehicle.display().to_string());
    arguments.push("--train".into());
    arguments.extend(paths(train));
    arguments.push("--validate".into());
    arguments.extend(paths(validate));
    arguments.extend(["--out", "model.toml"].map(str::to_owned));
    // With warnings: such slow flights do not excite everything.
    done_in(folder.path(), &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    folder
}

fn changed(folder: &Path, flights: &[PathBuf]) -> Value {
    let mut arguments: Vec<String> =
        ["diagnose", "--model", "model.toml", "--changed"].map(str::to_owned).to_vec();
    arguments.extend(paths(flights));
    json_in(folder, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn a_weak_motor_is_named_with_its_loss() {
    let Some(case) = shared("data/hidden/case-07") else { return };
    let flights = |folder: &Path, names: &[&str]| -> Vec<PathBuf> {
        names.iter().map(|name| folder.join(format!("{name}.csv"))).collect()
    };
    let base = case.join("base");
    let folder = identified(
        &case.join("vehicle.toml"),
        &flights(&base, &["A", "B", "C"]),
        &flights(&base, &["D", "E"]),
    );
    let diagnosis = changed(folder.path(), &flights(&case, &["A", "B", "C", "D", "E"]));
    assert_eq!(diagnosis["verdict"], "missing-effect");
    let best = &diagnosis["effects"][0];
    assert_eq!(best["effect"], "motor-efficiency");
    assert_eq!(best["motor"], 2);
    let loss = &best["coefficients"][0];
    let (value, error) = (loss["value"].as_f64().unwrap(), loss["std_error"].as_f64().unwrap());
    // truth.json: eff2 = 0.86.
    assert!((value - 0.14).abs() < 1.96 * error, "{value} +- {error}");
    assert!(error < 0.02, "{error}");

    let flights = flights(&case, &["A", "B", "C", "D", "E"]);
    why_and_without(folder.path(), &flights, &diagnosis);
    let mut arguments: Vec<String> =
        ["diagnose", "--model", "model.toml", "--html", "page.html", "--changed"].map(str::to_owned).to_vec();
    arguments.extend(paths(&flights));
    done_in(folder.path(), &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    for said in [
        "<h1>What has changed?</h1>",
        "The change: motor-efficiency 2",
        "the change was there from the first of them (A.csv) on",
        "What else it could be",
        // The weak motor was hidden in all five flights, and each has its error without and with it.
        "Root mean square error of each flight",
    ] {
        assert!(page.contains(said), "{said}");
    }
}

/// Of the weak motor, the evidence is that of four motors; without it, there are four candidates fewer.
fn why_and_without(folder: &Path, flights: &[PathBuf], diagnosis: &Value) {
    let asked = |option: &str| {
        let first = ["diagnose", "--model", "model.toml", option, "motor-efficiency", "--changed"];
        let mut arguments: Vec<String> = first.map(str::to_owned).to_vec();
        arguments.extend(paths(flights));
        json_in(folder, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let why = asked("--why");
    assert_eq!(why["found"], "motor-efficiency");
    let motors = why["changes"].as_array().unwrap();
    assert_eq!(motors.iter().map(|c| c["motor"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 2, 3, 4]);
    let weak = &motors[1];
    assert_eq!(weak["supported"], true, "{}", weak["summary"]);
    assert!(weak["criteria"].as_array().unwrap().iter().all(|c| c["met"] == true));
    assert_eq!(weak["coefficients"][0]["value"], diagnosis["effects"][0]["coefficients"][0]["value"]);
    assert_eq!(weak["flights"].as_array().unwrap().len(), flights.len());

    let without = asked("--without");
    let all = |diagnosis: &Value| diagnosis["effects"].as_array().unwrap().clone();
    let (fewer, before) = (all(&without), all(diagnosis));
    assert_eq!(fewer.len() + 4, before.len());
    assert!(fewer.iter().all(|finding| finding["effect"] != "motor-efficiency"));
    // Each p-value counts the candidates.
    let p_value = |findings: &[Value], effect: &str| {
        findings.iter().find(|f| f["effect"] == effect).map(|f| f["p_value"].as_f64().unwrap())
    };
    let part = fewer.len() as f64 / before.len() as f64;
    for finding in &fewer {
        let effect = finding["effect"].as_str().unwrap();
        let [now, then] = [&fewer, &before].map(|all| p_value(all, effect).unwrap());
        assert!(then == 1.0 || (now - part * then).abs() <= 1e-9 * then, "{effect}: {now} {then}");
    }
}

#[test]
fn a_change_that_is_not_there_has_its_evidence_and_what_can_be_no_change_is_refused() {
    let folder = copies();
    identify(folder.path());
    let why = |effect| {
        run_in(
            folder.path(),
            &["diagnose", "--model", "model.toml", "--changed", "D.csv", "E.csv", "--why", effect],
        )
    };
    let heavier = why("mass-change");
    let said = String::from_utf8(heavier.stdout).unwrap();
    assert_eq!(heavier.status.code(), Some(0));
    assert!(said.starts_with("mass-change is not supported: "), "{said}");
    for part in [
        "What a change must do to be supported",
        "differs from zero",
        "Its coefficients, on top of the model",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let refused = why("ground-effect");
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("ground-effect is none of the changes that are tried on this model"), "{said}");
}

/// Real flights of one craft, those of `log` apart: a model of the others, and what has changed in flights named by `part`.
fn crazypad(root: &Path, without_log: &str) -> (tempfile::TempDir, Vec<PathBuf>) {
    let all = files(root, "normal_flight__E9");
    let (apart, base): (Vec<PathBuf>, Vec<PathBuf>) =
        all.into_iter().partition(|path| path.display().to_string().contains(without_log));
    let (train, validate) = base.split_at(base.len() - 2);
    (identified(&root.join("vehicle.toml"), train, validate), apart)
}

fn files(root: &Path, part: &str) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = std::fs::read_dir(root)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.display().to_string().contains(part))
        .collect();
    all.sort();
    all
}

#[test]
fn real_changes_are_seen_and_the_larger_cut_is_the_larger_change() {
    let Some(root) = shared("data/crazypad") else { return };
    let (folder, _) = crazypad(&root, "none");
    let weight = changed(folder.path(), &files(&root, "add_weight_W3_near_M3__E9"));
    assert_eq!(weight["verdict"], "missing-effect");
    let best = &weight["effects"][0];
    // A weight under motor 4 and a motor 4 that lifts less are nearly the same in slow flights: either may come first, the other must be named.
    let named: Vec<&str> = [&best["effect"]]
        .into_iter()
        .chain(best["confounded_with"].as_array().unwrap())
        .map(|id| id.as_str().unwrap())
        .collect();
    assert!(named.contains(&"motor-efficiency") && named.contains(&"com-offset"), "{named:?}");
    if best["effect"] == "motor-efficiency" {
        assert_eq!(best["motor"], 4);
    }

    let loss = |part: &str| {
        let diagnosis = changed(folder.path(), &files(&root, part));
        assert_eq!(diagnosis["verdict"], "missing-effect", "{part}");
        let best = &diagnosis["effects"][0];
        assert_eq!(best["effect"], "motor-efficiency", "{part}");
        // Both cut propellers, motors 2 and 3, lose thrust; either is named, and not as the only possibility.
        assert!([2, 3].contains(&best["motor"].as_u64().unwrap()), "{part}");
        assert!(!best["confounded_with"].as_array().unwrap().is_empty(), "{part}");
        best["coefficients"][0]["value"].as_f64().unwrap()
    };
    let (small, large) = (loss("cut_M2_1.5mm"), loss("cut_M2_3.5mm"));
    assert!(small > 0.05 && large > 1.1 * small, "{small} {large}");
}

#[test]
fn normal_flights_against_each_other_show_no_change() {
    let Some(root) = shared("data/crazypad") else { return };
    for log in ["log00", "log01", "log02", "log03"] {
        let (folder, apart) = crazypad(&root, log);
        let diagnosis = changed(folder.path(), &apart);
        assert_eq!(diagnosis["verdict"], "adequate", "{log}: {}", diagnosis["summary"]);
    }
}
