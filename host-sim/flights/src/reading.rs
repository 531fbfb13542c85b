//! Reading flight files.
//!
//! One of the hot paths (gigabytes of logs): plain numeric files take a scanner of our own, exact
//! to the last bit; files with quotes go through the `csv` crate.

use std::io::Read as _;
use std::path::Path;

use crate::column_map::ColumnMap;
use crate::columns::{COLUMNS, Column};
use crate::decimal;
use crate::error::FlightError;
use crate::flight::Flight;
use crate::foreign::foreign;
use crate::header::{Header, TOO_MANY, names_in, read_header, shortened};
use crate::names::{bare, is_other_name, unit_of_further};
use model::{frames, user_effects};

/// Bytes read at once.
const BLOCK_BYTES: usize = 256 * 1024;

impl Flight {
    /// Reads and checks a flight file, with the map of columns beside it.
    ///
    /// A block at a time, so that the text is parsed while it is in the cache and a long log costs
    /// the memory of its numbers only.
    pub fn read(path: &Path) -> Result<Self, FlightError> {
        if path.is_dir() {
            return Err(FlightError::Folder { path: path.into() });
        }
        let map = ColumnMap::beside(path)?;
        let unreadable = |source| FlightError::Read { path: path.into(), source };
        let mut file = std::fs::File::open(path).map_err(unreadable)?;
        let size = file.metadata().map_or(0, |m| m.len() as usize);
        let mut reader: Option<PlainReader> = None;
        let mut block = vec![0; BLOCK_BYTES];
        let mut kept = 0;
        loop {
            let read = file.read(&mut block[kept..]).map_err(unreadable)?;
            let filled = kept + read;
            let text = &block[..filled];
            let last = read == 0;
            // Whole rows only, unless nothing follows. Quotes and other separators need the whole file at once.
            let end = if last { Some(filled) } else { memchr::memrchr(b'\n', text).map(|n| n + 1) };
            let is_odd =
                memchr::memchr(b'"', text).is_some() || (reader.is_none() && other_separator(text).is_some());
            let (Some(end), false) = (end, is_odd) else {
                return Self::parse_with(&std::fs::read(path).map_err(unreadable)?, path, &map);
            };
            match &mut reader {
                Some(reader) => reader.rows(&block[..end], path)?,
                None => reader = Some(PlainReader::new(&block[..end], size, path, &map)?),
            }
            if last {
                break;
            }
            block.copy_within(end..filled, 0);
            kept = filled - end;
        }
        match reader {
            Some(reader) => reader.finish(path, &map),
            None => Err(FlightError::Empty { path: path.into() }),
        }
    }

    /// Parses the bytes of a flight file; `path` is for messages and gives the name.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, FlightError> {
        Self::parse_with(bytes, path, &ColumnMap::default())
    }

    /// Parses the bytes of a flight file whose columns are mapped.
    pub fn parse_with(bytes: &[u8], path: &Path, map: &ColumnMap) -> Result<Self, FlightError> {
        if let Some(separator) = other_separator(bytes) {
            return Self::parse_with(&with_commas(bytes, separator), path, map);
        }
        if memchr::memchr(b'"', bytes).is_none() {
            return PlainReader::new(bytes, bytes.len(), path, map)?.finish(path, map);
        }
        let bytes = without_mark(bytes, path)?;
        let header_end = memchr::memchr(b'\n', bytes).unwrap_or(bytes.len());
        let header = read_header(&names_in(&bytes[..header_end]), path, map)?;
        let table = read_quoted(bytes, &header, path)?;
        Self::from_table(&header, table, path, map)
    }

    /// Parses the bytes of a flight file with all further columns of numbers that formulas could name.
    pub fn parse_whole(bytes: &[u8], path: &Path, map: &ColumnMap) -> Result<Self, FlightError> {
        if let Some(separator) = other_separator(bytes) {
            return Self::parse_whole(&with_commas(bytes, separator), path, map);
        }
        let (names, columns) = text_columns(without_mark(bytes, path)?);
        let is_numeric =
            |index: usize| columns.get(index).is_some_and(|values| values.iter().any(|v| v.is_finite()));
        let further = further_of(&names, map, is_numeric);
        Self::parse_with(bytes, path, &map.with_further(further))
    }

    /// A flight from a table of another program: names and values of its columns.
    pub fn from_named(
        columns: Vec<(String, Vec<f64>)>,
        path: &Path,
        map: &ColumnMap,
    ) -> Result<Self, FlightError> {
        let (names, values): (Vec<String>, Vec<Vec<f64>>) = columns.into_iter().unzip();
        let further = further_of(&names, map, |index| values[index].iter().any(|v| v.is_finite()));
        let map = map.with_further(further);
        let header = read_header(&names, path, &map)?;
        let known =
            values.into_iter().zip(&header.fields).filter_map(|(values, field)| Some((values, (*field)?)));
        let table = known.map(|(values, _)| values).collect();
        Self::from_table(&header, table, path, &map)
    }

    fn from_table(
        header: &Header,
        table: Vec<Vec<f64>>,
        path: &Path,
        map: &ColumnMap,
    ) -> Result<Self, FlightError> {
        let mut flight = Self {
            name: path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into()),
            ..Self::default()
        };
        for ((column, scale), mut values) in header.known.iter().zip(&header.scales).zip(table) {
            let [factor, offset] = *scale;
            if *scale != [1.0, 0.0] {
                values.iter_mut().for_each(|value| *value = *value * factor + offset);
            }
            match COLUMNS.iter().position(|own| own == column) {
                Some(column) => flight.columns[column] = Some(values),
                None => drop(flight.further.insert(column.clone(), values)),
            }
        }
        wrap_turned_angles(&mut flight, header);
        map.apply(&mut flight);
        flight.check_times(path)?;
        flight.complete(path)?;
        flight.check_units(path)?;
        Ok(flight)
    }
}

/// Brings angles to which something was added back to -pi to pi.
fn wrap_turned_angles(flight: &mut Flight, header: &Header) {
    for column in [Column::Phi, Column::Psi] {
        let is_it = |(own, scale): &(&String, &[f64; 2])| *own == COLUMNS[column as usize] && scale[1] != 0.0;
        if let (true, Some(values)) =
            (header.known.iter().zip(&header.scales).any(|c| is_it(&c)), &mut flight.columns[column as usize])
        {
            values.iter_mut().for_each(|angle| *angle = frames::within_half_turn(*angle));
        }
    }
}

/// Names in the header of a text, whatever its separator.
pub fn header_names(bytes: &[u8]) -> Vec<String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let line = &bytes[..memchr::memchr(b'\n', bytes).unwrap_or(bytes.len())];
    match other_separator(line) {
        Some(separator) => names_in(&with_commas(line, separator)),
        None => names_in(line),
    }
}

/// Names and values of the columns of a text that hold nothing but numbers and missing values; the values of others are empty.
pub fn text_columns(bytes: &[u8]) -> (Vec<String>, Vec<Vec<f64>>) {
    if let Some(separator) = other_separator(bytes) {
        return text_columns(&with_commas(bytes, separator));
    }
    let names = header_names(bytes);
    if names.len() >= TOO_MANY {
        return (names, Vec::new());
    }
    let mut columns: Vec<Option<Vec<f64>>> = vec![Some(Vec::new()); names.len()];
    let mut reader = csv::ReaderBuilder::new().has_headers(true).flexible(true).from_reader(bytes);
    for record in reader.byte_records().map_while(Result::ok) {
        for (field, column) in record.iter().zip(&mut columns) {
            let read =
                decimal::read(field.trim_ascii(), 0).filter(|(_, end)| *end == field.trim_ascii().len());
            match (read, &mut *column) {
                (Some((value, _)), Some(values)) => values.push(value),
                _ => *column = None,
            }
        }
    }
    (names, columns.into_iter().map(Option::unwrap_or_default).collect())
}

/// The further columns of a table that formulas could name, each name once.
fn further_of(names: &[String], map: &ColumnMap, is_numeric: impl Fn(usize) -> bool) -> Vec<String> {
    let mut further: Vec<String> = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let own = bare(name);
        let is_free = user_effects::can_be_column(own) && !COLUMNS.contains(&own) && !is_other_name(own);
        let is_read = map.names(name) || unit_of_further(name).is_none() || map.sources.contains_key(own);
        if is_free && !is_read && is_numeric(index) && !further.iter().any(|there| there == own) {
            further.push(own.to_owned());
        }
    }
    // A second column of the same name in another unit is not told apart from the first.
    further.retain(|own| names.iter().filter(|name| bare(name) == own).count() == 1);
    further
}

/// The separator of a header row without commas.
fn other_separator(bytes: &[u8]) -> Option<u8> {
    let header = &bytes[..memchr::memchr(b'\n', bytes).unwrap_or(bytes.len())];
    let has = |byte| memchr::memchr(byte, header).is_some();
    if has(b',') { None } else { [b';', b'\t'].into_iter().find(|separator| has(*separator)) }
}

/// The text with commas between its fields and points in its numbers.
fn with_commas(bytes: &[u8], separator: u8) -> Vec<u8> {
    let turned = |byte: &u8| match *byte {
        b',' => b'.',
        byte if byte == separator => b',',
        byte => byte,
    };
    bytes.iter().map(turned).collect()
}

/// The text without a byte order mark; blank text is refused.
fn without_mark<'a>(bytes: &'a [u8], path: &Path) -> Result<&'a [u8], FlightError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(FlightError::Empty { path: path.into() });
    }
    match foreign(bytes) {
        Some((what, mend)) => Err(FlightError::Foreign { path: path.into(), what, mend }),
        None => Ok(bytes),
    }
}

/// Reads files without quotes, whole rows at a time.
struct PlainReader {
    header: Header,
    table: Vec<Vec<f64>>,
    row: usize,
}

impl PlainReader {
    /// Starts with the first rows of a file of `size` bytes.
    fn new(first: &[u8], size: usize, path: &Path, map: &ColumnMap) -> Result<Self, FlightError> {
        let bytes = without_mark(first, path)?;
        let header_end = memchr::memchr(b'\n', bytes).unwrap_or(bytes.len());
        let header = read_header(&names_in(&bytes[..header_end]), path, map)?;
        let body = &bytes[(header_end + 1).min(bytes.len())..];
        // A guess of the row count from the first row saves growing the vectors. That may be blank: a field has a digit or more.
        let row_bytes = memchr::memchr(b'\n', body).unwrap_or(body.len()).max(2 * header.fields.len());
        let table = header.known.iter().map(|_| Vec::with_capacity(size / row_bytes + 1)).collect();
        let mut reader = Self { header, table, row: 1 };
        reader.rows(body, path)?;
        Ok(reader)
    }

    fn rows(&mut self, body: &[u8], path: &Path) -> Result<(), FlightError> {
        let mut at = 0;
        while at < body.len() {
            self.row += 1;
            let start = at;
            if let Some(fault) = read_row(body, &mut at, &self.header, &mut self.table) {
                let line =
                    &body[start..memchr::memchr(b'\n', &body[start..]).map_or(body.len(), |n| start + n)];
                if !(line.trim_ascii().is_empty() && fault.column == 0) {
                    return Err(fault.into_error(line, self.row, &self.header, path));
                }
                // A blank line, most often the last: no sample.
                at = start + line.len() + 1;
                for values in &mut self.table[..fault.filled] {
                    values.pop();
                }
            }
        }
        Ok(())
    }

    fn finish(self, path: &Path, map: &ColumnMap) -> Result<Flight, FlightError> {
        Flight::from_table(&self.header, self.table, path, map)
    }
}

/// Where and how a row went wrong.
struct RowFault {
    column: usize,
    filled: usize,
}

impl RowFault {
    fn into_error(self, line: &[u8], row: usize, header: &Header, path: &Path) -> FlightError {
        let text = String::from_utf8_lossy(line);
        let fields = || text.trim_end().split(',');
        let (found, expected) = (fields().count(), header.fields.len());
        if found != expected {
            return FlightError::FieldCount { path: path.into(), row, found, expected };
        }
        let column = header.fields[self.column].map_or("?", |k| header.known[k].as_str()).to_owned();
        FlightError::Field {
            path: path.into(),
            row,
            column,
            text: shortened(fields().nth(self.column).unwrap_or_default().trim()),
        }
    }
}

/// Reads one row from `at`, which moves to the next. A fault leaves the row partly pushed.
#[inline]
fn read_row(body: &[u8], at: &mut usize, header: &Header, table: &mut [Vec<f64>]) -> Option<RowFault> {
    let last = header.fields.len() - 1;
    let mut position = *at;
    let mut filled = 0;
    for (column, &slot) in header.fields.iter().enumerate() {
        match slot {
            Some(k) => match decimal::read(body, position) {
                Some((value, next)) => {
                    table[k].push(value);
                    filled = k + 1;
                    position = next;
                }
                None => return Some(RowFault { column, filled }),
            },
            None => {
                position += memchr::memchr2(b',', b'\n', &body[position..]).unwrap_or(body.len() - position);
                if column == last && position > 0 && body[position - 1] == b'\r' {
                    position -= 1;
                }
            }
        }
        if column < last {
            if body.get(position) != Some(&b',') {
                return Some(RowFault { column, filled });
            }
            position += 1;
        }
    }
    if body.get(position) == Some(&b'\r') {
        position += 1;
    }
    match body.get(position) {
        None => *at = position,
        Some(b'\n') => *at = position + 1,
        Some(_) => return Some(RowFault { column: last, filled }),
    }
    None
}

/// The way of files with quotes: slower, by the csv crate.
fn read_quoted(bytes: &[u8], header: &Header, path: &Path) -> Result<Vec<Vec<f64>>, FlightError> {
    let mut table: Vec<Vec<f64>> = header.known.iter().map(|_| Vec::new()).collect();
    let mut reader = csv::ReaderBuilder::new().has_headers(true).flexible(true).from_reader(bytes);
    for (index, record) in reader.byte_records().enumerate() {
        let row = index + 2;
        let record = record.map_err(|error| FlightError::Read { path: path.into(), source: error.into() })?;
        if record.len() != header.fields.len() {
            let (found, expected) = (record.len(), header.fields.len());
            return Err(FlightError::FieldCount { path: path.into(), row, found, expected });
        }
        for (field, slot) in record.iter().zip(&header.fields) {
            let Some(k) = *slot else { continue };
            match decimal::read(field, 0) {
                Some((value, end)) if end == field.len() => table[k].push(value),
                _ => {
                    let column = header.known[k].clone();
                    let text = shortened(&String::from_utf8_lossy(field));
                    return Err(FlightError::Field { path: path.into(), row, column, text });
                }
            }
        }
    }
    Ok(table)
}
