//! The header row: which field is which column.

use std::collections::BTreeMap;
use std::path::Path;

use crate::column_map::{ColumnMap, Origin, Source};
use crate::columns::COLUMNS;
use crate::error::FlightError;
use crate::names::{Named, named, unit_of_further};

/// Which columns the fields of a row are.
pub(crate) struct Header {
    /// For each field of a row: the place of its column in `known`, nothing for an unknown column.
    pub(crate) fields: Vec<Option<usize>>,
    /// Names of ours for the columns that are read, in file order.
    pub(crate) known: Vec<String>,
    /// Factor to the unit of each of them, and what is added then.
    pub(crate) scales: Vec<[f64; 2]>,
}

/// A row of so many names is no header.
pub(crate) const TOO_MANY: usize = 10_000;

/// The names in a header row, [`TOO_MANY`] at most.
pub(crate) fn names_in(line: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(line);
    let names = text.trim().split(',').take(TOO_MANY);
    names.map(|name| name.trim().trim_matches('"').to_owned()).collect()
}

pub(crate) fn read_header(names: &[String], path: &Path, map: &ColumnMap) -> Result<Header, FlightError> {
    if names.len() >= TOO_MANY {
        return Err(FlightError::Foreign {
            path: path.into(),
            what: "a row of 10,000 names or more",
            mend: "leave out the columns that are not needed",
        });
    }
    let mut header = Header { fields: Vec::new(), known: Vec::new(), scales: Vec::new() };
    let exact: Vec<usize> =
        names.iter().filter_map(|name| COLUMNS.iter().position(|column| column == name)).collect();
    let refuse = |column: &str, problem| {
        Err(FlightError::Header {
            path: path.into(),
            column: shortened(column),
            problem,
            found: format!("the header has {}", shortened(&names.join(","))),
        })
    };
    if let Some((_, source)) = map.sources.iter().find(|(_, source)| !names.contains(&source.name)) {
        return refuse(
            &source.name,
            match map.origin {
                Origin::Beside => "is named in columns.toml and not there",
                Origin::Vehicle => {
                    "is named under [columns] in the vehicle file and not there (a columns.toml beside the flight, even an empty one, \
                 goes before it)"
                }
            },
        );
    }
    for name in names {
        if let Some((own, source)) = map.sources.iter().find(|(_, source)| source.name == *name) {
            header.add(own, [source.scale, source.offset]);
            continue;
        }
        match named(name, &exact) {
            Named::Column(column, _) if map.sources.contains_key(COLUMNS[column]) => header.fields.push(None),
            Named::Column(column, _) if header.has(COLUMNS[column]) => return refuse(name, "is there twice"),
            Named::Column(column, factor) => header.add(COLUMNS[column], [factor, 0.0]),
            Named::UnknownUnit => return refuse(name, "is in a unit that is not known"),
            Named::Other => match map.further_named(name) {
                Some(own) if header.has(own) => return refuse(name, "is there twice"),
                Some(own) => match unit_of_further(name) {
                    Some(factor) => header.add(own, [factor, 0.0]),
                    None => return refuse(name, "is in a unit that is not known; scale it in columns.toml"),
                },
                None => header.fields.push(None),
            },
        }
    }
    if !header.has(COLUMNS[0]) {
        return refuse(
            COLUMNS[0],
            "is missing (a columns.toml beside the flight can say which column is the time)",
        );
    }
    Ok(header)
}

impl ColumnMap {
    /// For the columns that a file with these names in its header has, where they are from.
    pub fn sources_in(&self, names: &[String], path: &Path) -> Result<BTreeMap<String, Source>, FlightError> {
        let header = read_header(names, path, self)?;
        let fields = names.iter().zip(&header.fields).filter_map(|(name, field)| Some((name, (*field)?)));
        let source = |(name, k): (&String, usize)| {
            let [scale, offset] = header.scales[k];
            (header.known[k].clone(), Source { name: name.clone(), scale, offset })
        };
        Ok(fields.map(source).collect())
    }
}

impl Header {
    /// The next field is this column.
    fn add(&mut self, own: &str, scale: [f64; 2]) {
        self.fields.push(Some(self.known.len()));
        self.known.push(own.to_owned());
        self.scales.push(scale);
    }

    fn has(&self, own: &str) -> bool {
        self.known.iter().any(|known| known == own)
    }
}

/// For messages: the beginning of a long text.
pub(crate) fn shortened(text: &str) -> String {
    let text: String = text.chars().map(|c| if c.is_control() { '?' } else { c }).take(121).collect();
    if text.chars().count() <= 120 { text } else { text.chars().take(117).collect::<String>() + "..." }
}
