//! Flights as they are named on the command line: flight files and logs, folders of them, and patterns such as `flights/*.csv`.

use std::path::{Path, PathBuf};

use diagnosis::workflow::{FlightSets, Observer, Reading, WorkflowError};
use model::Vehicle;

use crate::cli::colour;

/// Ending of a flight file.
const ENDING: &str = "csv";

/// Flights to fit on and to judge by, as given on the command line.
#[derive(clap::Args)]
pub(crate) struct SetOptions {
    /// Flights and logs to split into training and held-out sets, instead of --train and --validate: by flight, by airborne
    /// part, or by blocks of time if there is only one
    #[arg(value_name = "FLIGHTS", conflicts_with_all = ["train", "validate"])]
    flights: Vec<PathBuf>,

    /// Training flights: files, folders or patterns such as 'A*.csv', for example: --train A.csv B.csv C.csv
    #[arg(long, value_name = "FLIGHTS", num_args = 1.., requires = "validate")]
    train: Vec<PathBuf>,

    /// Held-out flights, used to test the fit and never for it, for example: --validate D.csv E.csv
    #[arg(long, value_name = "FLIGHTS", num_args = 1.., requires = "train")]
    validate: Vec<PathBuf>,
}

/// Flight files of both kinds.
pub(crate) struct SetFiles {
    pub(crate) train: Vec<PathBuf>,
    /// Empty where the program splits.
    pub(crate) validate: Vec<PathBuf>,
}

/// Why no flight files are named.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NamedFlightsError {
    #[error("no flights are named: name them and they are split, or give --train and --validate")]
    None,
    #[error("{}: no flight file (*.{ENDING}) and no log in this folder", .0.display())]
    EmptyFolder(PathBuf),
    #[error("{}: cannot read the folder: {source}", path.display())]
    Folder { path: PathBuf, source: std::io::Error },
    #[error("{}: matches no file", .0.display())]
    NoMatch(PathBuf),
    #[error("{}: is not a valid pattern: {why}", path.display())]
    Pattern { path: PathBuf, why: &'static str },
}

impl SetOptions {
    /// The files that are meant.
    pub(crate) fn files(&self) -> Result<SetFiles, NamedFlightsError> {
        match &self.flights[..] {
            [] if self.train.is_empty() => Err(NamedFlightsError::None),
            [] => Ok(SetFiles { train: files(&self.train)?, validate: files(&self.validate)? }),
            all => Ok(SetFiles { train: files(all)?, validate: Vec::new() }),
        }
    }

    /// What the user named, as it was written.
    pub(crate) fn named(&self) -> impl Iterator<Item = &PathBuf> {
        self.flights.iter().chain(&self.train).chain(&self.validate)
    }
}

impl SetFiles {
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
        if !self.validate.is_empty() {
            return FlightSets::read(&self.train, &self.validate, vehicle, reading, observer);
        }
        let sets = FlightSets::split(&self.train, vehicle, reading, observer)?;
        colour::note(&sets.split_sentence());
        Ok(sets)
    }
}

/// The flights that are meant: those of a folder and those that match a pattern in the order of their names.
pub(crate) fn files(named: &[PathBuf]) -> Result<Vec<PathBuf>, NamedFlightsError> {
    let all: Result<Vec<Vec<PathBuf>>, _> = named.iter().map(|path| files_of(path)).collect();
    Ok(all?.concat())
}

fn files_of(named: &Path) -> Result<Vec<PathBuf>, NamedFlightsError> {
    if named.is_dir() {
        return flights_in(named);
    }
    // A shell has done this already where there is one that does; a name with such a letter in it is that file.
    match named.to_str().filter(|name| name.contains(['*', '?', '[']) && !named.exists()) {
        Some(pattern) => matching(named, pattern),
        None => Ok(vec![named.to_owned()]),
    }
}

/// The flights of a folder in the order of their names; an error where there are none.
pub(crate) fn flights_in(folder: &Path) -> Result<Vec<PathBuf>, NamedFlightsError> {
    match flight_files(folder) {
        Ok(files) if files.is_empty() => Err(NamedFlightsError::EmptyFolder(folder.into())),
        Ok(files) => Ok(files),
        Err(source) => Err(NamedFlightsError::Folder { path: folder.into(), source }),
    }
}

/// The flight files of a folder, and the logs in it, in the order of their names.
fn flight_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if (has_flight_ending(&path) || logs::format_of(&path).is_some()) && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Whether a file is a flight file by its name.
pub(crate) fn has_flight_ending(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(ENDING))
}

fn matching(named: &Path, pattern: &str) -> Result<Vec<PathBuf>, NamedFlightsError> {
    let found = glob::glob(pattern)
        .map_err(|error| NamedFlightsError::Pattern { path: named.into(), why: error.msg })?;
    // `glob` sorts by name; what cannot be looked into holds no flight that could be read.
    let files: Vec<PathBuf> = found.filter_map(Result::ok).filter(|path| path.is_file()).collect();
    if files.is_empty() { Err(NamedFlightsError::NoMatch(named.into())) } else { Ok(files) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder_with(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        folder
    }

    fn names(found: &[PathBuf]) -> Vec<&str> {
        found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect()
    }

    #[test]
    fn a_folder_stands_for_its_flight_files_by_name() {
        let folder = folder_with(&["b.csv", "a.CSV", "vehicle.toml"]);
        assert_eq!(names(&files(&[folder.path().into()]).unwrap()), ["a.CSV", "b.csv"]);
    }

    #[test]
    fn a_pattern_stands_for_what_matches_it() {
        let folder = folder_with(&["run2.csv", "run1.csv", "other.csv"]);
        assert_eq!(names(&files(&[folder.path().join("run*.csv")]).unwrap()), ["run1.csv", "run2.csv"]);
        let strange = folder_with(&["run[1].csv"]);
        assert_eq!(names(&files(&[strange.path().join("run[1].csv")]).unwrap()), ["run[1].csv"]);
    }

    #[test]
    fn what_stands_for_no_flight_is_refused_by_name() {
        let folder = folder_with(&["vehicle.toml"]);
        let said = |path: PathBuf| files(&[path]).unwrap_err().to_string();
        assert!(said(folder.path().into()).contains("no flight file"));
        assert!(said(folder.path().join("*.csv")).contains("matches no file"));
        assert!(said(folder.path().join("a[.csv")).contains("is not a valid pattern"));
    }
}
