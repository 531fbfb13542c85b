//! Tables of other programs with a column a quantity, text or Parquet: flights through a map of columns, one a file.

use std::collections::BTreeMap;
use std::path::Path;

use flights::{COLUMNS, Column, ColumnMap, Flight, Source, header_names};

use crate::conversion::Part;
use crate::error::LogError;
use crate::format::Format;
use crate::log::Log;

/// The flight of a table, and which of its columns became which of ours.
pub(crate) struct FlightOfTable {
    flight: Flight,
    sources: BTreeMap<String, Source>,
    pub(crate) format: Format,
}

/// How much of a file is looked at to tell text.
const HEAD_BYTES: usize = 4096;

/// Whether bytes are text with something in it.
pub(crate) fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    !bytes.trim_ascii().is_empty() && !head.iter().any(|b| *b < b' ' && !b.is_ascii_whitespace())
}

/// The flight of a text.
pub(crate) fn of_text(bytes: &[u8], path: &Path, map: &ColumnMap) -> Result<FlightOfTable, LogError> {
    let names = header_names(bytes);
    refuse_strangers(&names, path, map)?;
    let flight = Flight::parse_whole(bytes, path, map)?;
    Ok(FlightOfTable { flight, sources: map.sources_in(&names, path)?, format: Format::Csv })
}

/// The flight of a Parquet file.
pub(crate) fn of_parquet(log: &Log, path: &Path, map: &ColumnMap) -> Result<FlightOfTable, LogError> {
    let columns: Vec<(String, Vec<f64>)> = log
        .tables
        .iter()
        .flat_map(|table| &table.columns)
        .map(|column| (name_in(log, &column.name, map), column.values.to_f64()))
        .collect();
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    refuse_strangers(&names, path, map)?;
    let flight = Flight::from_named(columns, path, map)?;
    Ok(FlightOfTable { flight, sources: map.sources_in(&names, path)?, format: Format::Parquet })
}

/// The name of a column with the unit that the schema gives it, where the map does not name it.
fn name_in(log: &Log, name: &str, map: &ColumnMap) -> String {
    match log.information.get(&format!("unit of {name}")) {
        Some(unit) if !map.names(name) => format!("{name} [{unit}]"),
        _ => name.to_owned(),
    }
}

/// Whether a table has a time and a quantity of a craft under names that are read as they are.
pub(crate) fn has_usual_names(log: &Log) -> bool {
    let names: Vec<String> =
        log.tables.iter().flat_map(|table| &table.columns).map(|column| column.name.clone()).collect();
    known(&names, Path::new(""), &ColumnMap::default()) > 1
}

/// How many of our columns there are, with the time; none without.
fn known(names: &[String], path: &Path, map: &ColumnMap) -> usize {
    map.sources_in(names, path).map_or(0, |sources| sources.len())
}

/// Refuses a table in which no name is known, with what can be done.
fn refuse_strangers(names: &[String], path: &Path, map: &ColumnMap) -> Result<(), LogError> {
    let is_known = |name: &String| known(&["t".to_owned(), name.clone()], path, map) > 1;
    if map.says_something() || names.iter().any(is_known) {
        return Ok(());
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let reason = format!(
        "none of its columns has a name that is known ({}); say which is which in a columns.toml beside it, for example: [columns] \
         t = {{ column = \"{}\", scale = 1e-6 }} (columns of a flight are {}, ...)",
        crate::error::plain_list(&names),
        names.first().unwrap_or(&"stamp"),
        COLUMNS[..11].join(", ")
    );
    Err(LogError::Refused { path: path.into(), reason })
}

impl FlightOfTable {
    /// The flight as a part of a log.
    pub(crate) fn into_part(self) -> Part {
        let t = self.flight.required(Column::T).to_vec();
        Part::of_rows(self.flight, &t)
    }

    /// The name in the table of the first of these columns of ours that it has.
    pub(crate) fn source(&self, ours: &[&str]) -> Option<String> {
        ours.iter().find_map(|own| Some(self.sources.get(*own)?.name.clone()))
    }

    /// What it cannot tell, a sentence each.
    pub(crate) fn limits(&self) -> Vec<String> {
        self.flight.stand_ins().iter().filter_map(|what| what.sentence()).map(Into::into).collect()
    }
}
