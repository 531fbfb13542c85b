//! PX4 ULog (docs.px4.io, "ULog File Format"): all of the specification, as columns.
//!
//! Written by hand: `yule_log` 0.4 reads 52 MB/s, a value at a time, and ends at the first damage;
//! `px4-ulog` 0.6.1 panics on damaged files.
//!
//! A first walk over the records finds where the rows of each topic lie; then columns are copied whole.

mod columns;
mod contents;
mod formats;
mod records;
mod walk;

use std::ops::Range;
use std::path::Path;

use crate::error::LogError;
use crate::log::Log;
use crate::progress::Decoding;

use contents::Contents;
use records::HEADER_BYTES;
use walk::walk;

/// Decodes a ULog. A table is a topic and its instance, `vehicle_attitude[0]`; its times are `timestamp`.
pub(crate) fn decode(bytes: &[u8], path: &Path, progress: &mut Decoding<'_>) -> Result<Log, LogError> {
    let format_error =
        |what: &str, mend: &str| LogError::Format { path: path.into(), what: what.into(), mend: mend.into() };
    let Some(start_us) = bytes.get(8..HEADER_BYTES).and_then(|field| field.first_chunk()) else {
        return Err(format_error("ends within the header of a ULog", "copy it from the craft again"));
    };
    let flags = records::flag_bits(bytes);
    if let Some(unknown) = flags.and_then(|flags| flags.unknown_incompatible()) {
        return Err(format_error(
            &format!("is a ULog with a feature that is not known (incompatible flag byte {unknown})"),
            "look whether a newer quadlab reads it",
        ));
    }
    let mut contents = Contents::new(bytes);
    let appended = flags.map_or_else(Vec::new, |flags| flags.appended(bytes.len()));
    for section in sections(bytes.len(), &appended) {
        walk(bytes, section, &mut contents, progress);
    }
    Ok(contents.into_log(u64::from_le_bytes(*start_us), appended.len()))
}

/// The stretches that hold records: up to the first appended data, then each appended part.
fn sections(end: usize, appended: &[usize]) -> Vec<Range<usize>> {
    let starts = std::iter::once(HEADER_BYTES).chain(appended.iter().copied());
    let ends = appended.iter().copied().chain([end]);
    starts.zip(ends).map(|(start, end)| start..end).collect()
}
