//! Numbers out of bytes, step by step, with nothing where bytes are missing.

/// Bytes, and how far they are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// A number of the width, if the bytes are there.
macro_rules! number {
    ($name:ident, $type:ty) => {
        #[doc = concat!("A `", stringify!($type), "`, little endian.")]
        pub(super) fn $name(&mut self) -> Option<$type> {
            self.array().map(<$type>::from_le_bytes)
        }
    };
}

impl<'a> Cursor<'a> {
    /// From the beginning.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// From here on; behind the end nothing is left.
    pub(super) fn at(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at: at.min(bytes.len()) }
    }

    /// How many bytes are read.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// How many bytes are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next bytes.
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    /// The next `N` bytes.
    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let taken = self.bytes.get(self.at..)?.first_chunk::<N>()?;
        self.at += N;
        Some(*taken)
    }

    /// Bytes with their count before them, as 32 bits.
    pub(super) fn counted_u32(&mut self) -> Option<&'a [u8]> {
        let mut ahead = *self;
        let count = usize::try_from(ahead.u32()?).ok()?;
        let taken = ahead.take(count)?;
        *self = ahead;
        Some(taken)
    }

    /// Text with its length before it; what is no UTF-8 is replaced.
    pub(super) fn text(&mut self) -> Option<String> {
        self.counted_u32().map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }

    /// Text up to an ending byte, which is read too.
    pub(super) fn until(&mut self, end: u8) -> Option<&'a [u8]> {
        let length = memchr::memchr(end, self.bytes.get(self.at..)?)?;
        let taken = self.take(length)?;
        self.at += 1;
        Some(taken)
    }

    number!(u8, u8);
    number!(u16, u16);
    number!(u32, u32);
    number!(u64, u64);
}
