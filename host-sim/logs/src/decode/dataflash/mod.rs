//! ArduPilot DataFlash, binary and text.
//!
//! Read by hand: the one library, `ardupilot-binlog` 0.2.0, makes a map of owned names for every message
//! (memory and speed), panics on a format shorter than its header, and reads no text logs.
//!
//! A log describes itself: `FMT` messages give each type its length, a letter a field and the names. A message
//! has no checksum, so one is taken for whole if another begins where it ends.

mod binary;
mod columns;
mod damage;
mod format;
mod messages;
mod special;
mod text;

use std::path::Path;

use crate::error::LogError;
use crate::format::Format;
use crate::log::{Log, Table};
use crate::progress::Decoding;

pub(crate) fn decode(bytes: &[u8], path: &Path, progress: &mut Decoding<'_>) -> Result<Log, LogError> {
    if u32::try_from(bytes.len()).is_err() {
        return Err(LogError::Format {
            path: path.into(),
            what: "is longer than 4 GiB".into(),
            mend: "cut it into flights with the ground station".into(),
        });
    }
    let mut log = Log::new(Format::Dataflash);
    if bytes.starts_with(&format::HEADER) {
        binary::decode(bytes, &mut log, progress)
    } else {
        text::decode(bytes, &mut log)
    }
    if log.tables.is_empty() {
        return Err(LogError::Format {
            path: path.into(),
            what: "is a DataFlash log without a message that can be read".into(),
            mend: "download it from the craft again".into(),
        });
    }
    name_apart(&mut log.tables);
    Ok(log)
}

/// Two formats under one name (a log that was appended to by another firmware): the later ones are counted.
fn name_apart(tables: &mut [Table]) {
    tables.sort_by(|a, b| a.name.cmp(&b.name));
    let mut start = 0;
    while start < tables.len() {
        let name = tables[start].name.clone();
        let same = tables[start..].iter().take_while(|table| table.name == name).count();
        for (index, table) in tables[start..start + same].iter_mut().enumerate().skip(1) {
            table.name = format!("{name} ({})", index + 1);
        }
        start += same;
    }
}
