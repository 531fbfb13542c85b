//! Betaflight and INAV blackbox.
//!
//! Read by hand: the one library, `blackbox-log` 0.4.3, takes empty logs together with those that follow,
//! stops at Betaflight 4.5 and INAV 8, and reads 15 to 37 MB/s.
//!
//! A file holds a log for each time the craft was armed, each with a header of text lines, then frames:
//! `I` whole, `P` as differences from what the last two predict, `S`, `G`, `H`, `E` for the rest. Nothing has
//! a checksum. What is taken for a frame follows blackbox_decode, so that its rows and sums come out the same;
//! but where that stops (a gap of more than 5000 iterations, erased memory), two whole frames that follow on
//! each other begin anew.
//!
//! Fields that say nothing of the craft's motion (terms of the controller, radio) are read past, not kept.

mod definitions;
mod encoding;
mod frames;
mod header;
mod kept;
mod prediction;
mod rows;

use std::path::Path;

use crate::error::LogError;
use crate::format::Format;
use crate::log::{Log, Table, TimeUnit};
use crate::progress::Decoding;

/// How each log of a file begins.
const MARKER: &[u8] = b"H Product:Blackbox";
/// Sentences about damage; the rest is counted.
const MOST_SENTENCES: usize = 5;

pub(crate) fn decode(bytes: &[u8], path: &Path, progress: &mut Decoding<'_>) -> Result<Log, LogError> {
    let mut log = Log::new(Format::Blackbox);
    let mut starts: Vec<usize> = memchr::memmem::find_iter(bytes, MARKER).collect();
    starts.push(bytes.len());
    let mut sentences = Vec::new();
    for (index, log_bytes) in starts.windows(2).filter_map(|ends| bytes.get(ends[0]..ends[1])).enumerate() {
        progress.at(starts[index]);
        let name = format!("log {}", index + 1);
        let (table, sentence) = one_log(log_bytes, &name, &mut log);
        log.tables.push(table);
        sentences.extend(sentence.map(|sentence| format!("{name}: {sentence}")));
    }
    if log.tables.is_empty() {
        return Err(LogError::Format {
            path: path.into(),
            what: "is a blackbox file without the header of a log".into(),
            mend: "download it from the craft again".into(),
        });
    }
    let more = sentences.len().saturating_sub(MOST_SENTENCES);
    sentences.truncate(MOST_SENTENCES);
    if more > 0 {
        sentences.push(format!("{more} further logs of the file are damaged"));
    }
    log.losses.damage = sentences;
    Ok(log)
}

/// Decodes one log of a file: its table, and a sentence about its damage.
fn one_log(bytes: &[u8], name: &str, log: &mut Log) -> (Table, Option<String>) {
    let empty = Table {
        name: name.into(),
        message_type: None,
        time_unit: TimeUnit::Microseconds,
        times: Vec::new(),
        rows: 0,
        columns: Vec::new(),
    };
    let (header, start) = header::read(bytes);
    for (key, value) in &header.settings {
        if key == "Firmware revision" {
            log.firmware.get_or_insert_with(|| value.clone());
        }
        log.information.insert(format!("{name}: {key}"), value.clone());
    }
    let data = bytes.get(start..).unwrap_or_default();
    let definitions = match definitions::Definitions::new(&header) {
        Ok(definitions) => definitions,
        Err(sentence) => return (empty, Some(sentence)),
    };
    let mut rows = rows::Rows::new(&header, &definitions.places, data.len());
    let found = frames::read(data, &definitions, &mut rows);
    if found.cut {
        log.information.insert(format!("{name}: last row"), "cut off".into());
    }
    let (times, columns) = rows.finish();
    let table = Table { rows: times.len(), times, columns, ..empty };
    (table, found.sentence(&header))
}
