//! Flights as they are named on the command line.

use std::path::PathBuf;

use diagnosis::workflow::{FlightSets, FlightsOfOneKind, Observer, Reading, WorkflowError};
use model::Vehicle;

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

    /// Reads and checks the flights.
    pub(crate) fn read(
        &self,
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<FlightSets, WorkflowError> {
        FlightSets::read(&self.train, &self.validate, vehicle, reading, observer)
    }
}

/// Reads and checks flights that a model is held against.
pub(crate) fn read(
    paths: &[PathBuf],
    vehicle: &Vehicle,
    reading: Reading,
    observer: &dyn Observer,
) -> Result<FlightsOfOneKind, WorkflowError> {
    FlightsOfOneKind::read(paths, vehicle, reading, observer)
}
