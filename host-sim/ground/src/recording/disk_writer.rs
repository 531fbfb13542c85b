//! The thread that writes a recording, so that nobody who flies waits for a disk.
//!
//! A disk that is full or slow is tried again and again; what comes meanwhile waits in memory, up to [`MOST_WAITING`], some minutes of
//! flight. Only then messages are left out, and a gap in the numbers of their channel says so.

use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, McapResult, Writer};

/// Most that waits for the disk, bytes of messages.
pub(super) const MOST_WAITING: usize = 64 << 20;
/// What is written at once, bytes: much, as a disk that is slow is slow for each write.
const MOST_AT_ONCE: usize = 1 << 20;
/// Between two tries.
const AGAIN: Duration = Duration::from_millis(100);
/// How long the end of a recording waits for a disk that takes nothing.
const PATIENCE: Duration = Duration::from_secs(2);

/// A message for the disk.
#[derive(Debug)]
pub(super) struct Queued {
    pub(super) header: MessageHeader,
    pub(super) data: Vec<u8>,
}

/// A log that grows.
pub(super) type Log = Writer<NoSeek<Growing>>;

/// A file that grows by whole records: writing goes to memory and never fails, flushing brings it to the file or leaves it where it is,
/// for another try.
#[derive(Debug)]
pub(super) struct Growing {
    file: File,
    /// Bytes that are in the file for good.
    length: u64,
    waiting: Vec<u8>,
}

impl Growing {
    pub(super) fn new(file: File) -> Self {
        Self { file, length: 0, waiting: Vec::new() }
    }
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.waiting.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.write_all_at(&self.waiting, self.length)?;
        self.length += self.waiting.len() as u64;
        self.waiting.clear();
        Ok(())
    }
}

/// What the two threads know of each other.
#[derive(Debug, Default)]
struct Shared {
    /// Bytes of messages that wait.
    waiting: AtomicUsize,
    /// Nothing comes any more.
    is_closing: AtomicBool,
    /// Why the disk takes nothing now.
    trouble: Mutex<Option<String>>,
}

impl Shared {
    fn set_trouble(&self, why: Option<String>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = why;
    }
}

/// The thread, as the one who records sees it.
#[derive(Debug)]
pub(super) struct DiskWriter {
    shared: Arc<Shared>,
    queue: Option<Sender<Queued>>,
    thread: Option<JoinHandle<McapResult<()>>>,
    most_waiting: usize,
    /// Messages that were left out.
    left_out: u64,
}

impl DiskWriter {
    /// Begins to write to this log.
    pub(super) fn start(log: Log, most_waiting: usize) -> io::Result<Self> {
        let (queue, to_write) = channel();
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let thread =
            Builder::new().name("recording".into()).spawn(move || write(log, &to_write, &of_thread))?;
        Ok(Self { shared, queue: Some(queue), thread: Some(thread), most_waiting, left_out: 0 })
    }

    /// Takes a message, or leaves it out where too much waits. Never blocks.
    pub(super) fn push(&mut self, message: Queued) {
        let length = message.data.len();
        let waiting = self.shared.waiting.fetch_add(length, Ordering::Relaxed);
        let is_room = waiting + length <= self.most_waiting;
        if !is_room || self.queue.as_ref().is_none_or(|queue| queue.send(message).is_err()) {
            self.shared.waiting.fetch_sub(length, Ordering::Relaxed);
            self.left_out += 1;
        }
    }

    /// Messages that were left out so far.
    pub(super) fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Whether the disk has caught up.
    pub(super) fn is_idle(&self) -> bool {
        self.shared.waiting.load(Ordering::Relaxed) == 0
    }

    /// Why the disk takes nothing now.
    pub(super) fn trouble(&self) -> Option<String> {
        self.shared.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Closes the log when all that waits is written; the disk's last word where it takes nothing. Once.
    pub(super) fn close(&mut self) -> McapResult<()> {
        self.shared.is_closing.store(true, Ordering::Relaxed);
        self.queue = None;
        let Some(thread) = self.thread.take() else { return Ok(()) };
        thread
            .join()
            .unwrap_or_else(|_| Err(McapError::Io(io::Error::other("the thread that writes it has failed"))))
    }
}

/// Writes until nothing comes any more.
fn write(mut log: Log, queue: &Receiver<Queued>, shared: &Shared) -> McapResult<()> {
    while let Ok(first) = queue.recv() {
        let mut length = 0;
        for Queued { header, data } in std::iter::once(first).chain(queue.try_iter()) {
            log.write_to_known_channel(&header, &data)?;
            length += data.len();
            if length >= MOST_AT_ONCE {
                break;
            }
        }
        until_taken(shared, || log.flush())?;
        shared.waiting.fetch_sub(length, Ordering::Relaxed);
    }
    // Its end goes to memory first, too. Where the disk does not take that at once, it is asked again.
    let _ = log.finish();
    let mut file = log.into_inner();
    until_taken(shared, || Ok(file.flush()?))
}

/// Brings to the disk what is in memory, as soon as it takes it; at the end not for ever.
fn until_taken(shared: &Shared, mut flush: impl FnMut() -> McapResult<()>) -> McapResult<()> {
    let mut closing_since = None;
    while let Err(error) = flush() {
        shared.set_trouble(Some(words(&error)));
        let is_closing = shared.is_closing.load(Ordering::Relaxed);
        if is_closing && closing_since.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
            return Err(error);
        }
        sleep(AGAIN);
    }
    shared.set_trouble(None);
    Ok(())
}

/// What is wrong, in the system's words where they are its.
fn words(error: &McapError) -> String {
    match error {
        McapError::Io(source) => source.to_string(),
        other => other.to_string(),
    }
}
