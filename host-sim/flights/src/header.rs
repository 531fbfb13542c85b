//! The header row: which field is which column.

use std::path::Path;

use crate::columns::{COLUMNS, REQUIRED};
use crate::error::FlightError;

/// Which columns the fields of a row are.
pub(crate) struct Header {
    /// For each field of a row: the place of its column in `known`, nothing for an unknown column.
    pub(crate) fields: Vec<Option<usize>>,
    /// Known columns that the file has, in file order.
    pub(crate) known: Vec<usize>,
}

pub(crate) fn read_header(line: &[u8], path: &Path) -> Result<Header, FlightError> {
    let text = String::from_utf8_lossy(line);
    let names: Vec<&str> = text.trim().split(',').map(|n| n.trim().trim_matches('"')).collect();
    let mut header = Header { fields: Vec::new(), known: Vec::new() };
    let refuse = |column: &str, problem| {
        Err(FlightError::Header {
            path: path.into(),
            column: column.into(),
            problem,
            found: shortened(&names.join(",")),
        })
    };
    for name in &names {
        match COLUMNS.iter().position(|c| c == name) {
            Some(column) if header.known.contains(&column) => return refuse(name, "is there twice"),
            Some(column) => {
                header.fields.push(Some(header.known.len()));
                header.known.push(column);
            }
            None => header.fields.push(None),
        }
    }
    for (index, column) in COLUMNS[..REQUIRED].iter().enumerate() {
        if !header.known.contains(&index) {
            return refuse(column, "is missing");
        }
    }
    Ok(header)
}

/// For messages: the beginning of a long text.
pub(crate) fn shortened(text: &str) -> String {
    if text.chars().count() <= 120 { text.into() } else { text.chars().take(117).collect::<String>() + "..." }
}
