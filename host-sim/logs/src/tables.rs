//! Tables of other programs with a column a quantity, text or Parquet: flights through a map of columns, one a file.

use std::collections::BTreeMap;
use std::path::Path;

use flights::{COLUMNS, Column, ColumnMap, Flight, GAP_PERIODS, Source, header_names, median_step};

use crate::conversion::Part;
use crate::error::LogError;
use crate::format::Format;
use crate::import::{Import, Messages, Sources, stem};
use crate::log::{Log, Losses};
use crate::recording::Hints;

/// How much of a file is looked at to tell text.
const HEAD_BYTES: usize = 4096;

/// Whether bytes are text with something in it.
pub(crate) fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    !bytes.trim_ascii().is_empty() && !head.iter().any(|b| *b < b' ' && !b.is_ascii_whitespace())
}

/// The flight of a text.
pub(crate) fn of_text(bytes: &[u8], path: &Path, map: &ColumnMap) -> Result<Import, LogError> {
    let names = header_names(bytes);
    refuse_strangers(&names, path, map)?;
    let flight = Flight::parse_whole(bytes, path, map)?;
    Ok(imported(flight, &map.sources_in(&names, path)?, Format::Csv, path))
}

/// The flight of a Parquet file.
pub(crate) fn of_parquet(log: &Log, path: &Path, map: &ColumnMap) -> Result<Import, LogError> {
    let columns: Vec<(String, Vec<f64>)> = log
        .tables
        .iter()
        .flat_map(|table| &table.columns)
        .map(|column| (name_in(log, &column.name, map), column.values.to_f64()))
        .collect();
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    refuse_strangers(&names, path, map)?;
    let flight = Flight::from_named(columns, path, map)?;
    Ok(imported(flight, &map.sources_in(&names, path)?, Format::Parquet, path))
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
        crate::sources::plain_list(&names),
        names.first().unwrap_or(&"stamp"),
        COLUMNS[..11].join(", ")
    );
    Err(LogError::Refused { path: path.into(), reason })
}

fn imported(mut flight: Flight, sources: &BTreeMap<String, Source>, format: Format, path: &Path) -> Import {
    flight.name = format!("{}.csv", stem(path));
    let t = flight.required(Column::T);
    let span = [t[0], t[t.len() - 1]];
    let period_s = median_step(t);
    let lost_s = t.windows(2).map(|w| w[1] - w[0]).filter(|step| *step > GAP_PERIODS * period_s).sum::<f64>();
    let limits = flight.stand_ins().iter().filter_map(|what| what.sentence()).map(Into::into).collect();
    let messages = Messages { name: "rows".into(), count: t.len(), first_last: Some(span) };
    let from = |ours: &[&str]| ours.iter().find_map(|own| Some(sources.get(*own)?.name.clone()));
    Import {
        path: path.into(),
        format,
        firmware: None,
        messages: vec![messages],
        sources: Sources {
            position: from(&["x", "z"]),
            attitude: from(&["phi", "qw"]),
            rates: from(&["p"]),
            specific_force: from(&["ax"]),
            commands: from(&["cmd1"]),
            rotor_speed: from(&["omega1"]),
            voltage: from(&["vbat"]),
        },
        flights: vec![Part { flight, span, rate_hz: 1.0 / period_s, lost_s }],
        hints: Hints::default(),
        losses: Losses::default(),
        limits,
        notes: Vec::new(),
    }
}
