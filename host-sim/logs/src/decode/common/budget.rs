//! How much memory a log may ask for: a few bytes of a damaged or hostile file can promise gigabytes.

/// What any file may take beside a multiple of its size: so little that a small one does not take 64 MB.
const SMALLEST: usize = 8 << 20;
/// How often its size a part of a file, or all its columns, may take: several times what real logs do.
const LARGEST_RATIO: usize = 16;

/// Bytes that may still be reserved.
#[derive(Debug)]
pub(in crate::decode) struct Budget {
    left: usize,
    /// What may be taken at once.
    part: usize,
}

impl Budget {
    /// What compressed parts of a file of this size may become, one after another.
    pub(in crate::decode) fn for_decompression(file_bytes: usize) -> Self {
        const PARTS: usize = 4;
        let part = file_bytes.saturating_mul(LARGEST_RATIO).saturating_add(SMALLEST);
        Self { left: part.saturating_mul(PARTS), part }
    }

    /// What the columns of a file of this size may take in all.
    pub(in crate::decode) fn for_columns(file_bytes: usize) -> Self {
        let left = file_bytes.saturating_mul(LARGEST_RATIO).saturating_add(SMALLEST);
        Self { left, part: left }
    }

    /// Takes some, if that much is left.
    pub(in crate::decode) fn take(&mut self, bytes: usize) -> bool {
        let enough = bytes <= self.next();
        if enough {
            self.left -= bytes;
        }
        enough
    }

    /// What may be taken at once.
    pub(in crate::decode) fn next(&self) -> usize {
        self.left.min(self.part)
    }
}
