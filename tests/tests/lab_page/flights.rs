//! Folders with flights to serve.

use std::fs;
use std::path::Path;

use stories::shared;
use stories::world::{Pattern, Sensors, Size, World};
use tempfile::TempDir;

/// A craft whose rotors flap.
pub(crate) fn small_world() -> World {
    let seed = 11;
    println!("flights of seed {seed}");
    World::new(Size::F330, seed).with("flapping-moment", 1.0).unwrap()
}

/// Five flights of 24 s of it: its effect is what a diagnosis should find.
pub(crate) fn small() -> TempDir {
    let world = small_world();
    let folder = tempfile::tempdir().unwrap();
    let fly = |pattern: &Pattern| world.fly(*pattern, 24.0, &Sensors::default(), 0).expect("the pilot copes");
    let flights: Vec<_> = Pattern::TRAIN.iter().chain(&Pattern::VALIDATE).map(fly).collect();
    world.write(folder.path(), &flights.iter().collect::<Vec<_>>()).unwrap();
    folder
}

/// A copy of flights of the shared data, where they are.
pub(crate) fn hidden(case: &str) -> Option<TempDir> {
    let from = shared(&format!("data/hidden/{case}"))?;
    let folder = tempfile::tempdir().unwrap();
    copy(&from, folder.path());
    Some(folder)
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}
