//! Single flights as the workflow takes them: read, checked and prepared, each with its hash and every error with its file.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use flights::{Flight, FlightError};
use model::{Effect, Model, Vehicle};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use sysid::checks::clocks::Clocks;
use sysid::{Examined, Fault, Prepared};

use crate::observer::{Observer, Progress};
use crate::workflow::error::WorkflowError;

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

/// How flights are taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reading {
    /// Report faults that would be refused, and go on.
    pub accept_faults: bool,
}

/// Where flights come from.
pub(crate) enum Source<'a> {
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

    /// Whether its rotor clock wanders.
    pub(crate) fn wanders(&self) -> bool {
        self.prepared.alignment.as_ref().is_some_and(|alignment| !alignment.wandering.is_empty())
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
