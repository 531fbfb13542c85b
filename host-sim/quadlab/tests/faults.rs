//! Faults of logs and vehicle files through the real commands: refused in one line by name, or told and carried in JSON.

mod common;

use std::path::Path;

use common::{copies, done_in, identify, run_in, with_sets};
use serde_json::Value;

const IDENTIFY: [&str; 6] = ["identify", "--vehicle", "vehicle.toml", "--out", "out.toml", "--force"];

/// Columns of the simulated flights.
const X: usize = 1;
const Y: usize = 2;
const PHI: usize = 4;
const P: usize = 7;
const CMD1: usize = 10;
const VBAT: usize = 14;

/// Changes the table of a flight file; the first row of `edit` is the first after the header.
fn edit(path: &Path, edit: impl Fn(&mut Vec<Vec<f64>>)) {
    let text = std::fs::read_to_string(path).unwrap();
    let (header, body) = text.split_once('\n').unwrap();
    let mut rows: Vec<Vec<f64>> =
        body.lines().map(|line| line.split(',').map(|f| f.parse().unwrap()).collect()).collect();
    edit(&mut rows);
    let lines = rows.iter().map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    let text = std::iter::once(header.to_owned()).chain(lines).collect::<Vec<_>>().join("\n") + "\n";
    std::fs::write(path, text).unwrap();
}

/// Runs a command that has to be refused in one line that says all of `expected`.
fn refused(folder: &Path, arguments: &[&str], expected: &[&str]) {
    let output = run_in(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert_eq!(stderr.lines().count(), 1, "{arguments:?}: {stderr}");
    expected.iter().for_each(|word| assert!(stderr.contains(word), "no {word:?} in {stderr}"));
}

/// Runs a command with `--json`: its document and its warnings.
fn told(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let arguments: Vec<&str> = arguments.iter().copied().chain(["--json"]).collect();
    let output = run_in(folder, &arguments);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
    (serde_json::from_slice(&output.stdout).unwrap(), stderr)
}

fn kinds(document: &Value) -> Vec<String> {
    let faults = document["faults"].as_array().expect("there is a list of faults");
    faults.iter().map(|f| f["kind"].as_str().unwrap().to_owned()).collect()
}

fn assert_told(folder: &Path, arguments: &[&str], kind: &str, sentence: &str) -> Value {
    let (document, stderr) = told(folder, arguments);
    assert!(kinds(&document).iter().any(|k| k == kind), "{arguments:?}: {}", document["faults"]);
    assert!(stderr.contains(sentence), "no {sentence:?} in {stderr}");
    document
}

#[test]
fn sound_flights_have_no_faults_and_no_warnings() {
    let folder = copies();
    let (document, stderr) = told(folder.path(), &with_sets(&IDENTIFY));
    assert!(kinds(&document).is_empty() && stderr.is_empty(), "{}: {stderr}", document["faults"]);
    let clocks = document["clocks"].as_array().unwrap();
    assert_eq!(clocks.len(), 5);
    for clock in clocks {
        // A third of a sample.
        assert!(clock["attitude"]["offset_s"].as_f64().unwrap().abs() < 0.003, "{clock}");
        assert_eq!(clock["aligned"], false);
    }
}

#[test]
fn wrong_axes_signs_and_motors_are_refused_by_name() {
    type Edit = fn(&mut Vec<f64>);
    let cases: [(Edit, &str); 6] = [
        (|r| (r[P], r[P + 1]) = (r[P + 1], -r[P]), "p, q, r look like q, -p, r of this craft"),
        (|r| r[P + 2] = -r[P + 2], "p, q, r look like p, q, -r"),
        (|r| r[X + 2] = -r[X + 2], "z points up"),
        (|r| r[PHI + 1] = -r[PHI + 1], "theta has the wrong sign"),
        (|r| r.swap(PHI, PHI + 1), "phi and theta are exchanged"),
        (|r| r[CMD1..CMD1 + 4].rotate_left(1), "cmd1 of motor 2 (front-right)"),
    ];
    for (wrong, expected) in cases {
        let folder = copies();
        edit(&folder.path().join("B.csv"), |rows| rows.iter_mut().for_each(wrong));
        refused(folder.path(), &with_sets(&IDENTIFY), &["error: B.csv: ", expected, "--accept-faults"]);
        let accepted = with_sets(&[&IDENTIFY[..], &["--accept-faults"]].concat());
        let (document, stderr) = told(folder.path(), &accepted);
        assert_eq!(document["faults"][0]["severity"], "refused", "{expected}");
        assert_eq!(document["faults"][0]["flight"], "B.csv");
        assert!(stderr.contains(expected), "{stderr}");
    }
}

#[test]
fn a_late_tracker_is_told_and_mended() {
    let folder = copies();
    edit(&folder.path().join("B.csv"), |rows| {
        // Five samples: the pose of 50 ms ago.
        let before: Vec<Vec<f64>> = rows.clone();
        for k in 5..rows.len() {
            rows[k][X..P].copy_from_slice(&before[k - 5][X..P]);
        }
        rows.drain(..5);
    });
    let page = ["compare", "--model", "out.toml", "--flights", "B.csv", "--html", "page.html"];
    let said = "warning: B.csv: phi, theta, psi are ";
    let document = assert_told(folder.path(), &with_sets(&IDENTIFY), "clock-offset", said);
    let clock = &document["clocks"][1];
    let offset_s = clock["attitude"]["offset_s"].as_f64().unwrap();
    assert!((offset_s - 0.05).abs() < 0.002 && clock["aligned"] == true, "{clock}");
    done_in(folder.path(), &page);
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("clock-offset") && page.contains("What was checked"));
}

#[test]
fn trackers_that_freeze_or_jump_are_told() {
    let folder = copies();
    edit(&folder.path().join("A.csv"), |rows| {
        let held: Vec<f64> = rows[500][X..P].to_vec();
        rows[501..540].iter_mut().for_each(|row| row[X..P].copy_from_slice(&held));
    });
    edit(&folder.path().join("D.csv"), |rows| rows[900..910].iter_mut().for_each(|row| row[Y] += 0.5));
    let (document, stderr) = told(folder.path(), &with_sets(&IDENTIFY));
    assert_eq!(kinds(&document), ["frozen-channel", "tracker-jump"], "{}", document["faults"]);
    assert!(stderr.contains("A.csv: the tracker") && stderr.contains("D.csv: the tracker jumps"), "{stderr}");
}

#[test]
fn too_few_flights_are_told() {
    let folder = copies();
    let few = [&IDENTIFY[..], &["--train", "A.csv", "--validate", "D.csv"]].concat();
    let (document, stderr) = told(folder.path(), &few);
    assert_eq!(kinds(&document), ["too-few-flights", "too-few-flights"], "{}", document["faults"]);
    assert!(stderr.contains("only one training flight") && stderr.contains("give two or more"), "{stderr}");
}

#[test]
fn a_piece_of_a_training_flight_cannot_judge() {
    let folder = copies();
    std::fs::copy(folder.path().join("A.csv"), folder.path().join("D.csv")).unwrap();
    edit(&folder.path().join("D.csv"), |rows| {
        *rows = rows.split_off(333);
        rows.iter_mut().flatten().for_each(|value| *value = (*value * 1e5).round() / 1e5);
    });
    refused(folder.path(), &with_sets(&IDENTIFY), &["D.csv: ", "has samples of A.csv", "cannot judge"]);
}

#[test]
fn judging_by_a_flight_that_was_fitted_on_is_told() {
    let folder = copies();
    identify(folder.path());
    let sets = ["--model", "model.toml", "--train", "B.csv", "C.csv", "--validate", "A.csv", "D.csv"];
    let said = "warning: A.csv: the model was fitted to this flight";
    for command in [&["diagnose"][..], &["add", "motor-lag", "--out", "out.toml"]] {
        assert_told(folder.path(), &[command, &sets].concat(), "fitted-on", said);
    }
    let compare = ["compare", "--model", "model.toml", "--flights", "A.csv", "D.csv"];
    assert_told(folder.path(), &compare, "fitted-on", said);
}

#[test]
fn flights_of_another_craft_are_told() {
    let folder = copies();
    identify(folder.path());
    let model = folder.path().join("model.toml");
    let text = std::fs::read_to_string(&model).unwrap();
    assert!(text.contains("mass = 1.214"));
    std::fs::write(&model, text.replace("mass = 1.214", "mass = 2.428")).unwrap();
    let said = "do not look like";
    let compare = ["compare", "--model", "model.toml", "--flights", "D.csv", "E.csv"];
    assert_told(folder.path(), &compare, "other-vehicle", said);
    assert_told(folder.path(), &with_sets(&["diagnose", "--model", "model.toml"]), "other-vehicle", said);
    let changed = ["diagnose", "--model", "model.toml", "--changed", "D.csv", "E.csv"];
    assert_told(folder.path(), &changed, "other-vehicle", "the thrust is 100 % above the model's");
}

/// Adds to a simulated flight the rotor speeds that it was flown with, from the motor map and the lag of vehicle.toml, and then lowers the
/// commands: the motors turn faster than these say.
fn with_rotor_speeds(path: &Path, commands_lower_by: f64) {
    edit(path, |rows| {
        let mut speeds = [f64::NAN; 4];
        for k in 0..rows.len() {
            let decay = if k == 0 { 0.0 } else { (-21.5 * (rows[k][0] - rows[k - 1][0])).exp() };
            let before = rows[k.saturating_sub(1)].clone();
            for (motor, speed) in speeds.iter_mut().enumerate() {
                let steady = 0.785 * before[CMD1 + motor] + 44.6505 * before[VBAT] - 1205.1;
                *speed = if k == 0 { steady } else { steady + (*speed - steady) * decay };
            }
            rows[k].extend(speeds);
        }
        rows.iter_mut().for_each(|row| row[CMD1..CMD1 + 4].iter_mut().for_each(|c| *c -= commands_lower_by));
    });
    let text = std::fs::read_to_string(path).unwrap();
    std::fs::write(path, text.replacen(",vbat", ",vbat,omega1,omega2,omega3,omega4", 1)).unwrap();
}

/// 0.785 rad/s times 30 us are 23.6 rad/s, which is 3.8 % of the 616 rad/s that the lowered commands ask for.
#[test]
fn motors_that_turn_faster_at_the_same_command_are_told() {
    let folder = copies();
    for name in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"] {
        with_rotor_speeds(&folder.path().join(name), 0.0);
    }
    let other = copies();
    let names = ["D.csv", "E.csv"];
    for name in names {
        with_rotor_speeds(&other.path().join(name), 30.0);
        std::fs::copy(other.path().join(name), folder.path().join(format!("later-{name}"))).unwrap();
    }
    identify(folder.path());
    let changed = ["diagnose", "--model", "model.toml", "--changed"];
    let same: Vec<&str> = changed.into_iter().chain(names).collect();
    let (document, _) = told(folder.path(), &same);
    assert!(!kinds(&document).iter().any(|kind| kind == "motor-answers"), "{}", document["faults"]);
    let later: Vec<&str> = changed.into_iter().chain(["later-D.csv", "later-E.csv"]).collect();
    let said = "flights: all motors turn 3.8 % faster";
    let document = assert_told(folder.path(), &later, "motor-answers", said);
    assert!(document["summary"].as_str().unwrap().contains(said), "{}", document["summary"]);
}

#[test]
fn vehicle_files_with_wrong_lengths_are_suspected() {
    let folder = copies();
    let path = folder.path().join("vehicle.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    for (from, to, said) in [
        ("arm_length = 0.167", "arm_length = 0.334", "diagonal"),
        ("rotor_radius = 0.1016", "rotor_radius = 0.2032", "diameter"),
        ("mass = 1.214", "mass = 121.4", "thrust coefficient"),
    ] {
        assert!(text.contains(from), "{from} in {text}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        assert_told(folder.path(), &with_sets(&IDENTIFY), "implausible-vehicle", said);
    }
}
