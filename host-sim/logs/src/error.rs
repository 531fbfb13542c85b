//! Why a log was refused: the file, what is wrong, how to mend it.

use std::path::{Path, PathBuf};

/// Longest reason: names in a file can be as long as the file.
const LONGEST: usize = 350;

/// Why a log was refused.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("{}: cannot read the log: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is of no format that is read.
    #[error("{}: {}: {mend}", path.display(), plain(what, LONGEST))]
    Format {
        /// The file.
        path: PathBuf,
        /// What it is, or what is wrong with it.
        what: String,
        /// What to do.
        mend: String,
    },
    /// A table of another program, or its map of columns.
    #[error(transparent)]
    Flight(#[from] flights::FlightError),
    /// The log is whole, but no flight of a quadcopter can be made of it.
    #[error("{}: {}", path.display(), plain(reason, LONGEST))]
    Refused {
        /// The file.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
}

/// Text out of a log as part of a line: no control characters, and not longer than so many.
pub(crate) fn plain(text: &str, longest: usize) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).take(longest).collect()
}

/// Names out of a log as part of a sentence, without control characters and not too long.
pub(crate) fn plain_list(names: &[&str]) -> String {
    let text = names.iter().map(|name| plain(name, 40)).collect::<Vec<_>>().join(", ");
    if text.chars().count() > 250 { text.chars().take(250).chain("...".chars()).collect() } else { text }
}

impl LogError {
    /// A log in which no part is long enough in the air.
    pub fn nothing_flown(path: &Path) -> Self {
        Self::Refused {
            path: path.into(),
            reason: "nothing in this log is long enough in the air to be a flight".into(),
        }
    }
}
