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
    move |source| RecordError::Mcap { path: path.into(), what, source: Box::new(source) }
}
