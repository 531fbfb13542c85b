//! Work beside the interpreter, which goes on to hear Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How often signals are looked for.
const LOOK: Duration = Duration::from_millis(50);
/// As much as a program's own thread has.
const STACK_BYTES: usize = 8 << 20;

/// Does `work` without the interpreter's lock. Ctrl-C raises `KeyboardInterrupt` and sets the flag, at which `work` stops at its next
/// step.
pub(crate) fn beside<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Arc<AtomicBool>) -> T + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (done, result) = channel();
    let asked = stop.clone();
    let worker = std::thread::Builder::new().name("quadlab".into()).stack_size(STACK_BYTES);
    worker.spawn(move || {
        // Nobody waits any more after Ctrl-C.
        let _ = done.send(work(asked));
    })?;
    let result = std::sync::Mutex::new(result);
    loop {
        let found = py.detach(|| match result.lock() {
            Ok(result) => result.recv_timeout(LOOK),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match found {
            Ok(value) => return Ok(value),
            Err(RecvTimeoutError::Timeout) => {
                py.check_signals().inspect_err(|_| stop.store(true, Ordering::Relaxed))?;
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "quadlab failed; what it printed says where. Please report it",
                ));
            }
        }
    }
}
