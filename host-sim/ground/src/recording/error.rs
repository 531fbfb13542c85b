//! Why something cannot be recorded.

use std::path::{Path, PathBuf};

/// Why something cannot be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file system.
    #[error("{}: cannot {what}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The log.
    #[error("{}: cannot {what}: {source}", path.display())]
    Mcap {
        /// Which file.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What was wrong.
        source: Box<mcap::McapError>,
    },
    /// A recording of that name exists.
    #[error("{}: exists already; give another name, or move it away", .0.display())]
    Exists(PathBuf),
    /// A disk that was full or too slow for too long.
    #[error("{}: messages that the disk did not take, and are missing: {messages}", path.display())]
    LeftOut {
        /// Which file.
        path: PathBuf,
        /// How many.
        messages: u64,
    },
    /// A file with nothing of a recording in it.
    #[error("{}: is no recording of quadlab: neither its head nor any of its messages is there", .0.display())]
    NoRecording(PathBuf),
    /// An output file.
    #[error(transparent)]
    Output(#[from] report::Error),
}

pub(super) fn mcap_error<'a>(
    path: &'a Path,
    what: &'static str,
) -> impl FnOnce(mcap::McapError) -> RecordError + 'a {
    move |source| match source {
        // The library's own words for it leave out what the system said.
        mcap::McapError::Io(source) => RecordError::File { path: path.into(), what, source },
        source => RecordError::Mcap { path: path.into(), what, source: Box::new(source) },
    }
}
