//! The demonstration: whatever is hidden is found from the files of the flights, and the page tells it.

mod common;

use std::path::Path;

use common::{done_in, flights, run_in};

/// A seed for each effect that can be hidden.
const SEEDS: [(&str, &str); 8] = [
    ("1", "flapping-moment"),
    ("2", "quadratic-drag"),
    ("3", "steady-wind"),
    ("4", "tracking-offset"),
    ("5", "ground-effect"),
    ("9", "attitude-offset"),
    ("10", "rate-coupling"),
    ("31", "battery-voltage"),
];

/// Coefficient, hidden value, found value, standard error of the table at the end.
fn table(text: &str) -> Vec<(String, f64, f64, f64)> {
    let lines = text.lines().skip_while(|line| !line.starts_with("Hidden: ")).skip(2);
    lines
        .take_while(|line| !line.is_empty())
        .map(|line| {
            let fields: Vec<&str> = line.split_whitespace().collect();
            let number = |k: usize| -> f64 { fields[k].parse().unwrap_or_else(|_| panic!("{line}")) };
            (fields[0].to_owned(), number(1), number(2), number(3))
        })
        .collect()
}

#[test]
fn every_hidden_effect_is_found_with_its_strength() {
    std::thread::scope(|scope| {
        for (seed, effect) in SEEDS {
            scope.spawn(move || found_with_its_strength(seed, effect));
        }
    });
}

fn found_with_its_strength(seed: &str, effect: &str) {
    let folder = tempfile::tempdir().unwrap();
    let text = done_in(folder.path(), &["demo", "--seed", seed]);
    let first = text.split("\n\n").next().unwrap().replace('\n', " ");
    assert!(first.starts_with(&format!("Found: {effect}. ")), "seed {seed}: {first}");
    assert!(first.contains(&format!("Hidden in the simulated craft (seed {seed}): {effect}.")), "{first}");
    let rows = table(&text);
    assert!(!rows.is_empty(), "seed {seed}: {text}");
    for (name, hidden, found, error) in rows {
        // Priors pull the height offset and the voltage shift towards zero; the others are free. Five standard errors are a
        // chance of one in a million; the filters' misfit to fast motion adds up to 3 % of the value.
        let pulled = name == "height_offset" || name == "voltage_shift";
        let allowed = 5.0 * error + 0.03 * hidden.abs();
        let near = (found - hidden).abs() < allowed;
        assert!(pulled || near, "seed {seed}: {name}: {found} +- {error}, hidden {hidden}");
    }
    let out = folder.path().join("out/demo");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains(effect) && page.contains("<svg") && !page.contains("src="), "seed {seed}");
    for file in ["basic.toml", "better.toml", "flights/A.csv", "flights/E.csv", "flights/vehicle.toml"] {
        assert!(out.join(file).is_file(), "seed {seed}: {file}");
    }
    for file in ["basic.toml", "better.toml"] {
        let model = model::Model::read(&out.join(file)).unwrap();
        assert!(!model.fit.unwrap().scatter.is_empty(), "seed {seed}: new flights are held against {file}");
    }
    falls(&text, seed);
}

/// The error of prediction falls with what was added.
fn falls(text: &str, seed: &str) {
    let position = |name: &str| -> f64 {
        let line = text.lines().find(|line| line.trim_start().starts_with(name)).expect(name);
        line.split_whitespace().next_back().unwrap().parse().expect(line)
    };
    assert!(position("+ ") < position("basic "), "seed {seed}: {text}");
}

#[test]
fn flights_of_ones_own_go_through_the_same_loop() {
    let folder = tempfile::tempdir().unwrap();
    let own = flights().to_str().unwrap();
    let text = done_in(folder.path(), &["demo", "--flights", own, "--out", "mine"]).replace('\n', " ");
    assert!(text.contains("Flights split: fitted on A.csv, B.csv, C.csv; held out: D.csv, E.csv."), "{text}");
    assert!(text.contains("Found: ground-effect."), "{text}");
    assert!(folder.path().join("mine/report.html").is_file());
    assert!(!folder.path().join("mine/flights").exists(), "nothing is flown");
}

#[test]
fn other_names_are_split_as_by_the_other_commands() {
    let folder = common::copies();
    for name in ["A", "B", "C", "D", "E"] {
        let path = |name: &str| folder.path().join(format!("{name}.csv"));
        std::fs::rename(path(name), path(&format!("flight-{name}"))).unwrap();
    }
    let text = done_in(folder.path(), &["demo", "--flights", ".", "--out", "mine"]);
    let text = text.replace('\n', " ");
    assert!(
        text.contains(
            "fitted on flight-A.csv, flight-C.csv, flight-D.csv; held out: flight-B.csv, flight-E.csv."
        ),
        "{text}"
    );
}

fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let output = run_in(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
    assert!(stderr.contains(expected), "{arguments:?}: {stderr}");
}

#[test]
fn a_folder_without_flights_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    refused(folder.path(), &["demo", "--flights", "absent"], "absent: cannot read the folder");
    refused(folder.path(), &["demo", "--flights", "."], "no flight file (*.csv) and no log in this folder");
    refused(folder.path(), &["demo", "--flights", ".", "--seed", "1"], "cannot be used with");
    assert!(std::fs::read_dir(folder.path()).unwrap().next().is_none(), "nothing was written");
    std::fs::write(folder.path().join("file"), "").unwrap();
    refused(
        folder.path(),
        &["demo", "--seed", "1", "--out", "file"],
        "file/flights: cannot create the folder",
    );
}
