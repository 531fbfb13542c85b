//! Flights that do not determine a model: what the commands say, with which exit status, and what `design` does about it.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::path::Path;

use common::{copies, done_in, identify, run_in, with_sets};
use model::{Group, Model, NotIdentified};
use serde_json::Value;

/// Flights whose commands run backwards: those of another flight would be as wrong, and nothing that motors do can be learned.
fn with_wrong_commands() -> tempfile::TempDir {
    let folder = copies();
    for name in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"] {
        let path = folder.path().join(name);
        let text = std::fs::read_to_string(&path).unwrap();
        let mut rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let places: Vec<usize> = (0..rows[0].len()).filter(|k| rows[0][*k].starts_with("cmd")).collect();
        assert_eq!(places.len(), 4);
        for place in places {
            let backwards: Vec<&str> = rows[1..].iter().rev().map(|row| row[place]).collect();
            rows[1..].iter_mut().zip(backwards).for_each(|(row, command)| row[place] = command);
        }
        let rows: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
        std::fs::write(&path, rows.join("\n") + "\n").unwrap();
    }
    folder
}

/// The document of a command that ends with status 1.
fn unheld(folder: &Path, arguments: &[&str]) -> Value {
    let arguments: Vec<&str> = arguments.iter().copied().chain(["--json"]).collect();
    let output = run_in(folder, &arguments);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn flights_that_do_not_determine_the_model_end_with_status_1_after_everything_is_written() {
    let folder = with_wrong_commands();
    let at = folder.path();
    let explain = ["explain", "--vehicle", "vehicle.toml", "--out", "model.toml", "--html", "page.html"];
    let document = unheld(at, &with_sets(&explain));
    schemas::assert_valid("explain", &document);
    assert_eq!(document["verdict"], "not-identified");
    assert_eq!(document["verdicts"]["rotation"], "not-identified");
    assert!(document["summary"].as_str().unwrap().contains("To determine it: "), "{}", document["summary"]);
    let unknown = document["not_identified"].as_array().unwrap();
    assert!(unknown.iter().any(|one| one["group"] == "rotation"), "{unknown:?}");
    assert!(unknown.iter().all(|one| one["reason"].is_string() && !one["fly"].as_str().unwrap().is_empty()));
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("Not identified: what these flights do not determine"));
    let record = Model::read(&at.join("model.toml")).unwrap().fit.unwrap();
    let verdicts = serde_json::to_value(record.verdicts).unwrap();
    assert_eq!(verdicts, document["verdicts"]);
    assert!(record.not_identified.iter().any(|one| one.group == Group::Rotation));

    let diagnose = with_sets(&["diagnose", "--model", "model.toml"]);
    let document = unheld(at, &diagnose);
    schemas::assert_valid("diagnose", &document);
    assert_eq!(document["verdict"], "not-identified");
    let output = run_in(at, &diagnose);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stdout).unwrap();
    // A paragraph is wrapped.
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("The rotation is not identified by these flights"), "{said}");
    assert!(said.contains("Not identified: what these flights do not determine"), "{said}");
}

/// A model is what was asked for, and it is there: identify warns and ends well.
#[test]
fn identify_warns_of_what_it_does_not_identify_and_ends_well() {
    let folder = with_wrong_commands();
    let at = folder.path();
    let first = with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml", "--force"]);
    let output = run_in(at, &first);
    assert_eq!(output.status.code(), Some(0));
    let warned = String::from_utf8(output.stderr).unwrap();
    assert!(warned.contains("the rotation is not identifiable from these flights"), "{warned}");
    assert!(warned.contains("warning: the translation of this model is not identified: "), "{warned}");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("Not identified: what these flights do not determine"), "{said}");
    let output = run_in(at, &[&first[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    schemas::assert_valid("identify", &document);
    let unknown = document["not_identified"].as_array().unwrap();
    assert!(unknown.iter().any(|one| one["group"] == "translation"), "{unknown:?}");
    assert!(unknown.iter().any(|one| one["group"] == "rotation"), "{unknown:?}");
}

#[test]
fn design_refuses_a_model_that_is_not_identified_unless_it_is_accepted() {
    let folder = copies();
    let at = folder.path();
    identify(at);
    let path = at.join("model.toml");
    let mut model = Model::read(&path).unwrap();
    assert_eq!(model.fit.as_ref().unwrap().not_identified, []);
    let design = |more: &[&str]| {
        run_in(at, &[&["design", "--model", "model.toml", "--out", "gains.toml", "--force"], more].concat())
    };
    let before = design(&[]);
    let unknown =
        NotIdentified::of_group(Group::Rotation, "motor 1 pulls".into(), "excite each motor by itself");
    model.fit.as_mut().unwrap().not_identified.push(unknown);
    std::fs::write(&path, model.to_toml()).unwrap();
    let refused = design(&[]);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(
        String::from_utf8(refused.stderr).unwrap(),
        "error: model.toml: the rotation of this model is not identified: motor 1 pulls; to determine it: excite each \
         motor by itself (or --accept-unidentified to design all the same)\n"
    );
    let accepted = design(&["--accept-unidentified"]);
    assert_eq!(accepted.status.code(), before.status.code());
    assert_eq!(accepted.stdout, before.stdout);
    assert!(done_in(at, &["design", "--help"]).contains("--accept-unidentified"));
}
