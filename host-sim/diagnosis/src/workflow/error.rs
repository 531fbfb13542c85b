//! Why the workflow ends without an answer.

use std::path::PathBuf;

use flights::FlightError;
use sysid::{FitError, PrepareError, RefineError};

use crate::WhyError;

/// Why the workflow ends without an answer.
#[derive(Debug, thiserror::Error)]
pub enum WorkflowError {
    /// The file.
    #[error(transparent)]
    File(#[from] FlightError),
    /// What is in it.
    #[error("{}: {why}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: PrepareError,
    },
    /// A fault that makes every conclusion wrong.
    #[error("{}: {sentence} (or --accept-faults to go on regardless)", path.display())]
    Faulty {
        /// The file.
        path: PathBuf,
        /// What is wrong, and how to mend it.
        sentence: String,
    },
    /// The same content twice, whatever the names.
    #[error("{}: is the same flight as {}{}; give each flight once", again.display(), first.display(), why_once(*in_both_sets))]
    GivenTwice {
        /// The one.
        first: PathBuf,
        /// The other.
        again: PathBuf,
        /// Whether one is fitted on and the other is to judge by.
        in_both_sets: bool,
    },
    /// The fit.
    #[error("{flights}: {why}")]
    Fit {
        /// The flights it was about.
        flights: String,
        /// Why there is none.
        why: FitError,
    },
    /// An effect that cannot be asked about.
    #[error(transparent)]
    Why(WhyError),
    /// A refinement that ran away.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}

fn why_once(in_both_sets: bool) -> &'static str {
    if in_both_sets { ", and a flight that was fitted on cannot judge the fit" } else { "" }
}
