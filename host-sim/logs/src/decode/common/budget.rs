//! How much memory a log may ask for: a few bytes of a damaged or hostile file can promise gigabytes.

/// Bytes that may still be reserved.
#[derive(Debug)]
pub(in crate::decode) struct Budget {
    left: usize,
}

impl Budget {
    /// What compressed parts of a file of this size may become in all: far more than any real log, and so
    /// little for a small one that it takes no more than 64 MB, with the columns and while both grow.
    pub(in crate::decode) fn for_decompression(file_bytes: usize) -> Self {
        Self { left: file_bytes.saturating_mul(64).saturating_add(16 << 20) }
    }

    /// What the columns of a file of this size may take in all.
    pub(in crate::decode) fn for_columns(file_bytes: usize) -> Self {
        Self { left: file_bytes.saturating_mul(32).saturating_add(16 << 20) }
    }

    /// Takes some, if that much is left.
    pub(in crate::decode) fn take(&mut self, bytes: usize) -> bool {
        let enough = bytes <= self.left;
        if enough {
            self.left -= bytes;
        }
        enough
    }

    /// What is left.
    pub(in crate::decode) fn left(&self) -> usize {
        self.left
    }
}
