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
    arguments.push("--json".into());
    // With warnings: clocks of real flights differ.
    let output = run_in(folder, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    serde_json::from_slice(&output.stdout).expect("standard output is one JSON document")
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
        "What else motor-efficiency 2 could be",
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
    // By itself, and beside what else was found.
    let of = |finding: &Value| finding["coefficients"][0]["value"].as_f64().unwrap();
    let [alone, beside] = [of(weak), of(&diagnosis["effects"][0])];
    assert!((alone / beside - 1.0).abs() < 1e-9, "{alone} {beside}");
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
    assert!(said.starts_with("No change stands out"), "the answer first: {said}");
    assert!(said.contains("\nmass-change is not supported: "), "{said}");
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
    assert!(said.contains("ground-effect is not among the changes that are tried on this model"), "{said}");
}

/// A model of a real craft's normal flights but those of one log, and the files of that log.
fn crazypad(root: &Path, craft: &str, without_log: &str) -> (tempfile::TempDir, Vec<PathBuf>) {
    let all = files(root, &format!("normal_flight__{craft}"));
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

/// "motor-efficiency of motor 4", "com-offset".
fn named(finding: &Value) -> String {
    let motor = finding["motor"].as_u64().map_or_else(String::new, |motor| format!(" of motor {motor}"));
    format!("{}{motor}", finding["effect"].as_str().unwrap())
}

/// Loss of thrust of a motor as far as it is told, found or not.
fn loss_of(diagnosis: &Value, motor: u64) -> f64 {
    let effects = diagnosis["effects"].as_array().unwrap();
    let finding = effects.iter().find(|f| f["effect"] == "motor-efficiency" && f["motor"] == motor).unwrap();
    finding["coefficients"][0]["value"].as_f64().unwrap()
}

/// Propeller M3 of the craft E8, motor 4 here, was cut by 0.5, 3 and 6 of its 47 mm.
#[test]
fn a_cut_propeller_is_named_and_a_deeper_cut_is_a_larger_loss() {
    let Some(root) = shared("data/crazypad") else { return };
    let (folder, _) = crazypad(&root, "E8", "none");
    let cut = |part: &str| changed(folder.path(), &files(&root, &format!("cut_M3_{part}__E8")));
    let [half, three, six] = ["0.5mm_46.5mm", "1.5mm_1.5mm_44mm", "3mm_3mm_41mm"].map(cut);
    for diagnosis in [&three, &six] {
        assert_eq!(diagnosis["verdict"], "missing-effect");
        assert_eq!(
            named(&diagnosis["effects"][0]),
            "motor-efficiency of motor 4",
            "{}",
            diagnosis["summary"]
        );
    }
    let losses = [&half, &three, &six].map(|diagnosis| loss_of(diagnosis, 4));
    assert!(losses[0] < losses[1] && losses[1] < losses[2], "{losses:?}");
    assert!(losses[2] > 0.1, "{losses:?}");
    // Too small to tell from what flights differ by: that is said with what would have been seen.
    assert_ne!(half["verdict"], "missing-effect");
    assert!(half["summary"].as_str().unwrap().contains("would have stood out"), "{}", half["summary"]);
}

#[test]
fn a_weight_at_a_motor_is_a_change_and_tape_that_weighs_nothing_is_none() {
    let Some(root) = shared("data/crazypad") else { return };
    let (folder, _) = crazypad(&root, "E9", "none");
    let weight = changed(folder.path(), &files(&root, "add_weight_W3_near_M3__E9"));
    assert_eq!(weight["verdict"], "missing-effect");
    // A weight under motor 4 and a motor 4 that lifts less load the same rotor.
    assert_eq!(named(&weight["effects"][0]), "motor-efficiency of motor 4", "{}", weight["summary"]);
    let (folder, _) = crazypad(&root, "E8", "none");
    for log in ["log00", "log01"] {
        let tape = changed(folder.path(), &files(&root, &format!("tape_on_M3__E8_{log}")));
        assert_ne!(tape["verdict"], "missing-effect", "{}", tape["summary"]);
    }
}

/// Propellers M2 and M1 of the craft E9, motors 3 and 2 here, both on the right.
#[test]
fn two_cut_propellers_are_a_change_with_rivals_and_a_larger_one_where_they_are_cut_deeper() {
    let Some(root) = shared("data/crazypad") else { return };
    let (folder, _) = crazypad(&root, "E9", "none");
    let shift = |part: &str| {
        let diagnosis = changed(folder.path(), &files(&root, part));
        assert_eq!(diagnosis["verdict"], "missing-effect", "{part}: {}", diagnosis["summary"]);
        // One cause is named first, and not as the only possibility.
        let best = &diagnosis["effects"][0];
        assert!(!best["confounded_with"].as_array().unwrap().is_empty(), "{part}: {}", diagnosis["summary"]);
        loss_of(&diagnosis, 2) + loss_of(&diagnosis, 3)
    };
    let (small, large) = (shift("cut_M2_1.5mm"), shift("cut_M2_3.5mm"));
    assert!(small > 0.05 && large > 1.1 * small, "{small} {large}");
}

#[test]
fn normal_flights_against_each_other_show_no_change() {
    let Some(root) = shared("data/crazypad") else { return };
    for craft in ["E8", "E9"] {
        for log in ["log00", "log01", "log02", "log03"] {
            let (folder, apart) = crazypad(&root, craft, log);
            let diagnosis = changed(folder.path(), &apart);
            assert_eq!(diagnosis["verdict"], "adequate", "{craft} {log}: {}", diagnosis["summary"]);
        }
    }
}
