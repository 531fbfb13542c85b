//! Users' effects through the real commands: listed, diagnosed, added, refused, and a model file that needs no other.

mod common;

use std::path::Path;

use common::{copies, done_in, identify, json_in, json_of_case, run_in, shared, with_sets};
use model::Effect;

/// A cable to a hook, as a user who does not know the catalogue writes it.
const CABLE: &str = include_str!("../../model/tests/my-cable.toml");

/// What the hidden ground effect of the test flights looks like to a user: more thrust near the floor.
const CUSHION: &str = r#"
[[effect]]
id = "cushion"
sentence = "Air is trapped between the craft and the floor."
acceleration.w = "-k * thrust * exp(-height / decay)"
coefficient = [
  { name = "k", unit = "1", possible = [0.0, 1.0], typical = 0.01 },
  { name = "decay", unit = "m", possible = [0.02, 2.0], typical = 0.2 },
]
"#;

#[test]
fn a_users_effect_is_listed_diagnosed_and_added() {
    let folder = copies();
    std::fs::write(folder.path().join("my.toml"), CUSHION).unwrap();
    let listed = json_in(folder.path(), &["effects", "--effects", "my.toml"]);
    let own = listed.as_array().unwrap().last().unwrap();
    assert_eq!(own["effect"], "cushion");
    assert_eq!(own["coefficients"][1]["unit"], "m");
    assert_eq!(own["axes"], serde_json::json!(["w"]));

    identify(folder.path());
    let diagnosis =
        json_in(folder.path(), &with_sets(&["diagnose", "--model", "model.toml", "--effects", "my.toml"]));
    let finding = diagnosis["effects"].as_array().unwrap().iter().find(|e| e["effect"] == "cushion").unwrap();
    assert!(finding["drop_percent"].as_f64().unwrap() > 50.0, "{finding}");
    // The catalogue's own is what was hidden, and it fits better.
    assert_eq!(diagnosis["effects"][0]["effect"], "ground-effect");

    let add = ["add", "cushion", "--effects", "my.toml", "--model", "model.toml", "--out", "better.toml"];
    let added = json_in(folder.path(), &with_sets(&add));
    assert_eq!(added["supported"], true, "{added}");
    // From here on nobody needs the file of effects.
    std::fs::remove_file(folder.path().join("my.toml")).unwrap();
    let compared = json_in(folder.path(), &["compare", "--model", "better.toml", "--flights", "D.csv"]);
    assert!(compared["total"]["w"]["sse"].as_f64().unwrap().is_finite());
    done_in(folder.path(), &with_sets(&["diagnose", "--model", "better.toml"]));
    let text = std::fs::read_to_string(folder.path().join("better.toml")).unwrap();
    assert!(text.contains("acceleration") && text.contains("exp(-height / decay)"), "{text}");
}

#[test]
fn bad_effects_are_refused_with_one_line() {
    let folder = copies();
    identify(folder.path());
    let refused = |text: &str, expected: &str| {
        std::fs::write(folder.path().join("my.toml"), text).unwrap();
        let add = ["add", "my-cable", "--effects", "my.toml", "--model", "model.toml", "--out", "out.toml"];
        let output = run_in(folder.path(), &with_sets(&add));
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(expected) && stderr.lines().count() == 1, "{stderr}");
        assert!(!folder.path().join("out.toml").exists());
    };
    refused(
        &CABLE.replacen("stiffness * north", "stiffness * north_speed", 1),
        "my.toml: effect \"my-cable\": acceleration.north: takes the difference of kg m/s^2 and kg m/s^3",
    );
    refused(&CABLE.replacen("\"my-cable\"", "\"tether\"", 1), "is an effect of the catalogue");
    refused(&CABLE.replacen("\"my-cable\"", "\"his-cable\"", 1), "unknown effect \"my-cable\"; known are");
    refused(&" ".repeat(70_000), "my.toml: is larger than");
    refused(&CABLE.replacen("stiffness * north", &"(".repeat(400), 1), "nested deeper");
}

#[test]
fn samples_without_a_value_are_counted_and_said() {
    let folder = copies();
    identify(folder.path());
    let text = "[[effect]]\nid = \"cushion\"\nacceleration.w = \"-k * thrust * sqrt(height - low)\"\n\
                coefficient = [{ name = \"k\", unit = \"1/m^0.5\", possible = [-1.0, 1.0], typical = 0.01 }]\n\
                constant = [{ name = \"low\", unit = \"m\", value = 0.4 }]\n";
    std::fs::write(folder.path().join("my.toml"), text).unwrap();
    let add =
        ["add", "cushion", "--effects", "my.toml", "--model", "model.toml", "--out", "out.toml", "--json"];
    let output = run_in(folder.path(), &with_sets(&add));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("samples left out") && stderr.contains("acceleration.w = "), "{stderr}");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["sse_after"]["w"].as_f64().unwrap().is_finite(), "{json}");
}

/// A flight of an outside simulator with a cable in it: the user's own does what the catalogue's does.
#[test]
fn a_users_cable_explains_a_cable_as_the_catalogue_does() {
    let Some(case) = shared("data/hidden/case-08") else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my.toml"), CABLE).unwrap();
    let json = |first: &[&str]| json_of_case(folder.path(), first, &case);
    let vehicle = case.join("vehicle.toml").display().to_string();
    json(&["identify", "--vehicle", &vehicle, "--out", "model.toml"]);
    let own =
        json(&["add", "my-cable", "--effects", "my.toml", "--model", "model.toml", "--out", "own.toml"]);
    let known = json(&["add", Effect::Tether.id(), "--model", "model.toml", "--out", "known.toml"]);
    assert_eq!(own["supported"], true, "{own}");
    for axis in ["u", "v", "w"] {
        let after = |json: &serde_json::Value| json["sse_after"][axis].as_f64().unwrap();
        // The same columns: the same error but for rounding.
        assert!((after(&own) / after(&known) - 1.0).abs() < 1e-6, "{axis}: {own} {known}");
        assert!(own["drop_percent"][axis].as_f64().unwrap() > 90.0, "{own}");
    }
    assert!(Path::new(&vehicle).exists());
}
