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
    flown(24.0)
}

/// The same of two minutes each: to explain them takes long enough to be seen and cancelled.
pub(crate) fn long() -> TempDir {
    flown(120.0)
}

/// Five flights of a duration of it.
pub(crate) fn flown(duration_s: f64) -> TempDir {
    flown_by(&small_world(), duration_s)
}

fn flown_by(world: &World, duration_s: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let fly =
        |pattern: &Pattern| world.fly(*pattern, duration_s, &Sensors::default(), 0).expect("the pilot copes");
    let flights: Vec<_> = Pattern::TRAIN.iter().chain(&Pattern::VALIDATE).map(fly).collect();
    world.write(folder.path(), &flights.iter().collect::<Vec<_>>()).unwrap();
    folder
}

/// Five flights of a craft without an effect, and two of the same craft with a weight on it.
pub(crate) fn before_and_after() -> TempDir {
    let seed = 12;
    println!("flights of seed {seed}");
    let (before, folder) = (World::new(Size::F330, seed), tempfile::tempdir().unwrap());
    let after = World::new(Size::F330, seed).with("mass-change", 1.0).unwrap();
    let fly = |world: &World, pattern: &Pattern, round| {
        world.fly(*pattern, 24.0, &Sensors::default(), round).expect("the pilot copes")
    };
    let flights: Vec<_> =
        Pattern::TRAIN.iter().chain(&Pattern::VALIDATE).map(|pattern| fly(&before, pattern, 0)).collect();
    before.write(folder.path(), &flights.iter().collect::<Vec<_>>()).unwrap();
    for pattern in &Pattern::TRAIN[..2] {
        let flight = fly(&after, pattern, 1);
        fs::write(folder.path().join(format!("later-{}.csv", flight.name)), flight.to_csv()).unwrap();
    }
    folder
}

/// A hundred short flights.
pub(crate) fn hundred() -> TempDir {
    let (world, folder) = (small_world(), tempfile::tempdir().unwrap());
    world.write(folder.path(), &[]).unwrap();
    for n in 0..100 {
        let pattern = Pattern::TRAIN[n % Pattern::TRAIN.len()];
        let flight = world.fly(pattern, 6.0, &Sensors::default(), n as u64).expect("the pilot copes");
        fs::write(folder.path().join(format!("flight-{n:03}.csv")), flight.to_csv()).unwrap();
    }
    folder
}

/// Real flights of the shared data whose names hold one of `names`, with their vehicle file, where they are.
pub(crate) fn real(of: &str, names: &[&str]) -> Option<TempDir> {
    let from = shared(&format!("data/{of}"))?;
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == "vehicle.toml" || names.iter().any(|part| name.contains(part)) {
            fs::copy(entry.path(), folder.path().join(name)).unwrap();
        }
    }
    Some(folder)
}

/// A copy of flights of the shared data, where they are.
pub(crate) fn hidden(case: &str) -> Option<TempDir> {
    let from = shared(&format!("data/hidden/{case}"))?;
    let folder = tempfile::tempdir().unwrap();
    copy(&from, folder.path());
    Some(folder)
}

/// Copies the files of a folder.
pub(crate) fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// Five flights of a craft that turns into the wind: no catalogue has the effect.
pub(crate) fn weathercock() -> TempDir {
    let seed = 13;
    println!("flights of seed {seed}");
    let world = World::new(Size::F330, seed).with("weathercock", 1.0).unwrap();
    flown_by(&world, 24.0)
}
