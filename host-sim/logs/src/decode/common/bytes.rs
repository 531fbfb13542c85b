//! Numbers out of bytes, step by step, with nothing where bytes are missing.

/// Bytes, and how far they are read.
#[derive(Debug, Clone, Copy)]
pub(in crate::decode) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    /// From the beginning.
    pub(in crate::decode) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// From here on; behind the end nothing is left.
    pub(in crate::decode) fn at(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at: at.min(bytes.len()) }
    }

    /// How many bytes are read.
    pub(in crate::decode) fn position(&self) -> usize {
        self.at
    }

    /// How many bytes are left.
    pub(in crate::decode) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next bytes.
    pub(in crate::decode) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    /// The next `N` bytes.
    pub(in crate::decode) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let taken = self.bytes.get(self.at..)?.first_chunk::<N>()?;
        self.at += N;
        Some(*taken)
    }

    /// Bytes with their count before them, as 32 bits.
    pub(in crate::decode) fn counted_u32(&mut self) -> Option<&'a [u8]> {
        let mut ahead = *self;
        let count = usize::try_from(ahead.u32()?).ok()?;
        let taken = ahead.take(count)?;
        *self = ahead;
        Some(taken)
    }

    /// Text with its length before it; what is no UTF-8 is replaced.
    pub(in crate::decode) fn text(&mut self) -> Option<String> {
        self.counted_u32().map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }

    /// Text up to an ending byte, which is read too.
    pub(in crate::decode) fn until(&mut self, end: u8) -> Option<&'a [u8]> {
        let length = memchr::memchr(end, self.bytes.get(self.at..)?)?;
        let taken = self.take(length)?;
        self.at += 1;
        Some(taken)
    }

    /// A number, little endian.
    pub(in crate::decode) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    /// A number, little endian.
    pub(in crate::decode) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    /// A number, little endian.
    pub(in crate::decode) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    /// A number, little endian.
    pub(in crate::decode) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }
}
