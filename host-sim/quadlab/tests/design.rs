//! `linearize` and `design check` as a user runs them: the contract's JSON, the thesis' numbers,
//! exit statuses, one line a mistake. The numbers' own tests, with what each tolerance means, are
//! those of crate `design`.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::path::Path;

use common::{done_in, json_in, run_in};
use model::{Effect, Model};
use serde_json::Value;

const GAINS: &str = include_str!("../../model/vehicles/f330-gains.toml");
const CHECK: [&str; 6] = ["design", "check", "--model", "model.toml", "--gains", "gains.toml"];

/// A folder with the thesis' model and gains.
fn thesis() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_model(folder.path(), &Model::thesis());
    std::fs::write(folder.path().join("gains.toml"), GAINS).unwrap();
    folder
}

fn write_model(folder: &Path, model: &Model) {
    std::fs::write(folder.join("model.toml"), model.to_toml()).unwrap();
}

fn with(more: &[&'static str]) -> Vec<&'static str> {
    CHECK.iter().chain(more).copied().collect()
}

fn named<'a>(list: &'a Value, name: &str) -> &'a Value {
    list.as_array()
        .unwrap()
        .iter()
        .find(|entry| entry["name"] == name)
        .unwrap_or_else(|| panic!("no {name}: {list}"))
}

fn near(value: &Value, want: f64, tolerance: f64) {
    let got = value.as_f64().unwrap_or(f64::NAN);
    assert!((got - want).abs() <= tolerance, "got {got}, want {want} +- {tolerance}");
}

/// Tolerances of the reference; crossovers against the printed values 0.005 rad/s.
#[test]
fn the_continuous_check_has_the_thesis_numbers() {
    let folder = thesis();
    let report = json_in(folder.path(), &with(&["--continuous"]));
    let loops = &report["loops"];
    for (name, phase, crossover) in [
        ("roll", 47.6555, 5.3531),
        ("pitch", 45.8471, 5.4843),
        ("yaw", 61.47, 2.583),
        ("z", 70.37, 2.138),
        ("x", 48.813, 1.17),
        ("y", 47.635, 1.12),
    ] {
        let entry = named(loops, name);
        near(&entry["phase_margin_deg"], phase, 0.1);
        near(&entry["crossover_rad_s"], crossover, 0.005);
        assert!(entry["delay_margin_s"].as_f64().unwrap() > 0.0);
        let poles = entry["poles"].as_array().unwrap();
        assert!(!poles.is_empty() && poles.iter().all(|p| p[0].as_f64().unwrap() < 0.0 && p[1].is_number()));
    }
    near(&named(loops, "roll")["gain_margin"], 2.7952, 0.01);
    let steps = &report["steps"];
    for (name, overshoot, tolerance) in
        [("yaw", 3.54, 0.02), ("z", 2.15, 0.02), ("x", 15.0, 0.5), ("y", 17.0, 0.5)]
    {
        near(&named(steps, name)["overshoot_percent"], overshoot, tolerance);
    }
    near(&named(steps, "yaw")["rise_s"], 0.665, 0.005);
    near(&named(steps, "z")["rise_s"], 1.24, 0.005);
    let moved: Vec<&Value> =
        report["moved_zero"].as_array().unwrap().iter().filter(|row| row["name"] == "roll").collect();
    assert_eq!(moved.len(), 16);
    near(&moved[0]["zero_rad_s"], 0.2149, 0.0);
    near(&moved[0]["phase_margin_deg"], 47.6555, 0.02);
    near(&moved[15]["crossover_rad_s"], 5.9198, 0.003);
}

#[test]
fn three_samples_of_delay_are_one_too_many() {
    let folder = thesis();
    let two = json_in(folder.path(), &with(&["--delay", "2"]));
    near(&named(&two["loops"], "pitch")["gain_margin"], 1.085, 0.003);
    near(&named(&two["loops"], "pitch")["least_damped"]["damping"], 0.019, 0.001);
    let three = run_in(folder.path(), &with(&["--delay", "3", "--json"]));
    assert_eq!(three.status.code(), Some(1));
    let three: Value = serde_json::from_slice(&three.stdout).unwrap();
    for (name, stable) in [("roll", false), ("pitch", false), ("yaw", true), ("z", true)] {
        assert_eq!(named(&three["loops"], name)["stable"], stable, "{name}");
    }
    assert_eq!(named(&three["loops"], "roll")["delay_margin_s"], 0.0);
}

/// With standard errors the margins spread, and the same seed gives the same spread; a voltage that
/// the motor map takes out changes nothing, one that it does not changes the gain.
#[test]
fn what_is_uncertain_spreads_the_margins() {
    let folder = thesis();
    let mut model = Model::thesis();
    for coefficient in model.terms.iter_mut().flat_map(|term| &mut term.coefficients) {
        coefficient.std_error = Some(0.02 * coefficient.value.abs());
    }
    model.set(Effect::BatteryVoltage, &[10.0, 0.0]);
    write_model(folder.path(), &model);
    let arguments = with(&["--delay", "0", "--samples", "12"]);
    let report = json_in(folder.path(), &arguments);
    let roll = named(&report["uncertainty"]["loops"], "roll");
    let (worst, median) = (&roll["gain_margin"]["min"], &roll["gain_margin"]["median"]);
    assert!(worst.as_f64().unwrap() < median.as_f64().unwrap(), "{roll}");
    assert_eq!(json_in(folder.path(), &arguments), report);
    let battery = report["battery"].as_array().unwrap();
    let margin = |row: &Value| named(&row["loops"], "roll")["gain_margin"].as_f64().unwrap();
    assert!(margin(&battery[0]) > 1.005 * margin(&battery[4]), "a full battery leaves less gain margin");
    let thrust = |row: &Value| row["thrust_to_weight"].as_f64().unwrap();
    assert!(thrust(&battery[4]) > thrust(&battery[0]));
}

/// Each loop has its margin at the actuator beside its own, in JSON with both crossover
/// frequencies, in text and on the page. Pitch with two samples of delay has 1.085 of gain margin
/// at its error, and less where all of its feedback is cut.
#[test]
fn margins_at_the_actuator_stand_beside_the_loops_own() {
    let folder = thesis();
    let report = json_in(folder.path(), &with(&["--delay", "2"]));
    for entry in report["loops"].as_array().unwrap() {
        let actuator = &entry["at_actuator"];
        for key in ["phase_margin_deg", "gain_margin", "crossover_rad_s", "phase_crossover_rad_s"] {
            assert!(actuator[key].as_f64().unwrap() > 0.0, "{key}: {entry}");
        }
        // The actuator's cut holds the velocity feedback too, so its crossover is the faster one.
        assert!(actuator["crossover_rad_s"].as_f64() > entry["crossover_rad_s"].as_f64(), "{entry}");
    }
    let pitch = named(&report["loops"], "pitch");
    assert!(pitch["at_actuator"]["gain_margin"].as_f64() < pitch["gain_margin"].as_f64(), "{pitch}");
    let text = done_in(folder.path(), &with(&["--html", "check.html"]));
    assert!(text.contains("actuator: phase deg") && text.contains("Stable in everything"), "{text}");
    let page = std::fs::read_to_string(folder.path().join("check.html")).unwrap();
    // Both cuts of each loop carry their margins in the figure.
    let marked = |what: &str| page.matches(what).count();
    assert!(
        page.contains("Cut at the actuator")
            && page.contains("cut at the actuator, with all of the feedback")
    );
    assert!(marked("phase margin 51.8 deg at 6.20 rad/s") >= 2, "legend and caption");
    assert!(marked(" dB) at ") >= 12, "a gain margin in each of twelve Bode plots");
}

/// Gains that hold the model but not what its standard errors leave open do not pass: status 1, and
/// one sentence that says in how many draws and of which loops.
#[test]
fn a_check_with_unstable_draws_fails_and_says_so() {
    let folder = thesis();
    let mut model = Model::thesis();
    for coefficient in model.terms.iter_mut().flat_map(|term| &mut term.coefficients) {
        coefficient.std_error = Some(0.1 * coefficient.value.abs());
    }
    write_model(folder.path(), &model);
    let output = run_in(folder.path(), &with(&["--delay", "2", "--samples", "30"]));
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    let said: Vec<&str> = text.lines().filter(|line| line.starts_with("NOT SAFE TO FLY")).collect();
    assert_eq!(said.len(), 1, "{text}");
    assert!(
        said[0].contains(" of 30 random draws of the model: ") && said[0].contains("pitch in "),
        "{text}"
    );
    assert!(!text.contains("UNSTABLE") && !text.contains("Stable in everything"), "{text}");
    let json = run_in(folder.path(), &with(&["--delay", "2", "--samples", "30", "--json"]));
    assert_eq!(json.status.code(), Some(1));
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert!(json["uncertainty"]["unstable"].as_u64().unwrap() > 0 && json["holds"] == false);
    // Without draws nothing is known against them.
    assert_eq!(run_in(folder.path(), &with(&["--samples", "0"])).status.code(), Some(0));
}

#[test]
fn the_page_stands_alone_and_the_text_names_every_loop() {
    let folder = thesis();
    let text = done_in(folder.path(), &with(&["--delay", "2", "--html", "check.html"]));
    for name in ["roll", "pitch", "yaw", "z", "x", "y"] {
        assert!(text.lines().any(|line| line.starts_with(&format!("{name} "))), "{name}: {text}");
    }
    let page = std::fs::read_to_string(folder.path().join("check.html")).unwrap();
    assert!(
        page.contains("Root locus of Kd")
            && page.contains("figure A.1")
            && page.contains("Nichols")
            && page.contains("<svg")
    );
    assert!(!page.contains("src=\"http") && !page.contains("href=\"http"));
}

#[test]
fn linearize_gives_the_thesis_transfer_functions() {
    let folder = thesis();
    let document = json_in(folder.path(), &["linearize", "--model", "model.toml"]);
    assert!(document["equilibrium"]["cost"].as_f64().unwrap() < 1e-20);
    near(&document["equilibrium"]["input"][0], 11.9093, 1e-4);
    near(&document["a"][4][6], 9.81, 1e-6);
    assert_eq!(document["states"][6]["name"], "phi");
    let roll = named(&document["channels"], "roll");
    for (got, want) in roll["denominator"].as_array().unwrap().iter().zip([1.0, -0.9888, 0.2274, 37.03]) {
        near(got, want, 3e-4 * f64::abs(want));
    }
    let text = done_in(folder.path(), &["linearize", "--model", "model.toml"]);
    assert!(text.contains("cancelled") && text.contains("cost J"), "{text}");
}

#[test]
fn a_trim_file_moves_the_equilibrium() {
    let folder = thesis();
    std::fs::write(folder.path().join("trim.toml"), "velocity_ned_m_s = [2.0, 0.0, 0.0]\n").unwrap();
    let document = json_in(folder.path(), &["linearize", "--model", "model.toml", "--at", "trim.toml"]);
    assert!(document["equilibrium"]["state"][7].as_f64().unwrap() < -0.01, "nose down to fly forward");
}

/// A fast craft leans far: its angles are within half a turn, and where no motor can turn so fast it is said.
#[test]
fn an_equilibrium_is_told_in_angles_and_commands_that_there_are() {
    let folder = thesis();
    // Of this craft the search goes round up to fifty times.
    let mut fast = Model::thesis();
    fast.terms.retain(|term| !matches!(term.effect, Effect::FlappingMoment | Effect::RateCoupling));
    fast.set(Effect::Thrust, &[0.0179]);
    fast.set(Effect::LinearDrag, &[-0.264, -0.288, -0.304]);
    let [roll, pitch, yaw] = [0.607, 0.649, 0.254];
    let moments = [roll, roll, roll, roll, pitch, pitch, pitch, pitch, yaw, -yaw, yaw, -yaw];
    fast.set(Effect::RotorMoments, &moments);
    write_model(folder.path(), &fast);
    let at = |trim: &str| {
        std::fs::write(folder.path().join("trim.toml"), trim).unwrap();
        let arguments = ["linearize", "--model", "model.toml", "--at", "trim.toml"];
        (json_in(folder.path(), &arguments), done_in(folder.path(), &arguments))
    };
    for speed in [20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0] {
        let (document, _) = at(&format!("velocity_ned_m_s = [{speed:.1}, 0.0, 0.0]\n"));
        let state = &document["equilibrium"]["state"];
        for angle in [6, 7].map(|k| state[k].as_f64().unwrap()) {
            assert!(angle.abs() <= std::f64::consts::PI, "{speed} m/s: {state}");
        }
    }
    let (document, text) = at("battery_v = 2.0\n");
    assert_eq!(document["equilibrium"]["within_command_range"], false, "{document}");
    assert!(text.contains("BEYOND THE COMMAND RANGE: the motors need commands of "), "{text}");
    let (document, text) = at("");
    assert_eq!(document["equilibrium"]["within_command_range"], true);
    assert!(!text.contains("BEYOND"), "{text}");
}

/// One line, exit status 2, nothing on standard output.
fn refused(folder: &Path, arguments: &[&str], expected: &[&str]) {
    let output = run_in(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert!(output.stdout.is_empty() && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
    for text in expected {
        assert!(stderr.contains(text), "{arguments:?}: \"{text}\" is not in: {stderr}");
    }
}

#[test]
fn mistakes_are_one_line_each() {
    let folder = thesis();
    let folder = folder.path();
    std::fs::write(folder.join("bad.toml"), GAINS.replacen("kp = 100.0", "kq = 100.0", 1)).unwrap();
    let bad = ["design", "check", "--model", "model.toml", "--gains", "bad.toml"];
    refused(folder, &bad, &["bad.toml: ", "kq"]);
    refused(
        folder,
        &["design", "check", "--model", "model.toml", "--gains", "none.toml"],
        &["none.toml: cannot read"],
    );
    refused(folder, &with(&["--delay", "1000"]), &["--delay 1000"]);
    std::fs::write(folder.join("trim.toml"), "speed = 1\n").unwrap();
    refused(
        folder,
        &["linearize", "--model", "model.toml", "--at", "trim.toml"],
        &["trim.toml: line 1", "speed"],
    );
    let mut other = Model::thesis();
    other.vehicle.name = "other craft".into();
    write_model(folder, &other);
    refused(folder, &CHECK, &["gains.toml: these gains belong to another vehicle", "other craft"]);
    let mut lacking = Model::thesis();
    lacking.terms.retain(|term| term.effect != Effect::RotorMoments);
    write_model(folder, &lacking);
    refused(folder, &CHECK, &["\"rotor-moments\""]);
    refused(folder, &["linearize", "--model", "model.toml"], &["\"rotor-moments\""]);
    let mut stuck = Model::thesis();
    // All rotors roll the same way: the craft cannot be trimmed, let alone controlled.
    let moments = [0.6, -0.6, -0.6, 0.6, 0.6, 0.7, 0.6, 0.6, 0.35, -0.33, 0.3, -0.27];
    stuck.set(Effect::RotorMoments, &moments);
    write_model(folder, &stuck);
    refused(folder, &CHECK, &["no equilibrium"]);
}

/// The thesis' procedure writes a gains file with its provenance, which the check takes; another
/// vehicle refuses it.
#[test]
fn designed_gains_are_written_checked_and_belong_to_their_vehicle() {
    let folder = thesis();
    let folder = folder.path();
    std::fs::write(folder.join("specs.toml"), "method = \"thesis\"\n").unwrap();
    let arguments =
        ["design", "--model", "model.toml", "--specs", "specs.toml", "--out", "gains.toml", "--force"];
    let document = json_in(folder, &arguments);
    assert!(document["steps"].as_array().unwrap().len() >= 18);
    assert!(document["shortfalls"].as_array().unwrap().is_empty());
    let written = std::fs::read_to_string(folder.join("gains.toml")).unwrap();
    assert!(written.contains("model_sha256") && written.contains("phase_margin_deg"), "{written}");
    let hash = format!("vehicle_sha256 = \"{}\"", Model::thesis().vehicle.sha256());
    assert!(written.contains(&hash), "{written}");
    let report = json_in(folder, &with(&["--continuous"]));
    assert!(named(&report["loops"], "roll")["phase_margin_deg"].as_f64().unwrap() >= 45.0);
    let mut other = Model::thesis();
    other.vehicle.name = "other craft".into();
    write_model(folder, &other);
    refused(folder, &CHECK, &["belong to another vehicle"]);
    let mut heavier = Model::thesis();
    heavier.vehicle.mass *= 1.01;
    write_model(folder, &heavier);
    refused(folder, &CHECK, &["with other measurements", "vehicle_sha256"]);
}

/// The report of the thesis' own vehicle needs no files, says of each printed number that it comes
/// back, and has a figure for each of chapter 5's that are computed. Of other gains it says what
/// does not come back in no word: they are not the thesis'.
/// What a reader without scripts has of a page.
fn without_scripts(page: &str) -> String {
    let mut parts = page.split("<script");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once("</script>").expect("the script ends").1)
}

#[test]
fn the_report_has_every_figure_and_number_of_chapter_5() {
    let folder = thesis();
    let folder = folder.path();
    let document =
        json_in(folder, &["design", "report", "--samples", "2", "--out", "report.html", "--force"]);
    schemas::assert_valid("design-report", &document);
    assert_eq!((&document["thesis"], &document["holds"]), (&Value::Bool(true), &Value::Bool(true)));
    let numbers = document["numbers"].as_array().unwrap();
    assert_eq!(numbers.len(), 65);
    for number in numbers {
        let [printed, found, tolerance] =
            ["printed", "found", "tolerance"].map(|key| number[key].as_f64().unwrap());
        assert!((printed - found).abs() <= tolerance, "{number}");
    }
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    let figures =
        ["5.2", "5.3", "5.4", "5.5", "5.6", "5.7", "5.8", "5.9", "5.10", "5.12", "5.13", "5.14", "5.15"];
    let outer = ["5.17", "5.18", "5.19", "5.20", "5.21", "5.22", "5.23", "5.24"];
    for figure in figures.into_iter().chain(outer) {
        assert!(page.contains(&format!("Figure {figure}: ")), "figure {figure}");
    }
    assert!(page.contains("figure A.1") && page.contains("appendix B") && page.contains("65 of the 65"));
    assert!(!without_scripts(&page).contains("NaN") && !page.contains("src="));

    let slow = GAINS.replacen("kp = 15.0", "kp = 14.0", 1);
    assert_ne!(slow, GAINS);
    std::fs::write(folder.join("gains.toml"), slow).unwrap();
    let report = ["design", "report", "--model", "model.toml", "--gains", "gains.toml", "--samples", "0"];
    let text = done_in(folder, &[&report[..], &["--out", "slow.html"]].concat());
    assert_eq!(text, "page: slow.html\n");
    // With three samples of delay roll and pitch are unstable: the page is there, and the status
    // says it.
    let late = run_in(folder, &[&report[..], &["--out", "late.html", "--delay", "3"]].concat());
    assert_eq!(late.status.code(), Some(1));
    let text = String::from_utf8(late.stdout).unwrap();
    assert!(text.contains("3 samples old: unstable: roll, pitch"), "{text}");
    assert!(folder.join("late.html").exists());
    refused(folder, &["design", "report", "--model", "model.toml", "--out", "r.html"], &["--gains"]);
    refused(folder, &["design", "report"], &["--out"]);
}

#[test]
fn what_no_gain_can_meet_is_said_with_status_1() {
    let folder = thesis();
    let folder = folder.path();
    std::fs::write(folder.join("specs.toml"), "method = \"thesis\"\n[attitude]\nphase_margin_deg = 85.0\n")
        .unwrap();
    let design = ["design", "--model", "model.toml", "--specs", "specs.toml", "--out", "new.toml"];
    let output = run_in(folder, &design);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("NOT MET: roll: phase margin") && text.contains("wanted 93.0, reached "), "{text}");
    assert!(!folder.join("new.toml").exists());
    let json = run_in(folder, &[&design[..], &["--json"]].concat());
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(json["shortfalls"][0]["loop"], "roll");
    assert!(json["gains"].is_null());
}

/// A load on a rope has states that (5.13) does not: said, not left out in silence.
#[test]
fn a_slung_load_is_refused_with_the_way_out() {
    let folder = thesis();
    let folder = folder.path();
    let mut model = Model::thesis();
    let typical: Vec<f64> = Effect::SlungLoad.info().coefficients.iter().map(|c| c.typical).collect();
    model.set(Effect::SlungLoad, &typical);
    write_model(folder, &model);
    for arguments in [
        vec!["linearize", "--model", "model.toml"],
        CHECK.to_vec(),
        vec!["design", "--model", "model.toml", "--out", "new.toml"],
    ] {
        refused(folder, &arguments, &["slung-load", "mass-change"]);
    }
}

#[test]
fn specifications_that_cannot_be_met_write_nothing() {
    let folder = thesis();
    let folder = folder.path();
    std::fs::write(folder.join("specs.toml"), "method = \"thesis\"\n[yaw]\novershoot_percent = 5.0\nrise_s = 0.1\nprefilter_rad_s = 4.0\nintegral_rad_s = 0.06\n").unwrap();
    let output =
        run_in(folder, &["design", "--model", "model.toml", "--specs", "specs.toml", "--out", "new.toml"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("NOT MET: yaw: rise, s: wanted 0.1"), "{text}");
    assert!(!folder.join("new.toml").exists());
    std::fs::write(folder.join("specs.toml"), "[yaw]\nspeed = 1\n").unwrap();
    refused(
        folder,
        &["design", "--model", "model.toml", "--specs", "specs.toml", "--out", "new.toml"],
        &["specs.toml: line 2"],
    );
    refused(folder, &["design", "--model", "model.toml"], &["--out"]);
}

/// What a stranger does with a craft of their own, from the model that their flights gave to the
/// next flight: every command takes what the one before left. The demonstration's craft has no
/// flapping moments and hovers in the floor's cushion.
#[test]
fn from_a_stranger_s_flights_to_gains_that_fly_and_the_next_flight() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done_in(folder, &["demo", "--seed", "5", "--out", "."]);
    let model = ["--model", "better.toml"];
    let with_gains = ["--model", "better.toml", "--gains", "gains.toml"];
    let of = |command: &[&'static str], more: &[&'static str]| [command, more].concat();
    assert!(done_in(folder, &of(&["linearize"], &model)).contains("cost J"));
    let designed = json_in(folder, &of(&["design", "--out", "gains.toml", "--force"], &model));
    assert_eq!(designed["shortfalls"].as_array().unwrap().len(), 0);
    let check = json_in(folder, &of(&["design", "check", "--samples", "4"], &with_gains));
    assert_eq!((&check["holds"], &check["together"]["stable"]), (&Value::Bool(true), &Value::Bool(true)));
    assert_eq!(check["steady_tilts"].as_array().unwrap().len(), 4);
    for name in ["roll", "pitch", "yaw", "z", "x", "y"] {
        assert!(named(&check["loops"], name)["gain_margin"].as_f64().unwrap() >= 2.0, "{name}");
    }
    // Flown, with a battery that sags and at the voltage of the flights.
    let read = Model::read(&folder.join("better.toml")).unwrap();
    let config = design::gains_match::read_for(&folder.join("gains.toml"), &read).unwrap().config;
    let settings = sil::Settings { model: Some(read), config: Some(config), ..sil::Settings::default() };
    for scenario in [sil::Scenario::Hover, sil::Scenario::Roll10, sil::Scenario::Excitation] {
        let plan = scenario.plan(&settings);
        let outcome = sil::ScenarioResult::new(scenario, plan.clone(), sil::fly(&plan).unwrap());
        assert!(outcome.pass(), "{scenario}: {:?} {:?}", outcome.metrics, outcome.checks);
    }
    let excite = ["excite", "--path", "hover", "--duration", "10", "--out", "pattern.csv"];
    assert!(done_in(folder, &of(&excite, &with_gains)).contains("std. error"));
    let report = ["design", "report", "--samples", "2", "--out", "report.html", "--force"];
    assert_eq!(done_in(folder, &of(&report, &with_gains)), "page: report.html\n");

    // And what goes wrong, one line each: another craft's gains, and specifications that nothing
    // meets.
    std::fs::write(folder.join("thesis.toml"), GAINS).unwrap();
    let other = of(&["design", "check", "--model", "better.toml", "--gains"], &["thesis.toml"]);
    refused(folder, &other, &["thesis.toml: ", "another vehicle"]);
    std::fs::write(folder.join("specs.toml"), "method = \"thesis\"\n[yaw]\nrise_s = 0.05\n").unwrap();
    let fast = run_in(folder, &of(&["design", "--specs", "specs.toml", "--out", "new.toml"], &model));
    assert_eq!(fast.status.code(), Some(1));
    let said = String::from_utf8(fast.stdout).unwrap();
    assert!(said.contains("NOT MET: yaw: rise, s: wanted 0.0500") && said.contains("(yaw.rise_s)"), "{said}");
}
