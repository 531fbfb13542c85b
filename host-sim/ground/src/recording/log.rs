//! MCAP logs: their channels, and reading one up to where it was cut off.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

use mcap::sans_io::LinearReaderOptions;
use mcap::{WriteOptions, Writer};
use serde_json::Value;

use super::entry::TOPICS;
use super::error::{RecordError, mcap_error};
use super::schema::{samples, schema};

/// A log with its channels, which have the same numbers in all.
pub(super) fn begin_mcap<W: Write + std::io::Seek>(
    file: W,
    options: WriteOptions,
) -> mcap::McapResult<(Writer<W>, Vec<u16>)> {
    let library = concat!("quadlab ", env!("CARGO_PKG_VERSION"));
    let mut writer = options.compression(None).library(library).create(file)?;
    let mut channels = Vec::new();
    for ((topic, name), sample) in TOPICS.iter().zip(samples()) {
        let schema = writer.add_schema(name, "jsonschema", schema(name, &sample).to_string().as_bytes())?;
        channels.push(writer.add_channel(schema, topic, "json", &BTreeMap::new())?);
    }
    Ok((writer, channels))
}

/// A message of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Logged {
    /// Its topic.
    pub topic: String,
    /// ns since 1970.
    pub log_time_ns: u64,
    /// What it says.
    pub value: Value,
}

/// Reads a log, finished or not, up to where it was cut off; each message goes to `each`.
///
/// # Errors
/// A file that cannot be read, or that does not begin as MCAP does.
pub fn read_log(
    path: &Path,
    mut each: impl FnMut(Logged) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    for_each_message(path, |message| {
        let Ok(value) = serde_json::from_slice(&message.data) else { return Ok(()) };
        each(Logged { topic: message.channel.topic.clone(), log_time_ns: message.log_time, value })
    })
}

pub(super) fn for_each_message(
    path: &Path,
    mut each: impl FnMut(&mcap::Message<'_>) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    let refuse = |source| RecordError::File { path: path.into(), what: "read the recording", source };
    let file = BufReader::new(File::open(path).map_err(refuse)?);
    let options = LinearReaderOptions::default().with_skip_end_magic(true);
    for message in mcap::io::MessageReader::new_with_options(file, options) {
        match message {
            Ok(message) => each(&message)?,
            Err(error @ mcap::McapError::BadMagic) => {
                return Err(mcap_error(path, "read the recording")(error));
            }
            // Cut off in the middle of a record: the end.
            Err(_) => break,
        }
    }
    Ok(())
}
