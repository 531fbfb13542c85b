//! Before identification, as a user runs it: the test stand (`motor-map`), a flight that tells (`excite`), the next flight
//! (`plan`). The numbers' own tests are those of crates `sysid` and `sil`.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::fmt::Write as _;
use std::path::Path;

use common::{done_in, json_in, run_in};
use model::{Model, Vehicle};
use serde_json::Value;

const GAINS: &str = include_str!("../../model/vehicles/f330-gains.toml");
const VEHICLE: &str = include_str!("../../model/vehicles/f330.toml");

/// A run on a stand by the thesis' map (4.11) and lag: craft.csv and tachometer.csv, clocks 7.5 s apart.
fn stand(folder: &Path) {
    let (mut craft, mut rotor) = ("t,cmd1,cmd2,cmd3,cmd4,vbat\n".to_owned(), "t,omega\n".to_owned());
    let (mut speed, mut seed) = (620.0_f64, 1_u32);
    // Six bits of chance, uniform within +- 1.
    let mut chance = move || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed >> 26) / 31.5 - 1.0
    };
    for tick in 0..3600 {
        let t = f64::from(tick) * 0.01;
        let volts = 12.4 - 0.03 * t - 0.1 * (speed / 635.0).powi(3);
        let command = match t {
            t if t < 16.0 => 1500.0 + 300.0 * ((t / 4.0).fract() - 0.5),
            t if t < 26.0 => 1500.0 + 150.0 * (4.0 * t).sin(),
            t => 1500.0 + 250.0 * ((t / 1.3).fract() - 0.5),
        };
        let _ = writeln!(
            craft,
            "{t:.2},{command:.3},{command:.3},{command:.3},{command:.3},{:.4}",
            volts + 0.02 * chance()
        );
        if tick % 2 == 0 {
            let _ = writeln!(rotor, "{:.4},{:.3}", t + 7.5, speed + 4.0 * chance());
        }
        let asked = 0.785 * command + 44.6505 * volts - 1205.1;
        speed = asked + (speed - asked) * (-0.215_f64).exp();
    }
    std::fs::write(folder.join("craft.csv"), craft).unwrap();
    std::fs::write(folder.join("tachometer.csv"), rotor).unwrap();
    let without_map: String = VEHICLE
        .lines()
        .filter(|l| !["command =", "voltage =", "offset =", "lag ="].iter().any(|k| l.starts_with(k)))
        .map(|l| format!("{l}\n"))
        .collect();
    std::fs::write(folder.join("vehicle.toml"), without_map).unwrap();
}

const MOTOR_MAP: [&str; 7] =
    ["motor-map", "--vehicle", "vehicle.toml", "--craft", "craft.csv", "--rotor", "tachometer.csv"];

fn with<'a>(first: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    first.iter().chain(more).copied().collect()
}

/// Laid side by side second by second, nanoseconds would be a thousand years.
#[test]
fn a_stand_with_times_in_another_unit_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    stand(folder.path());
    let path = folder.path().join("craft.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    for unit in ["e3,", "e6,", "e9,"] {
        let rows: Vec<String> = rows.lines().map(|row| row.replacen(',', unit, 1)).collect();
        std::fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
        let output = run_in(folder.path(), &MOTOR_MAP);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.starts_with("error: craft.csv: column \"t\" steps by "), "{stderr}");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
    }
}

#[test]
fn a_test_stand_completes_the_vehicle_file() {
    let folder = tempfile::tempdir().unwrap();
    stand(folder.path());
    let before = std::fs::read_to_string(folder.path().join("vehicle.toml")).unwrap();
    let found = json_in(
        folder.path(),
        &with(&MOTOR_MAP, &["--out", "vehicle.toml", "--force", "--html", "stand.html"]),
    );
    schemas::assert_valid("motor-map", &found);
    for (name, truth) in [("command", 0.785), ("voltage", 44.6505), ("offset", -1205.1), ("lag", 21.5)] {
        let (value, error) = (&found["map"][name]["value"], &found["map"][name]["std_error"]);
        let (value, error) = (value.as_f64().unwrap(), error.as_f64().unwrap());
        assert!(
            (value - truth).abs() < 4.0 * error && error < 0.05 * truth.abs(),
            "{name}: {value} +- {error}"
        );
    }
    // The tachometer is 7.5 s ahead.
    let offset = &found["clock"]["offset_s"];
    assert!((offset["value"].as_f64().unwrap() + 7.5).abs() < 0.005, "{offset}");
    assert_eq!(found["supported"], "command, voltage");
    let after = std::fs::read_to_string(folder.path().join("vehicle.toml")).unwrap();
    for line in before.lines() {
        assert!(after.contains(line), "kept: {line}");
    }
    let vehicle = Vehicle::read(&folder.path().join("vehicle.toml")).unwrap();
    assert!((vehicle.motors.lag.unwrap() - 21.5).abs() < 1.5 && vehicle.has_rotor_map());
    let page = std::fs::read_to_string(folder.path().join("stand.html")).unwrap();
    assert!(
        page.contains("rotor speed [rad/s]")
            || page.contains("rotor speed (rad/s)")
            || page.contains("rad/s")
    );
    let text = done_in(folder.path(), &MOTOR_MAP);
    assert!(text.contains("The data support: command, voltage.") && text.contains("(file: "), "{text}");
}

#[test]
fn what_a_stand_cannot_mean_is_one_line() {
    type Edit = fn(&str) -> String;
    let edits: [(&str, Edit, &str); 9] = [
        (
            "tachometer.csv",
            |t| scaled(t, 1, 60.0 / std::f64::consts::TAU, 0.0),
            "look like revolutions a minute",
        ),
        ("tachometer.csv", |t| scaled(t, 1, 1.0 / std::f64::consts::TAU, 0.0), "revolutions a second"),
        ("tachometer.csv", |t| t.replace("omega", "rpm"), "multiply revolutions a minute"),
        ("tachometer.csv", |t| t.lines().take(60).map(|l| format!("{l}\n")).collect(), "has 59 values"),
        ("tachometer.csv", |t| t.replacen("7.5600,", "7.5000,", 1), "is \"7.5\": not after"),
        ("craft.csv", |t| scaled(t, 1, 0.0, 1500.0), "differ: say which motor"),
        ("craft.csv", |t| scaled(&t.replace("cmd1", "cmd"), 1, 0.0, 1500.0), "is constant, 1500 to 1500 us"),
        ("craft.csv", |t| scaled(t, 5, 0.0, 11.1), "voltage coefficient not excited: "),
        ("craft.csv", |t| scaled(t, 5, 1000.0, 0.0), "divide millivolts"),
    ];
    for (file, edit, expected) in edits {
        let folder = tempfile::tempdir().unwrap();
        stand(folder.path());
        let path = folder.path().join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, edit(&text)).unwrap();
        let before = std::fs::read_to_string(folder.path().join("vehicle.toml")).unwrap();
        let output = run_in(folder.path(), &with(&MOTOR_MAP, &["--out", "vehicle.toml", "--force"]));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{expected}: {stderr}");
        assert!(stderr.contains(expected) && stderr.lines().count() == 1, "{expected}: {stderr}");
        assert!(stderr.starts_with("error: ") && stderr.contains(".csv"), "{stderr}");
        assert_eq!(std::fs::read_to_string(folder.path().join("vehicle.toml")).unwrap(), before, "untouched");
    }
}

/// A column times a factor plus a term.
fn scaled(text: &str, column: usize, factor: f64, term: f64) -> String {
    let row = |line: &str| -> String {
        let field = |(k, field): (usize, &str)| match (k == column, field.parse::<f64>()) {
            (true, Ok(value)) => (value * factor + term).to_string(),
            _ => field.to_owned(),
        };
        line.split(',').enumerate().map(field).collect::<Vec<_>>().join(",") + "\n"
    };
    text.lines().map(row).collect()
}

/// A folder with the thesis' model and gains.
fn thesis() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("model.toml"), Model::thesis().to_toml()).unwrap();
    std::fs::write(folder.path().join("gains.toml"), GAINS).unwrap();
    folder
}

const EXCITE: [&str; 5] = ["excite", "--model", "model.toml", "--gains", "gains.toml"];
const PLAN: [&str; 5] = ["plan", "--model", "model.toml", "--gains", "gains.toml"];

#[test]
fn a_pattern_is_written_foreseen_and_read_again() {
    let folder = thesis();
    let made = json_in(folder.path(), &with(&EXCITE, &["--out", "pattern.csv", "--html", "pattern.html"]));
    let pattern = pattern::Pattern::read(&folder.path().join("pattern.csv")).unwrap();
    assert_eq!(pattern.duration_s(), 20.0);
    assert!(made["injection"]["largest_correlation"].as_f64().unwrap() < 1e-4);
    for factor in made["injection"]["relative_peak_factor"].as_array().unwrap() {
        assert!(factor.as_f64().unwrap() < 1.2, "{factor}");
    }
    let coefficients = made["coefficients"].as_array().unwrap();
    assert!(coefficients.len() >= 24 && coefficients.iter().all(|c| c["std_error"].as_f64().unwrap() > 0.0));
    assert!(made["flight"]["trouble"].is_null() && made["flight"]["roll_deg"].as_f64().unwrap() < 30.0);
    // What is in the file is what was foreseen, to the millionth that is written.
    let again = json_in(folder.path(), &with(&EXCITE, &["--pattern", "pattern.csv"]));
    let drag = |d: &Value| {
        let all = d["coefficients"].as_array().unwrap();
        all.iter().find(|c| c["name"] == "C_du").unwrap()["std_error"].as_f64().unwrap()
    };
    assert!((drag(&made) / drag(&again) - 1.0).abs() < 0.01, "{} {}", drag(&made), drag(&again));
    let hover = done_in(
        folder.path(),
        &with(&EXCITE, &["--path", "hover", "--signal", "thesis", "--out", "hover.csv"]),
    );
    let not_excited = hover.split("Not excited:").nth(1).unwrap();
    assert!(not_excited.contains("quadratic-drag") && not_excited.contains("ground-effect"), "{hover}");
    assert!(std::fs::read_to_string(folder.path().join("pattern.html")).unwrap().contains("</html>"));
}

#[test]
fn a_pattern_that_loses_the_craft_is_not_written() {
    let folder = thesis();
    let output = run_in(folder.path(), &with(&EXCITE, &["--amplitude", "450", "--out", "wild.csv"]));
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.starts_with("DO NOT FLY THIS: the supervisor "), "{said}");
    assert!(said.contains("(tilted to roll ") || said.contains("(outside the cage at x "), "{said}");
    assert!(!folder.path().join("wild.csv").exists());
}

/// No design closes the loops of a craft without flapping moments; the thesis' gains without cancellers fly it.
#[test]
fn a_model_without_gains_of_its_own_is_flown_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("craft.toml"), include_str!("../data/craft.toml")).unwrap();
    let made =
        json_in(folder.path(), &["excite", "--model", "craft.toml", "--path", "climbs", "--out", "p.csv"]);
    assert!(made["flight"]["trouble"].is_null(), "{made}");
    let heights = &made["flight"]["position_m"][2];
    assert!(heights[0].as_f64().unwrap() < -1.5 && heights[1].as_f64().unwrap() > -0.8, "{heights}");
}

#[test]
fn the_next_flight_is_the_one_that_physics_asks_for() {
    let folder = thesis();
    let best = |question: &[&str]| -> (String, Value) {
        let found = json_in(folder.path(), &with(&PLAN, question));
        (found["flights"][0]["name"].as_str().unwrap().to_owned(), found)
    };
    let (turn, found) = best(&["--separate", "steady-wind", "attitude-offset", "--out", "next.csv"]);
    assert_eq!(turn, "yaw-round", "{found}");
    assert!(pattern::Pattern::read(&folder.path().join("next.csv")).is_ok());
    let (low, found) = best(&["--shrink", "k_ground"]);
    assert_eq!(low, "low-flight", "{found}");
    let (dash, found) = best(&["--shrink", "C_dv"]);
    assert!(["dashes-sideways", "circle", "dashes-yawed"].contains(&dash.as_str()), "{found}");
    for flight in found["flights"].as_array().unwrap() {
        assert!(flight["trouble"].is_null(), "the thesis' craft flies all of them: {flight}");
    }
}

#[test]
fn questions_that_are_none_are_one_line() {
    let folder = thesis();
    for (arguments, expected) in [
        (
            with(&PLAN, &["--separate", "steady-wind", "stormy-wind"]),
            "\"stormy-wind\"|stormy-wind: no such effect",
        ),
        (with(&PLAN, &["--separate", "steady-wind", "steady-wind"]), "give two different effects"),
        (with(&PLAN, &["--separate", "thrust", "steady-wind"]), "part of every model"),
        (with(&PLAN, &["--separate", "mass-change", "steady-wind"]), "cannot be predicted"),
        (with(&PLAN, &["--shrink", "C_x"]), "known are thrust.C_T"),
        (with(&PLAN, &[]), "--separate"),
        (
            with(&EXCITE, &["--band", "1", "80", "--out", "p.csv"]),
            "--band 1 80: the signal is sampled at 100 Hz, which shows only frequencies below 50 Hz",
        ),
        (with(&EXCITE, &["--signal", "log-sweep", "--band", "1", "50", "--out", "p.csv"]), "--band 1 50: "),
        (with(&PLAN, &["--shrink", "C_du", "--duration", "1"]), "8 to 600 seconds"),
        (with(&EXCITE, &["--path", "loop", "--out", "p.csv"]), "no such path; known are hover"),
        (with(&EXCITE, &["--band", "5", "1", "--out", "p.csv"]), "widen the band"),
        (with(&EXCITE, &["--amplitude", "-3", "--out", "p.csv"]), "--amplitude"),
        (with(&EXCITE, &["--out", "model.toml"]), "would be overwritten"),
        (with(&EXCITE, &["--pattern", "gains.toml"]), "gains.toml: "),
    ] {
        let output = run_in(folder.path(), &arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.lines().count() == 1, "{arguments:?}: {stderr}");
        assert!(expected.split('|').any(|e| stderr.contains(e)), "{arguments:?}: {stderr}");
    }
}
