//! Why the workflow ends without an answer.

use std::path::{Path, PathBuf};

use flights::FlightError;
use sysid::{FitError, PrepareError, RefineError};

use crate::{SearchError, WhyError};

/// Why the workflow ends without an answer.
#[derive(Debug, thiserror::Error)]
pub enum WorkflowError {
    /// The file.
    #[error(transparent)]
    File(#[from] FlightError),
    /// An effect of users.
    #[error(transparent)]
    Effect(#[from] model::UserEffectError),
    /// A log of another program.
    #[error(transparent)]
    Log(#[from] logs::LogError),
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
    /// A fault that `columns.toml` cannot mend, or must not.
    #[error("{}: {fault}; --apply does nothing: {why}", path.display())]
    CannotMend {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        fault: String,
        /// Why it is not mended.
        why: String,
    },
    /// The same content twice, whatever the names.
    #[error("{}", given_twice(first, again, *in_both_sets))]
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
    /// A search for a form that could not be tested.
    #[error("a formula is proposed only where it predicts a flight that it was not fitted to: discover needs at least two training \
             flights and one held-out flight, and there {} to fit on. Fly more, each with another pattern; three and two are better",
             flights_to_fit_on(*train))]
    TooFewToDiscover {
        /// Training flights.
        train: usize,
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

impl WorkflowError {
    /// An error of a search, with the flights that it was about.
    pub(crate) fn of_search(why: SearchError, flights: String) -> Self {
        match why {
            SearchError::Fit(why) => Self::Fit { flights, why },
            SearchError::Cancelled => Self::Cancelled,
        }
    }

    /// An error of a question about one effect, with the flights that it was about.
    pub(crate) fn of_why(why: WhyError, flights: String) -> Self {
        match why {
            WhyError::Search(why) => Self::of_search(why, flights),
            other => Self::Why(other),
        }
    }
}

fn flights_to_fit_on(count: usize) -> String {
    match count {
        0 => "is none".to_owned(),
        1 => "is one".to_owned(),
        more => format!("are {more}"),
    }
}

/// The same file is named once; two files with the same content are both named.
fn given_twice(first: &Path, again: &Path, in_both_sets: bool) -> String {
    const WHY: &str = "a flight used for the fit cannot test it";
    let (same, again) = (first == again, again.display());
    match (same, in_both_sets) {
        (true, true) => format!("{again}: is given to both --train and --validate; {WHY}"),
        (true, false) => format!("{again}: is given twice; give each flight once"),
        (false, true) => {
            format!("{again}: is the same flight as {}; {WHY}: give each flight once", first.display())
        }
        (false, false) => {
            format!("{again}: is the same flight as {}; give each flight once", first.display())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_given_twice_is_told_why_where_it_was_to_judge_its_own_fit() {
        let twice = |first: &str, in_both_sets| {
            let (first, again) = (PathBuf::from(first), PathBuf::from("b/2.csv"));
            WorkflowError::GivenTwice { first, again, in_both_sets }.to_string()
        };
        assert_eq!(twice("a/1.csv", false), "b/2.csv: is the same flight as a/1.csv; give each flight once");
        assert_eq!(
            twice("a/1.csv", true),
            "b/2.csv: is the same flight as a/1.csv; a flight used for the fit cannot test it: give each flight once"
        );
        assert_eq!(twice("b/2.csv", false), "b/2.csv: is given twice; give each flight once");
        assert_eq!(
            twice("b/2.csv", true),
            "b/2.csv: is given to both --train and --validate; a flight used for the fit cannot test it"
        );
    }

    #[test]
    fn every_error_names_its_file_and_what_to_do() {
        let path = PathBuf::from("a/1.csv");
        let faulty = WorkflowError::Faulty { path: path.clone(), sentence: "z points up".into() };
        assert_eq!(faulty.to_string(), "a/1.csv: z points up (or --accept-faults to go on regardless)");
        let why = PrepareError::TooShort { samples: 9, duration_s: 0.08, needed_s: 0.91 };
        assert_eq!(
            WorkflowError::Unusable { path, why }.to_string(),
            "a/1.csv: has 9 samples over 0.08 s; at least 0.91 s without gaps or missing values are needed"
        );
        let fit = WorkflowError::Fit { flights: "1.csv, 2.csv".into(), why: FitError::NoFlights };
        assert_eq!(fit.to_string(), "1.csv, 2.csv: no flights to fit on");
    }
}
