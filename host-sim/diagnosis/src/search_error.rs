//! Why a search ends without an answer.

use sysid::FitError;

use crate::observer::{Observer, Progress};

/// Why a search ends without an answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// The fit.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Steps of one kind, of which the observer hears one after the other, and before each of which it may stop the search.
pub(crate) struct Steps<'a> {
    observer: &'a dyn Observer,
    done: usize,
    all: usize,
}

impl<'a> Steps<'a> {
    pub(crate) fn new(observer: &'a dyn Observer, all: usize) -> Self {
        Self { observer, done: 0, all }
    }

    /// The next step begins.
    pub(crate) fn next(&mut self, activity: &str) -> Result<(), SearchError> {
        going_on(self.observer)?;
        self.observer.progress(Progress { activity, steps: Some((self.done, self.all)) });
        self.done += 1;
        Ok(())
    }
}

/// An error where the observer asks to stop.
pub(crate) fn going_on(observer: &dyn Observer) -> Result<(), SearchError> {
    if observer.is_cancelled() { Err(SearchError::Cancelled) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// Stops after so many steps.
    struct Patient {
        steps: usize,
        heard: Mutex<Vec<String>>,
    }

    impl Observer for Patient {
        fn progress(&self, progress: Progress<'_>) {
            let (done, all) = progress.steps.unwrap();
            self.heard.lock().unwrap().push(format!("{} {done} of {all}", progress.activity));
        }

        fn is_cancelled(&self) -> bool {
            self.heard.lock().unwrap().len() == self.steps
        }
    }

    #[test]
    fn every_step_is_counted_and_none_begins_after_the_observer_has_stopped() {
        let observer = Patient { steps: 2, heard: Mutex::default() };
        let mut steps = Steps::new(&observer, 3);
        assert_eq!(steps.next("a"), Ok(()));
        assert_eq!(steps.next("b"), Ok(()));
        assert_eq!(steps.next("c"), Err(SearchError::Cancelled));
        assert_eq!(*observer.heard.lock().unwrap(), ["a 0 of 3", "b 1 of 3"]);
    }
}
