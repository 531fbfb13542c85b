//! How far the reading of a log is, for who waits for it.

/// What is being done with a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// For people: "reading", "decoding", "making flights".
    pub stage: &'static str,
    /// Bytes of the file that are done, and all of them, where the stage goes through the file.
    pub bytes: Option<(usize, usize)>,
}

/// Who watches.
pub type Watch<'a> = &'a dyn Fn(Progress);

/// Nobody watches.
pub(crate) const UNWATCHED: Watch<'static> = &|_| {};

/// Bytes from one report to the next.
pub(crate) const REPORTED_BYTES: usize = 1 << 22;

/// Reports how far a decoder is in its file, now and then.
pub(crate) struct Decoding<'a> {
    watch: Watch<'a>,
    all: usize,
    next: usize,
}

impl<'a> Decoding<'a> {
    /// Of a file of so many bytes.
    pub(crate) fn new(watch: Watch<'a>, all: usize) -> Self {
        watch(Progress { stage: "decoding", bytes: Some((0, all)) });
        Self { watch, all, next: REPORTED_BYTES }
    }

    /// The decoder is here.
    pub(crate) fn at(&mut self, byte: usize) {
        if byte >= self.next {
            self.next = byte + REPORTED_BYTES;
            (self.watch)(Progress { stage: "decoding", bytes: Some((byte, self.all)) });
        }
    }
}
