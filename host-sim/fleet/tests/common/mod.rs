//! Fleets of simulated flights: the product's own plant under a simple state feedback, with sensor noise.
#![allow(dead_code, reason = "each test binary uses its own part")]

#[path = "../../../diagnosis/tests/common/flown.rs"]
mod flown;

use std::path::{Path, PathBuf};

use diagnosis::workflow::Observer;
use fleet::{Answer, Fleet, Indexed, PassOptions, Question, ask, pass};
pub(crate) use flown::{ORDINARY, fly, truth};
use model::Model;

/// Adds a craft's folder with its vehicle file.
pub(crate) fn craft(root: &Path, name: &str) -> PathBuf {
    let folder = root.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("vehicle.toml"), toml::to_string(&truth().vehicle).unwrap()).unwrap();
    folder
}

/// Adds a flight of `seconds`, flown on a day of March 2026.
pub(crate) fn flight(folder: &Path, model: &Model, day: u64, seed: u64, seconds: f64) {
    let flown = fly(model, seed, seconds, &ORDINARY);
    std::fs::write(folder.join(format!("2026-03-{day:02}.csv")), flown.to_csv()).unwrap();
}

/// Where the index of a test lies.
pub(crate) fn index(root: &Path) -> PathBuf {
    root.join(".quadlab/fleet.parquet")
}

pub(crate) fn updated(root: &Path, options: PassOptions, observer: &dyn Observer) -> (Fleet, Indexed) {
    let fleet = Fleet::find(root, &index(root)).unwrap();
    let indexed = pass(&fleet, &index(root), options, observer).unwrap();
    (fleet, indexed)
}

/// What a fleet says, without the causes of changes in the logs.
pub(crate) fn asked(fleet: &Fleet, indexed: &Indexed, question: &Question) -> Answer {
    ask(fleet, indexed, question).unwrap().answer
}

/// An answer but for how many files were read for it.
pub(crate) fn text(answer: &Answer) -> String {
    serde_json::to_string_pretty(&Answer { read_now: 0, gone: Vec::new(), ..answer.clone() }).unwrap()
}
