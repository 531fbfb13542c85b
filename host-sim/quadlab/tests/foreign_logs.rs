//! Files that are neither flights nor logs, and broken ones, given to every command that takes flights, in every place: one line
//! that names the file, says what it is and how to mend it, exit status 2, nothing on standard output and nothing written.
//! Logs of other programs that hold no flight of the model's craft are refused in the same way.

mod common;

use std::path::{Path, PathBuf};

use common::{copies, identify, run_in, shared};

/// Files that are no flights: those of the shared data, and beginnings of files that people have.
fn foreign(folder: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = Vec::new();
    for inside in ["data/logs", "data/broken"] {
        let Some(from) = shared(inside) else { continue };
        let entries = std::fs::read_dir(from).unwrap().map(|entry| entry.unwrap().path());
        // A folder stands for the flights in it. Whole logs hold flights, which any craft with such commands can be asked about
        // (`import.rs`).
        let is_whole = |path: &PathBuf| {
            inside == "data/logs"
                && !path.extension().is_some_and(|ending| ending == "json" || ending == "yaml")
        };
        all.extend(entries.filter(|path| path.is_file() && !is_whole(path)));
    }
    for (name, content) in [
        ("made.bin", &b"\xa3\x95\x80\x80\x59FMT\x00\x00"[..]),
        ("made.bbl", b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n"),
        ("made.xlsx", b"PK\x03\x04\x14\x00\x06\x00"),
        ("made.csv.gz", b"\x1f\x8b\x08\x00\x00"),
        ("zeros.csv", &[0; 4096]),
        ("noise.csv", b"\xff\xfe\x00\x01 1,2,3\n4,5\x07,6\n"),
        ("bell.csv", b"t,x,\x07y\n0,0,0\n"),
        ("columns.csv", b"time,px,py\n0,0,0\n0.01,0,0\n"),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, content).unwrap();
        all.push(path);
    }
    all.sort();
    all
}

/// Each command with the foreign file in each place that takes flights.
fn commands(file: &str) -> Vec<Vec<&str>> {
    let vehicle = ["--vehicle", "vehicle.toml"];
    let model = ["--model", "model.toml"];
    let (out, page) = (["--out", "out.toml"], ["--html", "page.html"]);
    let mut all = Vec::new();
    // One flight beside it: all are read before the first is refused.
    let train = ["--train", file, "--validate", "D.csv"];
    let validate = ["--train", "A.csv", "--validate", file];
    for sets in [train, validate] {
        all.push([&["identify"][..], &vehicle, &out, &sets].concat());
        all.push([&["explain"][..], &vehicle, &out, &sets].concat());
        all.push([&["diagnose"][..], &model, &page, &sets].concat());
        all.push([&["add", "ground-effect"][..], &model, &out, &sets].concat());
    }
    all.push([&["compare"][..], &model, &page, &["--flights", file]].concat());
    all.push([&["diagnose"][..], &model, &["--changed", file, "--json"]].concat());
    all
}

#[test]
fn no_command_takes_a_foreign_log_for_a_flight() {
    let folder = copies();
    identify(folder.path());
    let logs = foreign(folder.path());
    let names = || -> Vec<_> {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut all: Vec<_> = entries.map(|e| e.unwrap().file_name()).collect();
        all.sort();
        all
    };
    let before = names();
    for log in &logs {
        let file = log.to_str().unwrap();
        for command in commands(file) {
            let output = run_in(folder.path(), &command);
            let stderr = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{command:?}: {stderr}");
            assert!(output.stdout.is_empty(), "{command:?}");
            // A flight of a log is named after it.
            let named = format!("error: {}", log.with_extension("").display());
            assert!(stderr.starts_with(&named) && stderr.lines().count() == 1, "{command:?}: {stderr}");
            assert!(stderr.trim_end().chars().all(|c| !c.is_control()), "{command:?}: {stderr:?}");
        }
        let said = String::from_utf8(run_in(folder.path(), &commands(file)[0]).stderr).unwrap();
        let ending = log.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let expected = match ending.as_deref() {
            Some("xlsx") => "spreadsheet",
            Some("gz") => "gzip",
            Some("json" | "yaml") => "column \"t\" is missing",
            _ if file.ends_with("columns.csv") => "column \"phi\" is missing",
            Some("csv") => "binary file",
            _ => ": ",
        };
        assert!(said.contains(expected), "{expected}: {said}");
        println!("{}", said.trim_end());
    }
    assert_eq!(names(), before);
}
