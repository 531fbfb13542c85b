//! What can go wrong: one line each, with what to do about it.

use std::io;
use std::path::{Path, PathBuf};

/// An error of the program.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or device that cannot be opened, read or written.
    #[error("{}: cannot {what}: {source}", path.display())]
    Access {
        /// Its path.
        path: PathBuf,
        /// What was tried, and what to check.
        what: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// A file with wrong content.
    #[error("{}: {message}", path.display())]
    Content {
        /// Its path.
        path: PathBuf,
        /// The field, what is wrong, how to correct it.
        message: String,
    },
    /// The system refused something without a file.
    #[error("cannot {what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What it said.
        source: io::Error,
    },
    /// A peer that is not admitted.
    #[error(transparent)]
    NotAdmitted(#[from] proto::NotAdmitted),
    /// A key file, or a system without random bytes.
    #[error(transparent)]
    LinkFile(#[from] proto_files::FileError),
    /// Gains that cannot be flown here.
    #[error(transparent)]
    Gains(#[from] gains_file::GainsError),
    /// The guardian's process is gone.
    #[error("the guardian was killed; the loop idled the outputs and ended")]
    Orphaned,
    /// Something else, in words.
    #[error("{0}")]
    Other(String),
}

/// A result with an [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// For `map_err`: the system's error about a file.
pub(crate) fn access<'a, E: Into<io::Error>>(
    path: &'a Path,
    what: &'static str,
) -> impl FnOnce(E) -> Error + 'a {
    move |source| Error::Access { path: path.to_owned(), what, source: source.into() }
}

/// For `map_err`: the system's error about anything else.
pub(crate) fn system<E: Into<io::Error>>(what: &'static str) -> impl FnOnce(E) -> Error {
    move |source| Error::System { what, source: source.into() }
}

/// Writes one line to standard error, whatever the names and contents of files that it quotes hold. A log that cannot be written any
/// more is no reason to crash.
pub fn log(line: &str) {
    use io::Write;
    let line = plain_line::error_line(line);
    // In one write: the guardian and the loop share the stream, and their lines must not run into
    // each other.
    let _ = io::stderr().write_all(format!("com: {line}\n").as_bytes());
}
