//! The header row: which field is which column.

use std::path::Path;

use crate::column_map::ColumnMap;
use crate::columns::COLUMNS;
use crate::error::FlightError;
use crate::names::{Named, named};

/// Which columns the fields of a row are.
pub(crate) struct Header {
    /// For each field of a row: the place of its column in `known`, nothing for an unknown column.
    pub(crate) fields: Vec<Option<usize>>,
    /// Known columns that the file has, in file order.
    pub(crate) known: Vec<usize>,
    /// Factor to the unit of each of them, and what is added then.
    pub(crate) scales: Vec<[f64; 2]>,
}

pub(crate) fn read_header(line: &[u8], path: &Path, map: &ColumnMap) -> Result<Header, FlightError> {
    let text = String::from_utf8_lossy(line);
    let names: Vec<&str> = text.trim().split(',').map(|n| n.trim().trim_matches('"')).collect();
    let mut header = Header { fields: Vec::new(), known: Vec::new(), scales: Vec::new() };
    let exact: Vec<usize> =
        names.iter().filter_map(|name| COLUMNS.iter().position(|column| column == name)).collect();
    let refuse = |column: &str, problem| {
        Err(FlightError::Header {
            path: path.into(),
            column: shortened(column),
            problem,
            found: shortened(&names.join(",")),
        })
    };
    if let Some((_, source)) = map.sources.iter().find(|(_, source)| !names.contains(&source.name.as_str())) {
        return refuse(&source.name, "is named in columns.toml and not there");
    }
    for name in &names {
        if let Some((column, source)) = map.sources.iter().find(|(_, source)| source.name == *name) {
            header.fields.push(Some(header.known.len()));
            header.known.push(*column);
            header.scales.push([source.scale, source.offset]);
            continue;
        }
        match named(name, &exact) {
            Named::Column(column, _) if map.sources.contains_key(&column) => header.fields.push(None),
            Named::Column(column, _) if header.known.contains(&column) => {
                return refuse(name, "is there twice");
            }
            Named::Column(column, factor) => {
                header.fields.push(Some(header.known.len()));
                header.known.push(column);
                header.scales.push([factor, 0.0]);
            }
            Named::UnknownUnit => return refuse(name, "is in a unit that is not known"),
            Named::Other => header.fields.push(None),
        }
    }
    if !header.known.contains(&0) {
        return refuse(COLUMNS[0], "is missing");
    }
    Ok(header)
}

/// For messages: the beginning of a long text.
pub(crate) fn shortened(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { '?' } else { c }).take(121).collect();
    if text.chars().count() <= 120 { text } else { text.chars().take(117).collect::<String>() + "..." }
}
