//! The flights of the demonstration: a simulated craft with one hidden effect, as files.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use diagnosis::workflow::{Observer, Progress};
use model::{Effect, Model};
use rayon::prelude::*;

use super::demo_effect;
use super::model_files::VEHICLE;

/// Names of flights for the fit and for validation.
pub(crate) const TRAIN: [&str; 3] = ["A", "B", "C"];
pub(crate) const VALIDATE: [&str; 2] = ["D", "E"];
/// Length of a simulated flight, s.
const FLIGHT_S: f64 = 40.0;

/// Why there are no flights.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DemoError {
    #[error("{}: cannot create the folder: {source}; give another with --out", folder.display())]
    Create { folder: PathBuf, source: std::io::Error },
    #[error("--seed {seed}: the simulated craft was lost in flight {name}; use another seed")]
    Lost { seed: u64, name: &'static str },
}

/// What was flown.
pub(crate) struct Flown {
    pub(crate) craft: Model,
    pub(crate) hidden: Effect,
    pub(crate) vehicle_path: PathBuf,
    /// In the order of [`TRAIN`] and [`VALIDATE`].
    pub(crate) files: Vec<PathBuf>,
}

/// A seed of today's, six digits: they are quickly typed again.
pub(crate) fn seed_from_clock() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |since| since.as_micros() as u64 % 1_000_000)
}

/// Creates a folder with all that are above it.
pub(crate) fn create(folder: &Path) -> Result<(), DemoError> {
    std::fs::create_dir_all(folder).map_err(|source| DemoError::Create { folder: folder.into(), source })
}

/// Draws what is hidden, flies the five flights side by side, and writes their files and that of the
/// vehicle; none where the craft is lost in one of them.
pub(crate) fn fly(seed: u64, folder: &Path, observer: &dyn Observer) -> anyhow::Result<Flown> {
    let (craft, hidden) = demo_effect::draw(seed);
    create(folder)?;
    let names = [&TRAIN[..], &VALIDATE[..]].concat();
    let flown = AtomicUsize::new(0);
    let told = |flown| observer.progress(Progress { activity: "flying", steps: Some((flown, names.len())) });
    told(0);
    let texts: Vec<String> = names
        .par_iter()
        .enumerate()
        .map(|(index, &name)| {
            // Neighbouring seeds of the demonstration share no flight.
            let flight_seed = seed.wrapping_mul(names.len() as u64).wrapping_add(index as u64);
            let recording = sil::fly(&demo_effect::flight_plan(&craft, flight_seed, FLIGHT_S))?;
            if !recording.complete || recording.cage_margin_m() < 0.0 {
                return Err(DemoError::Lost { seed, name }.into());
            }
            told(flown.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(recording.to_flight(name, false).to_csv())
        })
        .collect::<anyhow::Result<_>>()?;
    let files: Vec<PathBuf> = names.iter().map(|name| folder.join(format!("{name}.csv"))).collect();
    for (path, text) in files.iter().zip(texts) {
        report::write_atomic(path, text)?;
    }
    let vehicle_path = folder.join(VEHICLE);
    report::write_atomic(&vehicle_path, toml::to_string(&craft.vehicle)?)?;
    Ok(Flown { craft, hidden, vehicle_path, files })
}
