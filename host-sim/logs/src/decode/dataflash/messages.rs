//! Where the messages of a type stand in the file.

use super::format::MessageFormat;

/// The messages of one type.
#[derive(Debug)]
pub(super) struct Messages {
    /// What they look like.
    pub(super) format: MessageFormat,
    /// Where each begins in the file.
    pub(super) starts: Vec<u32>,
}
