//! Reading flights: files to what identification works on, each with its hash and every error with its file.

use std::path::{Path, PathBuf};

use flights::{Flight, FlightError};
use model::{AxisError, FitRecord, FlightRecord, FlightRole, Model, PerAxis, Vehicle};
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use sysid::checks::clocks::Clocks;
use sysid::{Fault, PrepareError, Prepared};

use crate::cli::faults::{Faults, Reading};
use crate::cli::progress;

/// A flight file, read and prepared.
pub(crate) struct Loaded {
    /// As the user gave it.
    pub(crate) path: PathBuf,
    /// Of the file's bytes, hexadecimal.
    pub(crate) sha256: String,
    /// Ready for regression.
    pub(crate) prepared: Prepared,
    /// What is wrong with it.
    pub(crate) faults: Vec<Fault>,
    /// Its clocks.
    pub(crate) clocks: Clocks,
}

/// Flights to fit on and flights to judge by.
pub(crate) struct Sets {
    pub(crate) train: Vec<Loaded>,
    pub(crate) validate: Vec<Loaded>,
    /// What is wrong with them, and with the vehicle file and fits as far as they have come.
    pub(crate) faults: Faults,
}

/// Why flights cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FlightsError {
    /// The file.
    #[error(transparent)]
    File(#[from] FlightError),
    /// What is in it.
    #[error("{}: {why}", path.display())]
    Unusable { path: PathBuf, why: PrepareError },
    /// A fault that makes every conclusion wrong.
    #[error("{}: {sentence} (or --accept-faults to go on regardless)", path.display())]
    Faulty { path: PathBuf, sentence: String },
    /// The same content twice, whatever the names.
    #[error("{}: is the same flight as {}{}; give each flight once", again.display(), first.display(), why(*in_both_sets))]
    GivenTwice { first: PathBuf, again: PathBuf, in_both_sets: bool },
}

fn why(in_both_sets: bool) -> &'static str {
    if in_both_sets { ", and a flight that was fitted on cannot judge the fit" } else { "" }
}

/// Flights of both kinds as given on the command line.
#[derive(clap::Args)]
pub(crate) struct SetOptions {
    /// Flights to fit on, for example: --train A.csv B.csv C.csv
    #[arg(long, value_name = "CSV", num_args = 1.., required = true)]
    pub(crate) train: Vec<PathBuf>,

    /// Flights to judge by, none of which is fitted on, for example: --validate D.csv E.csv
    #[arg(long, value_name = "CSV", num_args = 1.., required = true)]
    pub(crate) validate: Vec<PathBuf>,
}

impl SetOptions {
    /// All files.
    pub(crate) fn paths(&self) -> Vec<&PathBuf> {
        self.train.iter().chain(&self.validate).collect()
    }
}

impl Sets {
    /// Reads the flights of both sets; none may be in both or twice in one.
    pub(crate) fn read(
        options: &SetOptions,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<Self, FlightsError> {
        let paths: Vec<PathBuf> = options.paths().into_iter().cloned().collect();
        let mut train = read_files(&paths, vehicle, reading)?;
        let count = options.train.len();
        if let Some((first, again)) = repeated(&train) {
            let in_both_sets = first < count && again >= count;
            let path = |index: usize| train[index].path.clone();
            return Err(FlightsError::GivenTwice { first: path(first), again: path(again), in_both_sets });
        }
        let validate = train.split_off(count);
        let sets = Self { train, validate, faults: Faults::default() };
        sets.faults.of_flights(sets.all(), vehicle, reading)?;
        sets.faults.of_sets(&sets, reading)?;
        Ok(sets)
    }

    /// All flights.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Loaded> {
        self.train.iter().chain(&self.validate)
    }

    /// Those to fit on.
    pub(crate) fn train(&self) -> Vec<&Prepared> {
        prepared(&self.train)
    }

    /// Those to judge by.
    pub(crate) fn validate(&self) -> Vec<&Prepared> {
        prepared(&self.validate)
    }

    /// The flights behind a model and its errors on both sets.
    pub(crate) fn record(&self, model: &Model) -> FitRecord {
        let entries = |flights: &[Loaded], role| -> Vec<FlightRecord> {
            let entry = |flight: &Loaded| FlightRecord {
                name: flight.prepared.name.clone(),
                sha256: flight.sha256.clone(),
                role,
                samples: flight.prepared.rows() as u64,
            };
            flights.iter().map(entry).collect()
        };
        let mut flights = entries(&self.train, FlightRole::Train);
        flights.extend(entries(&self.validate, FlightRole::Validate));
        let all: Vec<&Prepared> = self.all().map(|flight| &flight.prepared).collect();
        FitRecord {
            flights,
            train: errors(model, &self.train()),
            held_out: errors(model, &self.validate()),
            scatter: diagnosis::changes::scatter(model, &all),
            rotor_delay_s: sysid::fit::alignment::common_delay_s(model, &self.train()),
            ..FitRecord::default()
        }
    }

    /// An error of a fit with the flights it was about.
    pub(crate) fn blame(&self, refused: sysid::FitError) -> anyhow::Error {
        anyhow::Error::new(refused).context(names(&self.train))
    }
}

fn errors(model: &Model, flights: &[&Prepared]) -> PerAxis<AxisError> {
    let all: Vec<_> = flights.iter().map(|flight| sysid::residuals(flight, model)).collect();
    sysid::errors(&all)
}

/// What the libraries take.
pub(crate) fn prepared(flights: &[Loaded]) -> Vec<&Prepared> {
    flights.iter().map(|flight| &flight.prepared).collect()
}

/// "A.csv, B.csv", with the folders the user gave.
pub(crate) fn names(flights: &[Loaded]) -> String {
    flights.iter().map(|f| f.path.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Reads flights that are all of one kind; none may be given twice.
pub(crate) fn read(
    paths: &[PathBuf],
    vehicle: &Vehicle,
    reading: Reading,
) -> Result<(Vec<Loaded>, Faults), FlightsError> {
    let flights = read_files(paths, vehicle, reading)?;
    match repeated(&flights) {
        Some((first, again)) => {
            let path = |index: usize| flights[index].path.clone();
            Err(FlightsError::GivenTwice { first: path(first), again: path(again), in_both_sets: false })
        }
        None => {
            let faults = Faults::default();
            faults.of_flights(&flights, vehicle, reading)?;
            Ok((flights, faults))
        }
    }
}

/// The first pair of flights with the same content.
fn repeated(flights: &[Loaded]) -> Option<(usize, usize)> {
    (1..flights.len()).find_map(|again| {
        let first = (0..again).find(|&first| flights[first].sha256 == flights[again].sha256)?;
        Some((first, again))
    })
}

/// Reads files side by side; of several errors, that of the first file is reported, whichever came first in time.
fn read_files(paths: &[PathBuf], vehicle: &Vehicle, reading: Reading) -> Result<Vec<Loaded>, FlightsError> {
    let bar = progress::bar(paths.len(), reading.json);
    bar.set_message("reading flights");
    let all: Vec<Result<Loaded, FlightsError>> = paths
        .par_iter()
        .map(|path| {
            let loaded = read_file(path, vehicle);
            bar.inc(1);
            loaded
        })
        .collect();
    bar.finish_and_clear();
    all.into_iter().collect()
}

fn read_file(path: &Path, vehicle: &Vehicle) -> Result<Loaded, FlightsError> {
    if path.is_dir() {
        return Err(FlightError::Folder { path: path.into() }.into());
    }
    let bytes = std::fs::read(path).map_err(|source| FlightError::Read { path: path.into(), source })?;
    let flight = Flight::parse(&bytes, path)?;
    flight.check_against(vehicle, path)?;
    let sysid::Examined { prepared, faults, clocks } =
        sysid::examine(&flight, vehicle).map_err(|why| FlightsError::Unusable { path: path.into(), why })?;
    Ok(Loaded { path: path.into(), sha256: sha256(&bytes), prepared, faults, clocks })
}

/// SHA-256, hexadecimal.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
