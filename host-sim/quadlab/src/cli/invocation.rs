//! The words that called a command, and whether it is to stop: the process' own, or those of a program that runs commands in its
//! process.

use std::cell::RefCell;
use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A command as it was called.
#[derive(Debug, Clone)]
pub(crate) struct Invocation {
    /// With the program's name.
    pub(crate) words: Vec<OsString>,
    /// Set once it is to stop.
    pub(crate) stop: Arc<AtomicBool>,
}

thread_local! {
    static CURRENT: RefCell<Option<Invocation>> = const { RefCell::new(None) };
}

/// While it lives, commands of this thread are called so.
pub(crate) struct Within(());

/// Commands of this thread are called as `invocation` says from here on.
pub(crate) fn enter(invocation: Invocation) -> Within {
    CURRENT.set(Some(invocation));
    Within(())
}

impl Drop for Within {
    fn drop(&mut self) {
        CURRENT.set(None);
    }
}

/// The words of the command that this thread runs.
pub(crate) fn words() -> Vec<OsString> {
    let own = CURRENT.with_borrow(|current| current.as_ref().map(|invocation| invocation.words.clone()));
    own.unwrap_or_else(|| std::env::args_os().collect())
}

/// What is set once the command that this thread runs is to stop.
pub(crate) fn stop() -> Arc<AtomicBool> {
    CURRENT
        .with_borrow(|current| current.as_ref().map(|invocation| invocation.stop.clone()).unwrap_or_default())
}
