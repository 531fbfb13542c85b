//! Why there is no fleet.

use std::path::{Path, PathBuf};

/// Why a fleet cannot be looked at: one sentence, with the file.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A folder or file that cannot be read.
    #[error("{}: cannot be read: {why}", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        why: std::io::Error,
    },
    /// A file that cannot be written.
    #[error("{}: cannot be written: {why}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// A file that says something wrong.
    #[error("{}: {why}", path.display())]
    Content {
        /// Which.
        path: PathBuf,
        /// What is wrong and what to do.
        why: String,
    },
    /// No craft.
    #[error(
        "{}: no craft here: put each craft's flights and logs into a folder of its own, with its vehicle.toml in it{}", folder.display(),
        more(unclaimed)
    )]
    NoCraft {
        /// Where they were looked for.
        folder: PathBuf,
        /// Folders with flights and no vehicle file.
        unclaimed: Vec<String>,
    },
    /// Something that was asked for is not there.
    #[error("{0}")]
    Asked(String),
    /// The user stopped it.
    #[error("stopped; what was read is kept, and the same command goes on from there")]
    Cancelled,
}

/// A sentence about a file without the file's path before it.
pub(crate) fn without_path(path: &Path, sentence: &str) -> String {
    let own = format!("{}: ", path.display());
    sentence.strip_prefix(&own).unwrap_or(sentence).into()
}

/// An error as one line.
pub(crate) fn one_line(why: impl std::fmt::Display) -> String {
    report::error_line(&why.to_string())
}

fn more(unclaimed: &[String]) -> String {
    match unclaimed.first() {
        Some(first) => {
            format!(" ({first} has flights and no vehicle.toml; quadlab init makes one from logs)")
        }
        None => String::new(),
    }
}

impl FleetError {
    pub(crate) fn content(path: &Path, why: impl ToString) -> Self {
        Self::Content { path: path.into(), why: why.to_string() }
    }

    /// Of an error that may name the file itself.
    pub(crate) fn of_file(path: &Path, why: &dyn std::error::Error) -> Self {
        Self::content(path, without_path(path, &why.to_string()))
    }

    pub(crate) fn write(path: &Path, why: impl ToString) -> Self {
        Self::Write { path: path.into(), why: why.to_string() }
    }
}
