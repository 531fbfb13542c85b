//! The terminal as the observer of long work: progress and warnings on standard error.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use diagnosis::workflow::{Observer, Progress};

use crate::cli::{colour, invocation, progress};

/// Shows progress where a person watches, and prints warnings.
pub(crate) struct Terminal {
    json: bool,
    shown: Mutex<Option<Shown>>,
    stop: Arc<AtomicBool>,
}

struct Shown {
    bar: progress::Progress,
    counts: bool,
}

impl Terminal {
    /// Without progress for `--json`.
    pub(crate) fn new(json: bool) -> Self {
        Self { json, shown: Mutex::new(None), stop: invocation::stop() }
    }

    /// Takes the progress away, for what a command prints at its end.
    pub(crate) fn clear(&self) {
        if let Some(shown) = self.locked().take() {
            shown.bar.finish_and_clear();
        }
    }

    fn locked(&self) -> std::sync::MutexGuard<'_, Option<Shown>> {
        self.shown.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Observer for Terminal {
    fn progress(&self, progress: Progress<'_>) {
        let mut shown = self.locked();
        let due = shown.as_ref().and_then(|shown| shown.bar.next_line());
        if shown.as_ref().is_some_and(|shown| shown.counts != progress.steps.is_some())
            && let Some(old) = shown.take()
        {
            old.bar.finish_and_clear();
        }
        let now = shown.get_or_insert_with(|| match progress.steps {
            Some((_, all)) => Shown { bar: progress::bar(all, self.json).due(due), counts: true },
            None => Shown { bar: progress::spinner(self.json).due(due), counts: false },
        });
        match progress.steps {
            Some((done, all)) => now.bar.set_activity(progress.activity, done as u64, all as u64),
            None => now.bar.set_message(progress.activity.to_owned()),
        }
    }

    fn is_cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn warning(&self, sentence: &str) {
        match self.locked().as_ref() {
            Some(shown) => shown.bar.suspend(|| colour::warn(sentence)),
            None => colour::warn(sentence),
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.clear();
    }
}
