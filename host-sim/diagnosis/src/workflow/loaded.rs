//! Single flights as the workflow takes them: read, checked and prepared, each with its hash and every error with its file.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use flights::{ColumnMap, Flight, FlightError, parts_file, parts_to_use};
use model::{Effect, Model, Vehicle};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use sysid::checks::clocks::Clocks;
use sysid::checks::under_sampled::Thinning;
use sysid::{Examined, Fault, Parts, Prepared, Taken};

use crate::observer::{Observer, Progress, Silent};
use crate::workflow::error::WorkflowError;

/// A flight, read and prepared.
#[derive(Clone)]
pub struct LoadedFlight {
    /// The file as the user gave it; the name of a flight that is no file.
    pub path: PathBuf,
    /// SHA-256 of the file's bytes, hexadecimal.
    pub sha256: String,
    /// Ready for regression.
    pub prepared: Prepared,
    /// What is wrong with it.
    pub faults: Vec<Fault>,
    /// Its clocks.
    pub clocks: Clocks,
    /// Which parts of the log were taken.
    pub taken: Taken,
    /// What thinning its commands shows.
    pub(crate) thinning: Option<Thinning>,
}

/// Reads a log and makes flights of it; who watches sees how far it is, in megabytes.
pub fn import_log(
    path: &Path,
    map: &ColumnMap,
    observer: &dyn Observer,
) -> Result<logs::Import, logs::LogError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    logs::import_watched(path, map, &|progress| {
        let unit = if progress.bytes.is_some() { ", MB" } else { "" };
        let activity = format!("{} {name}{unit}", progress.stage);
        let steps = progress.bytes.map(|(done, all)| (done >> 20, all.div_ceil(1 << 20)));
        observer.progress(Progress { activity: &activity, steps });
    })
}

/// How flights are taken.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reading {
    /// Report faults that would be refused, and go on.
    pub accept_faults: bool,
    /// First and last time of the log to use, s, in the place of what is found to fly.
    pub window_s: Option<[f64; 2]>,
    /// Take all that flies, whatever the file beside the flight says.
    pub whole: bool,
}

impl Reading {
    /// The parts of a flight to take: the window, else what the file beside the flight says (where that is asked), else what
    /// flies.
    pub(crate) fn parts(self, flight: Option<&Path>) -> Result<Parts, FlightError> {
        if let Some(window) = self.window_s {
            return Ok(Parts::Given(vec![window]));
        }
        let given = flight.filter(|_| !self.whole).map(parts_to_use).transpose()?.flatten();
        Ok(given.map_or(Parts::Flown, Parts::Given))
    }
}

/// Where flights come from.
pub(crate) enum Source<'a> {
    File(&'a Path),
    Memory(&'a Flight),
    /// A flight cut out of a log, and the log.
    Cut(&'a Path, Box<Flight>),
}

impl<'a> Source<'a> {
    /// The file; the name of a flight that is no file.
    pub(crate) fn path(&self) -> &Path {
        match self {
            Source::File(path) | Source::Cut(path, _) => path,
            Source::Memory(flight) => Path::new(&flight.name),
        }
    }

    /// Whether a file beside the flight says which parts of it to use.
    pub(crate) fn has_chosen_parts(&self) -> bool {
        match self {
            Source::File(path) => parts_file(path).exists(),
            Source::Cut(log, flight) => parts_file(&log.with_file_name(&flight.name)).exists(),
            Source::Memory(_) => false,
        }
    }

    /// Where the flights of files are from: a flight file is one, a log of another program as many as were flown in it; `-` is
    /// standard input.
    pub(crate) fn of_files(
        paths: &'a [PathBuf],
        vehicle: &Vehicle,
        observer: &dyn Observer,
    ) -> Result<Vec<Self>, WorkflowError> {
        if let [path] = paths {
            return Self::of_file(path, vehicle, observer);
        }
        // Several are read side by side: how far each of them is would be too much to show.
        let done = AtomicUsize::new(0);
        let all: Result<Vec<Vec<Self>>, WorkflowError> = paths
            .par_iter()
            .map(|path| {
                let read = Self::of_file(path, vehicle, &Silent);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                observer.progress(Progress { activity: "reading files", steps: Some((done, paths.len())) });
                read
            })
            .collect();
        Ok(all?.into_iter().flatten().collect())
    }

    pub(crate) fn of_file(
        path: &'a Path,
        vehicle: &Vehicle,
        observer: &dyn Observer,
    ) -> Result<Vec<Self>, WorkflowError> {
        if path == Path::new(logs::STANDARD_INPUT) {
            return Self::of_standard_input(path, vehicle);
        }
        match logs::format_of(path) {
            Some(_) => {
                let map = ColumnMap::of_flight(path, vehicle)?;
                Self::cut(path, import_log(path, &map, observer)?.flights)
            }
            None => Ok(vec![Source::File(path)]),
        }
    }

    fn of_standard_input(path: &'a Path, vehicle: &Vehicle) -> Result<Vec<Self>, WorkflowError> {
        let bytes = logs::read_standard_input()?;
        let map = ColumnMap::of_flight(path, vehicle)?;
        match logs::Format::of(&bytes) {
            Some(_) => Self::cut(path, logs::import_bytes(bytes, path, &map)?.flights),
            None => Ok(vec![Source::Cut(path, Box::new(Flight::parse_with(&bytes, path, &map)?))]),
        }
    }

    fn cut(path: &'a Path, flights: Vec<logs::Part>) -> Result<Vec<Self>, WorkflowError> {
        if flights.is_empty() {
            return Err(logs::LogError::nothing_flown(path).into());
        }
        Ok(flights.into_iter().map(|part| Source::Cut(path, Box::new(part.flight))).collect())
    }
}

impl LoadedFlight {
    /// Checks and prepares a flight of `vehicle` that is already in memory.
    pub fn from_flight(flight: &Flight, vehicle: &Vehicle) -> Result<Self, WorkflowError> {
        Self::from_memory(flight, vehicle, Reading::default())
    }

    fn from_memory(flight: &Flight, vehicle: &Vehicle, reading: Reading) -> Result<Self, WorkflowError> {
        let path = PathBuf::from(&flight.name);
        let sha256 = sha256(flight.to_csv().as_bytes());
        let flight = &*flight.completed(&path)?;
        flight.check_against(vehicle, &path)?;
        let parts = reading.parts(None)?;
        Self::examined(flight, vehicle, &parts, path, sha256)
    }

    fn from_log(
        log: &Path,
        cut: &Flight,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<Self, WorkflowError> {
        let path = log.with_file_name(&cut.name);
        let sha256 = sha256(cut.to_csv().as_bytes());
        let flight = &*cut.completed(log)?;
        flight.check_against(vehicle, log)?;
        Self::examined(flight, vehicle, &reading.parts(Some(&path))?, path, sha256)
    }

    /// The flights of a file whose bytes were read, checked and prepared, each with what stands in the way of it; and what the log says of
    /// itself, of a log of another program. Their hashes are the file's.
    #[allow(clippy::type_complexity, reason = "a pair with two kinds of results")]
    pub fn all_of_bytes(
        bytes: Vec<u8>,
        path: &Path,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<(Vec<Result<Self, WorkflowError>>, Option<logs::Import>), WorkflowError> {
        let map = ColumnMap::of_flight(path, vehicle)?;
        let sha256 = sha256(&bytes);
        let examine = |flight: &Flight, beside: PathBuf, sha256: String| {
            flight.check_against(vehicle, path)?;
            Self::examined(flight, vehicle, &reading.parts(Some(&beside))?, beside, sha256)
        };
        if logs::Format::of(&bytes).is_none() {
            let flight = Flight::parse_with(&bytes, path, &map)?;
            return Ok((vec![examine(&flight, path.into(), sha256)], None));
        }
        let mut import = logs::import_bytes(bytes, path, &map)?;
        if import.flights.is_empty() {
            return Err(logs::LogError::nothing_flown(path).into());
        }
        let of_cut = |part: &mut logs::Part| {
            let beside = path.with_file_name(&part.flight.name);
            part.flight.complete(path)?;
            examine(&part.flight, beside, sha256.clone())
        };
        let flights = import.flights.iter_mut().map(of_cut).collect();
        Ok((flights, Some(import)))
    }

    /// Whether its rotor clock wanders.
    pub(crate) fn wanders(&self) -> bool {
        self.prepared.alignment.as_ref().is_some_and(|alignment| !alignment.wandering.is_empty())
    }

    fn from_file(path: &Path, vehicle: &Vehicle, reading: Reading) -> Result<Self, WorkflowError> {
        if path.is_dir() {
            return Err(FlightError::Folder { path: path.into() }.into());
        }
        let bytes = bytes_of(path)?;
        let flight = Flight::parse_with(&bytes, path, &ColumnMap::of_flight(path, vehicle)?)?;
        flight.check_against(vehicle, path)?;
        Self::examined(&flight, vehicle, &reading.parts(Some(path))?, path.into(), sha256(&bytes))
    }

    fn examined(
        flight: &Flight,
        vehicle: &Vehicle,
        parts: &Parts,
        path: PathBuf,
        sha256: String,
    ) -> Result<Self, WorkflowError> {
        match sysid::examine_parts(flight, vehicle, parts) {
            Ok(Examined { prepared, faults, clocks, taken, thinning }) => {
                Ok(Self { path, sha256, prepared, faults, clocks, taken, thinning })
            }
            Err(why) => Err(WorkflowError::Unusable { path, why }),
        }
    }
}

/// The bytes of a flight file.
pub(crate) fn bytes_of(path: &Path) -> Result<Vec<u8>, FlightError> {
    std::fs::read(path).map_err(|source| FlightError::Read { path: path.into(), source })
}

/// "A.csv, B.csv", with the folders the user gave.
pub fn names(flights: &[LoadedFlight]) -> String {
    flights.iter().map(|f| f.path.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// SHA-256, hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn prepared(flights: &[LoadedFlight]) -> Vec<&Prepared> {
    flights.iter().map(|flight| &flight.prepared).collect()
}

/// Loads flights side by side; of several errors, that of the first flight is reported, whichever came first in time.
pub(crate) fn load_all(
    sources: &[Source<'_>],
    vehicle: &Vehicle,
    reading: Reading,
    observer: &dyn Observer,
) -> Result<Vec<LoadedFlight>, WorkflowError> {
    let done = AtomicUsize::new(0);
    let tell = |done| {
        observer.progress(Progress { activity: "reading flights", steps: Some((done, sources.len())) });
    };
    tell(0);
    let all: Vec<Result<LoadedFlight, WorkflowError>> = sources
        .par_iter()
        .map(|source| {
            if observer.is_cancelled() {
                return Err(WorkflowError::Cancelled);
            }
            let loaded = match source {
                Source::File(path) => LoadedFlight::from_file(path, vehicle, reading),
                Source::Memory(flight) => LoadedFlight::from_memory(flight, vehicle, reading),
                Source::Cut(log, flight) => LoadedFlight::from_log(log, flight, vehicle, reading),
            };
            tell(done.fetch_add(1, Ordering::Relaxed) + 1);
            loaded
        })
        .collect();
    all.into_iter().collect()
}

pub(crate) fn leave_out_undefined(
    flights: &mut [LoadedFlight],
    model: &Model,
    effects: &[Effect],
    observer: &dyn Observer,
) -> Result<(), WorkflowError> {
    let mut all = effects.to_vec();
    all.extend(model.effects().into_iter().filter(|own| !effects.contains(own)));
    for flight in flights {
        let before = flight.prepared.notes.len();
        flight
            .prepared
            .leave_out_undefined(model, &all)
            .map_err(|why| WorkflowError::Unusable { path: flight.path.clone(), why })?;
        for note in &flight.prepared.notes[before..] {
            observer.warning(&format!("{}: {note}", flight.path.display()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::Silent;

    #[derive(Default)]
    struct Listening {
        cancel: bool,
        steps: Mutex<Vec<(usize, usize)>>,
    }

    impl Observer for Listening {
        fn progress(&self, progress: Progress<'_>) {
            self.steps.lock().unwrap().push(progress.steps.unwrap());
        }

        fn is_cancelled(&self) -> bool {
            self.cancel
        }
    }

    /// Of FIPS 180-2, appendix B.1.
    #[test]
    fn the_hash_is_the_standards() {
        assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn a_flight_in_memory_is_the_file_that_it_would_be() {
        let vehicle = truth().vehicle;
        let flight = fly(&truth(), 1, 4.0, &ORDINARY);
        let in_memory = LoadedFlight::from_flight(&flight, &vehicle).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("A.csv");
        std::fs::write(&path, flight.to_csv()).unwrap();
        let from_file = LoadedFlight::from_file(&path, &vehicle, Reading::default()).unwrap();
        assert_eq!(in_memory.path, PathBuf::from("flight-1.csv"));
        assert_eq!(in_memory.sha256, from_file.sha256);
        assert_eq!(in_memory.prepared.rows(), from_file.prepared.rows());
    }

    /// The window goes before the file beside the flight, and that before what is found to fly.
    #[test]
    fn of_a_flight_the_parts_are_taken_that_are_asked_for() {
        let vehicle = truth().vehicle;
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let path = folder.join("A.csv");
        std::fs::write(&path, fly(&truth(), 1, 8.0, &ORDINARY).to_csv()).unwrap();
        let load = |window_s| {
            let reading = Reading { window_s, ..Reading::default() };
            LoadedFlight::from_file(&path, &vehicle, reading).map(|flight| flight.taken.parts)
        };
        assert_eq!(load(None).unwrap(), [[0.0, 7.99]]);
        std::fs::write(folder.join("A.use.toml"), "use = [[0.5, 2.5], [4.0, 6.0]]").unwrap();
        assert_eq!(load(None).unwrap(), [[0.5, 2.5], [4.0, 6.0]]);
        assert_eq!(load(Some([1.0, 7.0])).unwrap(), [[1.0, 7.0]]);
        let whole = Reading { whole: true, ..Reading::default() };
        let whole = LoadedFlight::from_file(&path, &vehicle, whole).unwrap().taken;
        assert_eq!((whole.parts, whole.span_s), (vec![[0.0, 7.99]], [0.0, 7.99]));
        let outside = load(Some([9.0, 12.0])).unwrap_err().to_string();
        std::fs::write(folder.join("A.use.toml"), "use = [[3.0, 2.0]]").unwrap();
        let senseless = load(None).unwrap_err().to_string();
        assert!(outside.ends_with("the log goes from 0.00 to 7.99 s"), "{outside}");
        assert!(senseless.contains("A.use.toml: use: part 1 is [3.0, 2.0]"), "{senseless}");
    }

    #[test]
    fn of_several_unusable_flights_the_first_is_reported() {
        let vehicle = truth().vehicle;
        let flights =
            [4.0, 0.3, 0.2].map(|seconds| fly(&truth(), (10.0 * seconds) as u64, seconds, &ORDINARY));
        let sources: Vec<Source<'_>> = flights.iter().map(Source::Memory).collect();
        let Err(WorkflowError::Unusable { path, .. }) =
            load_all(&sources, &vehicle, Reading::default(), &Silent)
        else {
            panic!("a flight of 0.3 s was used")
        };
        assert_eq!(path, PathBuf::from("flight-3.csv"));
    }

    #[test]
    fn every_flight_is_counted_once_and_none_is_read_after_a_cancel() {
        let vehicle = truth().vehicle;
        let flights = [1, 2, 3].map(|seed| fly(&truth(), seed, 2.0, &ORDINARY));
        let sources: Vec<Source<'_>> = flights.iter().map(Source::Memory).collect();
        let listening = Listening::default();
        let loaded = load_all(&sources, &vehicle, Reading::default(), &listening).unwrap();
        assert_eq!(names(&loaded), "flight-1.csv, flight-2.csv, flight-3.csv");
        let mut steps = listening.steps.into_inner().unwrap();
        steps.sort_unstable();
        assert_eq!(steps, [(0, 3), (1, 3), (2, 3), (3, 3)]);
        let cancelling = Listening { cancel: true, ..Listening::default() };
        let cancelled = load_all(&sources, &vehicle, Reading::default(), &cancelling).map(|_| ());
        assert!(matches!(cancelled, Err(WorkflowError::Cancelled)));
    }

    #[test]
    fn a_folder_and_a_file_that_is_not_there_are_named() {
        let vehicle = truth().vehicle;
        let folder = std::env::temp_dir();
        let missing = folder.join("diagnosis-no-such-flight.csv");
        for path in [folder, missing] {
            let Err(refused) = LoadedFlight::from_file(&path, &vehicle, Reading::default()) else {
                panic!("loaded")
            };
            assert!(refused.to_string().starts_with(&path.display().to_string()), "{refused}");
        }
    }
}
