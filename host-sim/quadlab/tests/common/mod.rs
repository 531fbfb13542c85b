//! The real binary, flights to give it, and what it answered.
#![allow(dead_code, reason = "each test file uses a part of this module")]

use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::OnceLock;
use std::time::UNIX_EPOCH;

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

/// A folder with five simulated flights A to E, in which ground effect is hidden, and their vehicle.toml. They are flown once
/// by each build of the program: a process for each test would fly them a hundred times.
pub(crate) fn flights() -> &'static Path {
    static FLIGHTS: OnceLock<PathBuf> = OnceLock::new();
    FLIGHTS.get_or_init(|| {
        let built = std::fs::metadata(env!("CARGO_BIN_EXE_quadlab")).expect("the binary is built");
        let at = built.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
        let shared = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let place = shared.join(format!("flights-{}-{}", built.len(), at.as_nanos()));
        if !place.is_dir() {
            let folder = tempfile::tempdir_in(shared).expect("a temporary folder");
            done_in(folder.path(), &["demo", "--seed", "5", "--out", "."]);
            forget_others(shared, &place);
            // Whoever comes second has flown the same.
            let flown = std::fs::rename(folder.path().join("flights"), &place);
            assert!(flown.is_ok() || place.is_dir(), "{flown:?}");
        }
        place
    })
}

/// Removes what builds before this one have flown.
fn forget_others(shared: &Path, place: &Path) {
    for entry in std::fs::read_dir(shared).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with("flights-") && entry.path() != place {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
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

/// Runs `quadlab` with `first` and then the five flights of a case of the shared data as [`json_in`].
pub(crate) fn json_of_case(folder: &Path, first: &[&str], case: &Path) -> Value {
    let in_case = SETS.map(|argument| match argument.strip_suffix(".csv") {
        Some(_) => case.join(argument).display().to_string(),
        None => argument.to_owned(),
    });
    let flights = in_case.iter().map(String::as_str);
    json_in(folder, &first.iter().copied().chain(flights).collect::<Vec<_>>())
}

/// Identifies the basic model of the folder's flights into model.toml.
pub(crate) fn identify(folder: &Path) {
    done_in(folder, &with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"]));
}
