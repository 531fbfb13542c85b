//! Who watches a long computation.

use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};

/// What is being done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress<'a> {
    /// The activity, for people: "reading flights", "trying ground-effect".
    pub activity: &'a str,
    /// Steps done and steps in all, where they are known.
    pub steps: Option<(usize, usize)>,
}

/// Hears of progress and warnings, and may ask to stop.
pub trait Observer: Sync {
    /// A step begins or ends.
    fn progress(&self, _progress: Progress<'_>) {}

    /// Something that the user should know and that does not stop the work; one sentence.
    fn warning(&self, _sentence: &str) {}

    /// Whether to stop at the next opportunity.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {}

/// Says each warning once, however often the work comes past it.
pub(crate) struct Once<'a> {
    to: &'a dyn Observer,
    said: Mutex<HashSet<String>>,
}

impl<'a> Once<'a> {
    /// To another observer.
    pub(crate) fn new(to: &'a dyn Observer) -> Self {
        Self { to, said: Mutex::default() }
    }
}

impl Observer for Once<'_> {
    fn progress(&self, progress: Progress<'_>) {
        self.to.progress(progress);
    }

    fn warning(&self, sentence: &str) {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if said.insert(sentence.to_owned()) {
            self.to.warning(sentence);
        }
    }

    fn is_cancelled(&self) -> bool {
        self.to.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Keeps what it hears.
    #[derive(Default)]
    struct Keeping(Mutex<Vec<String>>);

    impl Observer for Keeping {
        fn warning(&self, sentence: &str) {
            self.0.lock().unwrap().push(sentence.to_owned());
        }

        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_warning_is_said_once_and_the_rest_is_passed_on() {
        let keeping = Keeping::default();
        let once = Once::new(&keeping);
        for sentence in ["the battery is low", "it rains", "the battery is low"] {
            once.warning(sentence);
        }
        assert_eq!(*keeping.0.lock().unwrap(), ["the battery is low", "it rains"]);
        assert!(once.is_cancelled());
    }

    /// Hears of warnings alone.
    struct Worried;

    impl Observer for Worried {
        fn warning(&self, sentence: &str) {
            assert_eq!(sentence, "the battery is low");
        }
    }

    #[test]
    fn nobody_is_stopped_by_an_observer_that_does_not_ask_for_it() {
        for observer in [&Silent as &dyn Observer, &Worried] {
            observer.progress(Progress { activity: "reading flights", steps: Some((1, 2)) });
            observer.warning("the battery is low");
            assert!(!observer.is_cancelled());
        }
    }
}
