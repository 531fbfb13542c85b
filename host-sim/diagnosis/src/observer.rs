//! Who watches a long computation.

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

#[cfg(test)]
mod tests {
    use super::*;

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
