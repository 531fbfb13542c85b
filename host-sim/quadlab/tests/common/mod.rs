//! The real binary, flights to give it, and what it answered.
#![allow(dead_code, reason = "each test file uses a part of this module")]

use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::OnceLock;

use serde_json::Value;

#[path = "../../../diagnosis/tests/common/shared.rs"]
mod shared;
#[allow(unused_imports, reason = "each test file uses a part of this module")]
pub(crate) use shared::shared;

/// The axes of the contract's JSON.
pub(crate) const AXES: [&str; 6] = ["u", "v", "w", "p", "q", "r"];

/// Runs `quadlab` with `arguments` in `folder`.
pub(crate) fn run_in(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = assert_cmd::Command::cargo_bin("quadlab").expect("the binary is built with its tests");
    command.current_dir(folder).args(arguments).output().expect("the binary starts")
}

/// Runs `quadlab` as [`run_in`]; it has to succeed. Its standard output.
pub(crate) fn done_in(folder: &Path, arguments: &[&str]) -> String {
    let output = run_in(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "quadlab {arguments:?}: {stderr}");
    String::from_utf8(output.stdout).expect("output is UTF-8")
}

/// Runs `quadlab` with `--json` as [`done_in`]: one document on standard output, nothing on standard error.
pub(crate) fn json_in(folder: &Path, arguments: &[&str]) -> Value {
    let arguments: Vec<&str> = arguments.iter().copied().chain(["--json"]).collect();
    let output = run_in(folder, &arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "quadlab {arguments:?}: {stderr}");
    assert!(stderr.is_empty(), "quadlab {arguments:?} wrote to standard error: {stderr}");
    serde_json::from_slice(&output.stdout).expect("standard output is one JSON document")
}

/// A folder with five simulated flights A to E, in which ground effect is hidden, and their vehicle.toml.
pub(crate) fn flights() -> &'static Path {
    static FLIGHTS: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FLIGHTS.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        done_in(folder.path(), &["demo", "--seed", "5", "--out", "."]);
        folder
    });
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| folder.path().join("flights"))
}

/// A folder of its own with copies of the five flights and their vehicle.toml.
pub(crate) fn copies() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv", "vehicle.toml"] {
        std::fs::copy(flights().join(name), folder.path().join(name)).expect("the flights were written");
    }
    folder
}

/// Arguments that give the five flights of a folder.
pub(crate) const SETS: [&str; 7] = ["--train", "A.csv", "B.csv", "C.csv", "--validate", "D.csv", "E.csv"];

/// The arguments `first` and then the five flights.
pub(crate) fn with_sets<'a>(first: &[&'a str]) -> Vec<&'a str> {
    first.iter().copied().chain(SETS).collect()
}

/// Identifies the basic model of the folder's flights into model.toml.
pub(crate) fn identify(folder: &Path) {
    done_in(folder, &with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]));
}
