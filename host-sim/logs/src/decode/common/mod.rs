//! What decoders of several formats stand on.

pub(super) mod budget;
pub(super) mod bytes;
pub(super) mod decompress;
pub(super) mod faults;
