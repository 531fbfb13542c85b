//! MCAP logs and their channels.

use std::collections::BTreeMap;
use std::io::Write;

use mcap::{WriteOptions, Writer};

use super::entry::TOPICS;
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
