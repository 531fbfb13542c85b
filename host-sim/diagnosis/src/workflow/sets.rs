//! Flights as the workflow takes them: read, checked and prepared, each with its hash and every error with its file.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use flights::{Flight, FlightError};
use model::{Effect, Model, Vehicle};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use sysid::checks::clocks::Clocks;
use sysid::{Examined, Fault, FitError, PrepareError, Prepared, RefineError};

use crate::WhyError;
use crate::workflow::faults::Faults;
use crate::workflow::observer::{Observer, Progress};

/// A flight, read and prepared.
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
}

/// Flights to fit on.
pub struct TrainingFlights(pub(crate) Vec<LoadedFlight>);

/// Flights to judge by, none of which is fitted on.
pub struct HeldOutFlights(pub(crate) Vec<LoadedFlight>);

/// Flights to fit on and flights to judge by.
pub struct FlightSets {
    /// Flights to fit on.
    pub training: TrainingFlights,
    /// Flights to judge by.
    pub held_out: HeldOutFlights,
    /// What is wrong with them, and with the vehicle file and fits as far as they have come.
    pub faults: Faults,
}

/// Flights that a model is held against.
pub struct FlightsOfOneKind {
    /// The flights.
    pub flights: Vec<LoadedFlight>,
    /// What is wrong with them.
    pub faults: Faults,
}

/// How flights are taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reading {
    /// Report faults that would be refused, and go on.
    pub accept_faults: bool,
}

/// Why the workflow ends without an answer.
#[derive(Debug, thiserror::Error)]
pub enum WorkflowError {
    /// The file.
    #[error(transparent)]
    File(#[from] FlightError),
    /// What is in it.
    #[error("{}: {why}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: PrepareError,
    },
    /// A fault that makes every conclusion wrong.
    #[error("{}: {sentence} (or --accept-faults to go on regardless)", path.display())]
    Faulty {
        /// The file.
        path: PathBuf,
        /// What is wrong, and how to mend it.
        sentence: String,
    },
    /// The same content twice, whatever the names.
    #[error("{}: is the same flight as {}{}; give each flight once", again.display(), first.display(), why_once(*in_both_sets))]
    GivenTwice {
        /// The one.
        first: PathBuf,
        /// The other.
        again: PathBuf,
        /// Whether one is fitted on and the other is to judge by.
        in_both_sets: bool,
    },
    /// The fit.
    #[error("{flights}: {why}")]
    Fit {
        /// The flights it was about.
        flights: String,
        /// Why there is none.
        why: FitError,
    },
    /// An effect that cannot be asked about.
    #[error(transparent)]
    Why(WhyError),
    /// A refinement that ran away.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}

fn why_once(in_both_sets: bool) -> &'static str {
    if in_both_sets { ", and a flight that was fitted on cannot judge the fit" } else { "" }
}

/// Where flights come from.
enum Source<'a> {
    File(&'a Path),
    Memory(&'a Flight),
}

impl LoadedFlight {
    /// Checks and prepares a flight of `vehicle` that is already in memory.
    pub fn from_flight(flight: &Flight, vehicle: &Vehicle) -> Result<Self, WorkflowError> {
        let path = PathBuf::from(&flight.name);
        flight.check_against(vehicle, &path)?;
        Self::examined(flight, vehicle, path, sha256(flight.to_csv().as_bytes()))
    }

    fn from_file(path: &Path, vehicle: &Vehicle) -> Result<Self, WorkflowError> {
        if path.is_dir() {
            return Err(FlightError::Folder { path: path.into() }.into());
        }
        let bytes = std::fs::read(path).map_err(|source| FlightError::Read { path: path.into(), source })?;
        let flight = Flight::parse(&bytes, path)?;
        flight.check_against(vehicle, path)?;
        Self::examined(&flight, vehicle, path.into(), sha256(&bytes))
    }

    fn examined(
        flight: &Flight,
        vehicle: &Vehicle,
        path: PathBuf,
        sha256: String,
    ) -> Result<Self, WorkflowError> {
        match sysid::examine(flight, vehicle) {
            Ok(Examined { prepared, faults, clocks }) => Ok(Self { path, sha256, prepared, faults, clocks }),
            Err(why) => Err(WorkflowError::Unusable { path, why }),
        }
    }
}

impl TrainingFlights {
    /// The flights with their files and faults.
    pub fn loaded(&self) -> &[LoadedFlight] {
        &self.0
    }

    /// The flights as identification takes them.
    pub fn prepared(&self) -> Vec<&Prepared> {
        prepared(&self.0)
    }
}

impl HeldOutFlights {
    /// The flights with their files and faults.
    pub fn loaded(&self) -> &[LoadedFlight] {
        &self.0
    }

    /// The flights as identification takes them.
    pub fn prepared(&self) -> Vec<&Prepared> {
        prepared(&self.0)
    }
}

impl FlightSets {
    /// Reads the files of both sets; none may be in both or twice in one.
    pub fn read(
        train: &[PathBuf],
        validate: &[PathBuf],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let all: Vec<Source<'_>> = train.iter().chain(validate).map(|path| Source::File(path)).collect();
        Self::load(&all, train.len(), vehicle, reading, observer)
    }

    /// Takes flights that are already in memory.
    pub fn from_flights(
        train: &[Flight],
        validate: &[Flight],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let all: Vec<Source<'_>> = train.iter().chain(validate).map(Source::Memory).collect();
        Self::load(&all, train.len(), vehicle, reading, observer)
    }

    fn load(
        sources: &[Source<'_>],
        training: usize,
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let mut train = load_all(sources, vehicle, observer)?;
        if let Some((first, again)) = repeated(&train) {
            let in_both_sets = first < training && again >= training;
            return Err(given_twice(&train, first, again, in_both_sets));
        }
        let validate = train.split_off(training);
        let mut faults = Faults::default();
        faults.add_of_flights(train.iter().chain(&validate), vehicle, reading)?;
        faults.add_of_sets(&train, &validate, reading)?;
        Ok(Self { training: TrainingFlights(train), held_out: HeldOutFlights(validate), faults })
    }

    /// All flights, those to fit on first.
    pub fn all(&self) -> impl Iterator<Item = &LoadedFlight> {
        self.training.0.iter().chain(&self.held_out.0)
    }

    /// The training flights as identification takes them.
    pub fn train(&self) -> Vec<&Prepared> {
        self.training.prepared()
    }

    /// The held-out flights as identification takes them.
    pub fn validate(&self) -> Vec<&Prepared> {
        self.held_out.prepared()
    }

    /// Leaves out the samples at which a formula of `effects` or of the model's own has no finite value.
    pub(crate) fn leave_out_undefined(
        &mut self,
        model: &Model,
        effects: &[Effect],
        observer: &dyn Observer,
    ) -> Result<(), WorkflowError> {
        leave_out_undefined(&mut self.training.0, model, effects, observer)?;
        leave_out_undefined(&mut self.held_out.0, model, effects, observer)
    }

    /// An error of a fit with the flights it was about.
    pub(crate) fn blame(&self, why: FitError) -> WorkflowError {
        WorkflowError::Fit { flights: names(&self.training.0), why }
    }
}

impl FlightsOfOneKind {
    /// Reads files; none may be given twice.
    pub fn read(
        paths: &[PathBuf],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let sources: Vec<Source<'_>> = paths.iter().map(|path| Source::File(path)).collect();
        Self::load(&sources, vehicle, reading, observer)
    }

    /// Takes flights that are already in memory.
    pub fn from_flights(
        flights: &[Flight],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let sources: Vec<Source<'_>> = flights.iter().map(Source::Memory).collect();
        Self::load(&sources, vehicle, reading, observer)
    }

    fn load(
        sources: &[Source<'_>],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let flights = load_all(sources, vehicle, observer)?;
        if let Some((first, again)) = repeated(&flights) {
            return Err(given_twice(&flights, first, again, false));
        }
        let mut faults = Faults::default();
        faults.add_of_flights(&flights, vehicle, reading)?;
        Ok(Self { flights, faults })
    }

    /// The flights as identification takes them.
    pub fn prepared(&self) -> Vec<&Prepared> {
        prepared(&self.flights)
    }

    pub(crate) fn leave_out_undefined(
        &mut self,
        model: &Model,
        effects: &[Effect],
        observer: &dyn Observer,
    ) -> Result<(), WorkflowError> {
        leave_out_undefined(&mut self.flights, model, effects, observer)
    }
}

/// "A.csv, B.csv", with the folders the user gave.
pub fn names(flights: &[LoadedFlight]) -> String {
    flights.iter().map(|f| f.path.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// SHA-256, hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn prepared(flights: &[LoadedFlight]) -> Vec<&Prepared> {
    flights.iter().map(|flight| &flight.prepared).collect()
}

/// The first pair of flights with the same content.
fn repeated(flights: &[LoadedFlight]) -> Option<(usize, usize)> {
    (1..flights.len()).find_map(|again| {
        let first = (0..again).find(|&first| flights[first].sha256 == flights[again].sha256)?;
        Some((first, again))
    })
}

fn given_twice(flights: &[LoadedFlight], first: usize, again: usize, in_both_sets: bool) -> WorkflowError {
    let path = |index: usize| flights[index].path.clone();
    WorkflowError::GivenTwice { first: path(first), again: path(again), in_both_sets }
}

/// Loads flights side by side; of several errors, that of the first flight is reported, whichever came first in time.
fn load_all(
    sources: &[Source<'_>],
    vehicle: &Vehicle,
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
                Source::File(path) => LoadedFlight::from_file(path, vehicle),
                Source::Memory(flight) => LoadedFlight::from_flight(flight, vehicle),
            };
            tell(done.fetch_add(1, Ordering::Relaxed) + 1);
            loaded
        })
        .collect();
    all.into_iter().collect()
}

fn leave_out_undefined(
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
