//! Each command through the real binary, on simulated flights with ground effect hidden in them: what it prints, what it
//! writes, and the fields of its JSON that the contract fixes.

mod common;

use common::{AXES, copies, done_in, identify, json_in, with_sets};
use model::{Effect, FlightRole, Model, MotorMapKind, RotorQuantity, Vehicle};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn has_axes(value: &Value, fields: &[&str]) {
    for axis in AXES {
        for field in fields {
            number(&value[axis][field]);
        }
    }
}

#[test]
fn identify_writes_a_model_with_its_flights_errors_and_hashes() {
    let folder = copies();
    let out =
        done_in(folder.path(), &with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]));
    for expected in ["C_T", "held-out rms", "gyro bias", "second derivative of the position", "model.toml"] {
        assert!(out.contains(expected), "{expected} is not in\n{out}");
    }
    assert!(out.lines().all(|line| line.chars().count() <= 110), "{out}");

    let model = Model::read(&folder.path().join("model.toml")).unwrap();
    assert_eq!(model.effects(), Effect::basic().collect::<Vec<_>>());
    let record = model.fit.as_ref().expect("a fit record");
    let roles: Vec<_> = record.flights.iter().map(|f| (f.name.as_str(), f.role)).collect();
    let (train, validate) = (FlightRole::Train, FlightRole::Validate);
    let expected =
        [("A.csv", train), ("B.csv", train), ("C.csv", train), ("D.csv", validate), ("E.csv", validate)];
    assert_eq!(roles, expected);
    for flight in &record.flights {
        let output = std::process::Command::new("sha256sum").arg(folder.path().join(&flight.name)).output();
        match output {
            Ok(output) if output.status.success() => {
                assert!(output.stdout.starts_with(flight.sha256.as_bytes()), "{}", flight.name);
            }
            _ => println!("SKIPPED: no sha256sum to check the hash of {} with", flight.name),
        }
    }
    assert!(record.held_out.p.r2 > 0.9 && record.train.p.r2 > 0.9, "{record:?}");
}

/// Without a motor map, nothing is said to be in rad/s of the rotors, and no thrust coefficient to be without a unit.
#[test]
fn units_without_a_motor_map_are_those_of_commands() {
    let folder = copies();
    let path = folder.path().join("vehicle.toml");
    let mut vehicle = Vehicle::read(&path).unwrap();
    let motors = &mut vehicle.motors;
    (motors.map, motors.command, motors.voltage, motors.offset) =
        (Some(MotorMapKind::Identify), None, None, None);
    std::fs::write(&path, toml::to_string(&vehicle).unwrap()).unwrap();
    let identify = with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]);
    let text = done_in(folder.path(), &identify);
    let thrust = text.lines().find(|line| line.contains("C_T")).unwrap();
    assert!(thrust.ends_with("1/(s^2 cmd^2)"), "{thrust}");
    assert!(!text.contains("1/(kg m^2)\n"), "{text}");

    let forced: Vec<&str> = identify.into_iter().chain(["--force"]).collect();
    let json = json_in(folder.path(), &forced);
    let model: toml::Table =
        std::fs::read_to_string(folder.path().join("model.toml")).unwrap().parse().unwrap();
    let written = model["effect"].as_array().unwrap().iter().flat_map(|effect| {
        let all = effect["coefficient"].as_array().unwrap().iter();
        all.map(|c| (c["name"].as_str().unwrap(), c["unit"].as_str().unwrap()))
    });
    let printed = json["coefficients"].as_array().unwrap().iter();
    let printed = printed.map(|c| (c["name"].as_str().unwrap(), c["unit"].as_str().unwrap()));
    let expected: Vec<(&str, &str)> = Effect::basic()
        .flat_map(|effect| effect.info().coefficients)
        .map(|c| (c.name, c.unit_for(RotorQuantity::Command)))
        .collect();
    assert!(expected.contains(&("C_T", "1/(s^2 cmd^2)")) && expected.contains(&("Ir/Ixx", "1/(s cmd)")));
    assert_eq!(printed.collect::<Vec<_>>(), expected);
    assert_eq!(written.collect::<Vec<_>>(), expected);
}

/// A model with 5 % more thrust and a wind, of which the flights have neither: since then the craft is heavier, and the wind is gone.
#[test]
fn the_page_of_changes_draws_each_beside_all_others() {
    let folder = copies();
    done_in(folder.path(), &with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]));
    let path = folder.path().join("model.toml");
    let mut model = Model::read(&path).unwrap();
    let thrust = model.term(Effect::Thrust).unwrap().values()[0];
    model.set(Effect::Thrust, &[1.05 * thrust]);
    model.set(Effect::SteadyWind, &[0.5, 0.0]);
    model.correlation = None;
    std::fs::write(&path, model.to_toml()).unwrap();
    let changed = ["diagnose", "--model", "model.toml", "--changed", "D.csv", "E.csv", "--html", "page.html"];
    let out = done_in(folder.path(), &changed);
    assert!(out.contains("steady-wind") && out.contains("mass-change"), "{out}");
    let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
    for said in [
        "The changes: steady-wind and mass-change",
        "All other coefficients of the model stay as they were fitted.",
        "With and without steady-wind",
        "With and without mass-change",
        "and &quot;without it&quot; is the same model without this one.",
        "With all of them, the error falls in each of these flights.",
        "What else mass-change could be",
    ] {
        assert!(page.contains(said), "{said}");
    }
    assert!(!page.contains("estimated at the same time"), "neither brings anything else to light");
}

#[test]
fn identify_finds_what_the_simulated_craft_has() {
    let folder = copies();
    let json =
        json_in(folder.path(), &with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]));
    has_axes(&json["train"], &["rms", "sse", "r2"]);
    has_axes(&json["held_out"], &["rms", "sse", "r2"]);
    assert_eq!(json["flights"].as_array().unwrap().len(), 5);
    let truth = Model::parse(include_str!("../data/craft.toml"), "craft.toml".as_ref()).unwrap();
    let found = json["coefficients"].as_array().unwrap();
    // The drag in the rotor plane and the damping are on axes that ground effect does not touch.
    for (effect, name, index) in [
        (Effect::LinearDrag, "C_du", 0),
        (Effect::LinearDrag, "C_dv", 1),
        (Effect::AngularDamping, "C_dr/Izz", 2),
    ] {
        let entry = found.iter().find(|c| c["name"] == name).expect(name);
        assert_eq!(entry["effect"], effect.id());
        let (value, error) = (number(&entry["value"]), number(&entry["std_error"]));
        let expected = truth.term(effect).unwrap().coefficients[index].value;
        // Five standard errors: a chance of one in a million for each, if the errors are honest.
        assert!(
            (value - expected).abs() < 5.0 * error,
            "{name}: {value} +- {error}, the craft has {expected}"
        );
        assert!(error < 0.05 * expected.abs(), "{name}: an error of {error} says little");
    }
}

#[test]
fn compare_has_the_fields_of_the_contract_and_a_page() {
    let folder = copies();
    identify(folder.path());
    let json = json_in(
        folder.path(),
        &["compare", "--model", "model.toml", "--flights", "D.csv", "E.csv", "--html", "page.html"],
    );
    let flights = json["flights"].as_array().unwrap();
    assert_eq!(flights.len(), 2);
    let mut sse = 0.0;
    for (flight, name) in flights.iter().zip(["D.csv", "E.csv"]) {
        assert_eq!(flight["name"], name);
        assert!(number(&flight["samples"]) > 1000.0);
        has_axes(&flight["axes"], &["rms", "sse", "r2"]);
        let axis = &flight["axes"]["w"];
        let mean_square = number(&axis["sse"]) / number(&flight["samples"]);
        assert!(
            (mean_square.sqrt() / number(&axis["rms"]) - 1.0).abs() < 1e-9,
            "rms and sse of one flight agree"
        );
        sse += number(&axis["sse"]);
    }
    has_axes(&json["total"], &["rms", "sse", "r2"]);
    assert!((number(&json["total"]["w"]["sse"]) / sse - 1.0).abs() < 1e-9, "the total is the sum");
    let horizon = |name: &str, field: &str| number(&json["horizons"][name][field]);
    for field in ["position_m", "velocity_m_s", "attitude_rad", "rate_rad_s"] {
        let (one, ten, fifty) = (horizon("1", field), horizon("10", field), horizon("50", field));
        assert!(0.0 < one && one <= 1.5 * ten && ten < 1.5 * fifty, "{field}: {one} {ten} {fifty}");
        let sum = horizon("sum_1_50", field);
        assert!(sum > one + ten + fifty && sum < 75.0 * fifty, "{field}: {sum}");
    }
    let worst = json["worst"].as_array().unwrap();
    // Ground effect is missing from the basic model: some condition of w has to stand out.
    assert!(worst.iter().any(|w| w["axis"] == "w"), "{worst:?}");
    for w in worst {
        assert!(w["condition"].is_string() && number(&w["rms"]) > 0.0);
        assert!((0.0..=100.0).contains(&number(&w["share_percent"])));
    }
    self_contained(&std::fs::read_to_string(folder.path().join("page.html")).unwrap());
}

/// A page that refers to nothing outside itself.
fn self_contained(page: &str) {
    assert!(
        page.starts_with("<!DOCTYPE html>") && page.contains("<svg") && page.trim_end().ends_with("</html>")
    );
    for outside in ["<script>", "src=", "<link", "@import", "fetch(", "import("] {
        assert!(!page.contains(outside), "the page holds {outside}");
    }
}

#[test]
fn compare_warns_of_flights_that_the_model_was_fitted_to() {
    let folder = copies();
    identify(folder.path());
    let output =
        common::run_in(folder.path(), &["compare", "--model", "model.toml", "--flights", "A.csv", "D.csv"]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0));
    assert!(stderr.starts_with("warning: A.csv:") && stderr.lines().count() == 1, "{stderr}");
}

#[test]
fn models_are_compared_side_by_side() {
    let folder = copies();
    identify(folder.path());
    let add = ["add", "ground-effect", "--model", "model.toml", "--out", "better.toml"];
    done_in(folder.path(), &with_sets(&add));
    let compare = ["compare", "--model", "model.toml", "better.toml", "--flights", "D.csv", "E.csv"];
    let text = done_in(folder.path(), &compare);
    assert!(
        text.contains("model.toml") && text.contains("better.toml") && text.contains("reduction of the rms")
    );
    let page = done_in(folder.path(), &[&compare[..], &["--html", "page.html"]].concat());
    assert!(page.contains("page: page.html"));
    self_contained(&std::fs::read_to_string(folder.path().join("page.html")).unwrap());
    let json = json_in(folder.path(), &compare);
    let alone = json_in(folder.path(), &["compare", "--model", "better.toml", "--flights", "D.csv", "E.csv"]);
    assert_eq!(json["models"][1]["total"], alone["total"]);
    let w = |model: usize| json["models"][model]["total"]["w"]["rms"].as_f64().unwrap();
    assert!(w(1) < w(0), "ground effect is hidden in these flights: {} {}", w(1), w(0));
}

#[test]
fn diagnose_names_the_hidden_effect_and_add_takes_it_away() {
    let folder = copies();
    identify(folder.path());
    let diagnose = ["diagnose", "--model", "model.toml", "--html", "page.html"];
    let json = json_in(folder.path(), &with_sets(&diagnose));
    assert_eq!(json["verdict"], "missing-effect");
    let effects = json["effects"].as_array().unwrap();
    // Roll and pitch say that the rotors are alike: nobody asks whether the lift says something else.
    assert_eq!(effects.len(), Effect::candidates().filter(|e| *e != Effect::UnequalThrust).count());
    assert_eq!(effects[0]["effect"], "ground-effect");
    for finding in effects {
        let effect =
            Effect::from_id(finding["effect"].as_str().unwrap()).expect("an effect of the catalogue");
        assert!(finding["supported"].is_boolean() && finding["confounded_with"].is_array());
        assert!((0.0..=1.0).contains(&number(&finding["p_value"])));
        number(&finding["drop_percent"]);
        // One whose fit was refused has figures of nothing, and a reason.
        if finding["coefficients"].as_array().is_some_and(Vec::is_empty) {
            assert!(!finding["reason"].as_str().unwrap().is_empty() && finding["supported"] == false);
            continue;
        }
        for axis in effect.info().axes {
            let axis = &finding["axes"][axis.name()];
            let (before, after) = (number(&axis["sse_before"]), number(&axis["sse_after"]));
            let drop = 100.0 * (1.0 - after / before);
            assert!((number(&axis["drop_percent"]) - drop).abs() < 1e-9);
        }
        for (c, info) in finding["coefficients"].as_array().unwrap().iter().zip(effect.info().coefficients) {
            assert_eq!((c["name"].as_str(), c["unit"].as_str()), (Some(info.name), Some(info.unit)));
            number(&c["value"]);
            number(&c["std_error"]);
        }
    }
    assert!(json["unexplained"].is_array());
    self_contained(&std::fs::read_to_string(folder.path().join("page.html")).unwrap());
    let text = done_in(folder.path(), &with_sets(&["diagnose", "--model", "model.toml"]));
    assert!(text.starts_with("The model lacks ground-effect."), "{text}");

    let add = ["add", "ground-effect", "--model", "model.toml", "--out", "better.toml"];
    let json = json_in(folder.path(), &with_sets(&add));
    assert_eq!((json["effect"].as_str(), json["supported"].as_bool()), (Some("ground-effect"), Some(true)));
    for axis in AXES {
        let (before, after) = (number(&json["sse_before"][axis]), number(&json["sse_after"][axis]));
        let drop = number(&json["drop_percent"][axis]);
        assert!((100.0 * (1.0 - after / before) - drop).abs() < 1e-9, "{axis}");
    }
    // Simulated flights with nothing else missing: what is left of w is noise, a small part of what was there.
    assert!(number(&json["drop_percent"]["w"]) > 50.0, "{json}");

    let better = Model::read(&folder.path().join("better.toml")).unwrap();
    assert!(better.has(Effect::GroundEffect));
    assert_eq!(better.history.len(), 1);
    assert_eq!((better.history[0].effect.as_str(), better.history[0].supported), ("ground-effect", true));
    assert_eq!(better.history[0].sse_after.w, number(&json["sse_after"]["w"]));
    assert_eq!(better.fit.as_ref().map(|fit| fit.held_out.w.sse), Some(better.history[0].sse_after.w));
    let json = json_in(folder.path(), &with_sets(&["diagnose", "--model", "better.toml"]));
    assert_eq!(json["verdict"], "adequate", "{json}");
}

#[test]
fn an_effect_that_the_flights_do_not_support_is_added_and_said_to_be_so() {
    let folder = copies();
    identify(folder.path());
    let add = ["add", "rate-coupling", "--model", "model.toml", "--out", "worse.toml"];
    let text = done_in(folder.path(), &with_sets(&add));
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("NOT supported") && text.contains("(rate-coupling means: Pitching"), "{text}");
    let model = Model::read(&folder.path().join("worse.toml")).unwrap();
    assert!(model.has(Effect::RateCoupling) && !model.history[0].supported);
    // A second effect keeps the history of the first.
    let add = ["add", "ground-effect", "--model", "worse.toml", "--out", "worse.toml", "--force"];
    assert_eq!(json_in(folder.path(), &with_sets(&add))["supported"], true);
    let model = Model::read(&folder.path().join("worse.toml")).unwrap();
    let effects: Vec<&str> = model.history.iter().map(|h| h.effect.as_str()).collect();
    assert_eq!(effects, ["rate-coupling", "ground-effect"]);
}

/// On one, two and eight threads.
#[test]
fn the_answer_does_not_depend_on_the_threads() {
    let answers = ["1", "2", "8"].map(|threads| {
        let folder = copies();
        let run = |arguments: &[&str]| {
            let mut command = assert_cmd::Command::cargo_bin("quadlab").unwrap();
            command.current_dir(folder.path()).env("RAYON_NUM_THREADS", threads);
            let output = command.args(with_sets(arguments)).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
            output.stdout
        };
        run(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]);
        let answer = run(&["diagnose", "--model", "model.toml", "--json"]);
        (std::fs::read(folder.path().join("model.toml")).unwrap(), answer)
    });
    assert!(answers[0].1.len() > 1000);
    for (one, other) in [(0, 1), (0, 2)] {
        assert!(answers[one] == answers[other], "{one} {other}");
    }
}

#[test]
fn the_same_flights_give_the_same_bytes() {
    let (one, two) = (copies(), copies());
    for folder in [&one, &two] {
        identify(folder.path());
        let html = ["diagnose", "--model", "model.toml", "--html", "page.html"];
        done_in(folder.path(), &with_sets(&html));
    }
    for name in ["model.toml", "page.html"] {
        let read = |folder: &tempfile::TempDir| std::fs::read(folder.path().join(name)).unwrap();
        assert!(read(&one) == read(&two), "{name} differs between two runs");
    }
}

#[test]
fn effects_lists_the_catalogue() {
    let folder = tempfile::tempdir().unwrap();
    let text = done_in(folder.path(), &["effects"]);
    let json = json_in(folder.path(), &["effects"]);
    let entries = json.as_array().unwrap();
    assert_eq!(entries.len(), model::effects::CATALOGUE.len());
    for (entry, effect) in entries.iter().zip(model::effects::CATALOGUE) {
        assert_eq!(entry["effect"], effect.id());
        assert!(text.contains(&format!("  {}  (acts on ", effect.id())), "{effect}");
    }
}

#[test]
fn every_command_has_help_with_an_example() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["identify", "compare", "diagnose", "add", "effects", "demo", "linearize"] {
        let help = done_in(folder.path(), &[command, "--help"]);
        assert!(help.contains("Example") && help.contains(&format!("  quadlab {command}")), "{help}");
    }
}

#[test]
fn colours_are_for_terminals_that_want_them() {
    // CLICOLOR_FORCE (bixense.com/clicolors) stands for a terminal: a pipe has no colours without it.
    let said = |environment: &[(&str, &str)]| {
        let mut command = assert_cmd::Command::cargo_bin("quadlab").unwrap();
        command.args(["compare", "--model", "none.toml", "--flights", "A.csv"]);
        command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE").envs(environment.iter().copied());
        String::from_utf8(command.output().unwrap().stderr).unwrap()
    };
    assert!(said(&[]).starts_with("error: "), "{:?}", said(&[]));
    assert!(said(&[("NO_COLOR", "1")]).starts_with("error: "));
    assert!(said(&[("CLICOLOR_FORCE", "1")]).starts_with("\u{1b}[1m\u{1b}[31merror:\u{1b}[0m "));
}
