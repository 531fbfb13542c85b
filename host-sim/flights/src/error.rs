//! Why a flight file was refused: each with file, row or column, and how to mend it.

use std::path::PathBuf;

/// Why a flight file was refused.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// The file cannot be read.
    #[error("{}: cannot read the flight file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The path is a folder.
    #[error("{}: is a folder, not a flight file; name the *.csv files in it", path.display())]
    Folder {
        /// The path.
        path: PathBuf,
    },
    /// Nothing in it.
    #[error("{}: is empty; a flight file starts with a header row such as t,x,y,z,phi,theta,psi,p,q,r,cmd1,...", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Another kind of file.
    #[error("{}: row 1: is {what}, not a flight file (CSV): {mend}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is.
        what: &'static str,
        /// How to make a flight file of it.
        mend: &'static str,
    },
    /// A required column is missing, or one is there twice.
    #[error("{}: row 1: column \"{column}\" {problem}; {found}", path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What is wrong with it.
        problem: &'static str,
        /// The columns that there are, in words.
        found: String,
    },
    /// A field that is not a number.
    #[error("{}: row {row}: column \"{column}\" has \"{text}\", which is not a number; leave the field empty if the value is missing", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// The column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// A row with too few or too many fields.
    #[error("{}: row {row}: has {found} fields, the header has {expected}; mend or delete the row", path.display())]
    FieldCount {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// Fields found.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// Time that does not rise.
    #[error("{}: row {row}: time goes from {before} s to {after} s; times must rise (sort the rows, delete repeated ones)", path.display())]
    Time {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// Time of the row before.
        before: f64,
        /// Time of this row.
        after: f64,
    },
    /// Too few samples for a sampling rate. How long a flight must be depends on that rate: whoever prepares it for a fit says it.
    #[error("{}: has fewer than two samples ({rows}), so no sampling rate; at least about 1 s without gaps or missing values is needed", path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Samples.
        rows: usize,
    },
    /// No voltage for a motor map that depends on it.
    #[error(
        "{}: column \"vbat\" is missing or has no values, and the motor map of \"{vehicle}\" depends on the voltage (motors.voltage); log \
         it, or write map = \"identify\" in the place of the map", path.display()
    )]
    VoltageNeeded {
        /// The file.
        path: PathBuf,
        /// The vehicle's name.
        vehicle: String,
    },
    /// A list of parts to use that says nothing.
    #[error("{}: {what}; write for example use = [[3.2, 41.0], [55.0, 80.5]], in seconds of the column t", path.display())]
    Parts {
        /// The file.
        path: PathBuf,
        /// Which field, and what is wrong with it.
        what: String,
    },
    /// A map of columns that makes no sense.
    #[error("{}: {what}", path.display())]
    Map {
        /// The file.
        path: PathBuf,
        /// Which field, and what is wrong with it.
        what: String,
    },
    /// A column that is not in its unit.
    #[error("{}: column \"{column}\" {observed}: {advice}", path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What was seen.
        observed: String,
        /// What it looks like and what to do.
        advice: &'static str,
    },
}
