//! Flight files: reading, checking, writing.
//!
//! A flight is a table of samples at nominally 100 Hz. Columns are found by name, in any order; unknown ones are
//! left alone; an empty field is a missing value (NaN in memory). What cannot be right (time going back, degrees
//! for radians, millimetres for metres) is refused with the row, the column and how to mend it.
//!
//! Reading is one of the hot paths (gigabytes of logs): plain numeric files take a scanner of our own, exact to the
//! last bit; files with quotes go through the `csv` crate.

use std::fmt::Write as _;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use model::Vehicle;

use crate::decimal;

/// Columns of a flight file, in the order they are written.
pub const COLUMNS: [&str; 25] = [
    "t", "x", "y", "z", "phi", "theta", "psi", "p", "q", "r", "cmd1", "cmd2", "cmd3", "cmd4", "vbat",
    "omega1", "omega2", "omega3", "omega4", "ax", "ay", "az", "vx", "vy", "vz",
];

/// The first of [`COLUMNS`] that a file must have.
const REQUIRED: usize = 15;

/// A column of a flight file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
#[expect(missing_docs, reason = "the columns are documented in the README")]
pub enum Column {
    T,
    X,
    Y,
    Z,
    Phi,
    Theta,
    Psi,
    P,
    Q,
    R,
    Cmd1,
    Cmd2,
    Cmd3,
    Cmd4,
    Vbat,
    Omega1,
    Omega2,
    Omega3,
    Omega4,
    Ax,
    Ay,
    Az,
    Vx,
    Vy,
    Vz,
}

/// Why a flight file was refused.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// The file cannot be read.
    #[error("{}: cannot read the flight file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The path is a folder.
    #[error("{}: is a folder, not a flight file; name the *.csv files in it", path.display())]
    Folder {
        /// The path.
        path: PathBuf,
    },
    /// Nothing in it.
    #[error("{}: is empty; a flight file starts with a header row such as t,x,y,z,phi,theta,psi,p,q,r,cmd1,...", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Another kind of file.
    #[error("{}: row 1: is {what}, not a flight file (CSV): {mend}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is.
        what: &'static str,
        /// How to make a flight file of it.
        mend: &'static str,
    },
    /// A required column is missing, or one is there twice.
    #[error("{}: row 1: column \"{column}\" {problem}; the header has {found}", path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What is wrong with it.
        problem: &'static str,
        /// The header as read.
        found: String,
    },
    /// A field that is not a number.
    #[error("{}: row {row}: column \"{column}\" has \"{text}\", which is not a number; leave the field empty if the value is missing", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// The column.
        column: String,
        /// What stands there.
        text: String,
    },
    /// A row with too few or too many fields.
    #[error("{}: row {row}: has {found} fields, the header has {expected}; mend or delete the row", path.display())]
    FieldCount {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// Fields found.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// Time that does not rise.
    #[error("{}: row {row}: time goes from {before} s to {after} s; times must rise (sort the rows, delete repeated ones)", path.display())]
    Time {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// Time of the row before.
        before: f64,
        /// Time of this row.
        after: f64,
    },
    /// Too few samples to use.
    #[error("{}: has {rows} samples over {duration_s:.2} s; at least {needed_s} s without gaps are needed", path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Samples.
        rows: usize,
        /// First to last time, s.
        duration_s: f64,
        /// What is needed, s.
        needed_s: f64,
    },
    /// A required column without a single value.
    #[error("{}: column \"{column}\" has no values", path.display())]
    NoValues {
        /// The file.
        path: PathBuf,
        /// The column.
        column: &'static str,
    },
    /// A column that is not in its unit.
    #[error("{}: column \"{column}\" {observed}: {advice}", path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What was seen.
        observed: String,
        /// What it looks like and what to do.
        advice: &'static str,
    },
}

/// A flight as recorded: one vector a column, NaN where a value is missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flight {
    /// File name, for people and for records.
    pub name: String,
    columns: [Option<Vec<f64>>; COLUMNS.len()],
}

impl Flight {
    /// A flight from columns, for programs that record one.
    ///
    /// # Panics
    /// When the columns differ in length or a required one is missing: a mistake in the program.
    pub fn from_columns(
        name: impl Into<String>,
        columns: impl IntoIterator<Item = (Column, Vec<f64>)>,
    ) -> Self {
        let mut flight = Self { name: name.into(), ..Self::default() };
        for (column, values) in columns {
            flight.columns[column as usize] = Some(values);
        }
        let rows = flight.len();
        assert!(flight.columns.iter().flatten().all(|c| c.len() == rows), "columns differ in length");
        assert!(flight.columns[..REQUIRED].iter().all(Option::is_some), "a required column is missing");
        flight
    }

    /// Reads and checks a flight file.
    ///
    /// A block at a time, so that the text is parsed while it is in the cache and a long log costs the memory of its
    /// numbers only.
    pub fn read(path: &Path) -> Result<Self, FlightError> {
        if path.is_dir() {
            return Err(FlightError::Folder { path: path.into() });
        }
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
            // Whole rows only, unless nothing follows. Quotes need the whole file at once.
            let end = if last { Some(filled) } else { memchr::memrchr(b'\n', text).map(|n| n + 1) };
            let (Some(end), false) = (end, memchr::memchr(b'"', text).is_some()) else {
                return Self::parse(&std::fs::read(path).map_err(unreadable)?, path);
            };
            match &mut reader {
                Some(reader) => reader.rows(&block[..end], path)?,
                None => reader = Some(PlainReader::new(&block[..end], size, path)?),
            }
            if last {
                break;
            }
            block.copy_within(end..filled, 0);
            kept = filled - end;
        }
        match reader {
            Some(reader) => reader.finish(path),
            None => Err(FlightError::Empty { path: path.into() }),
        }
    }

    /// Parses the bytes of a flight file; `path` is for messages and gives the name.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, FlightError> {
        if memchr::memchr(b'"', bytes).is_none() {
            return PlainReader::new(bytes, bytes.len(), path)?.finish(path);
        }
        let bytes = without_mark(bytes, path)?;
        let header_end = memchr::memchr(b'\n', bytes).unwrap_or(bytes.len());
        let header = read_header(&bytes[..header_end], path)?;
        let table = read_quoted(bytes, &header, path)?;
        Self::from_table(&header, table, path)
    }

    fn from_table(header: &Header, table: Vec<Vec<f64>>, path: &Path) -> Result<Self, FlightError> {
        let mut flight = Self {
            name: path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into()),
            ..Self::default()
        };
        for (column, values) in header.known.iter().zip(table) {
            flight.columns[*column] = Some(values);
        }
        flight.check(path)?;
        Ok(flight)
    }

    /// Samples.
    pub fn len(&self) -> usize {
        self.columns[0].as_ref().map_or(0, Vec::len)
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A column, if the log has it.
    pub fn column(&self, column: Column) -> Option<&[f64]> {
        self.columns[column as usize].as_deref()
    }

    /// Puts other values into a column.
    pub fn replace(&mut self, column: Column, values: Vec<f64>) {
        debug_assert_eq!(values.len(), self.len(), "columns differ in length");
        self.columns[column as usize] = Some(values);
    }

    /// A column that every flight has.
    pub fn required(&self, column: Column) -> &[f64] {
        self.column(column).unwrap_or(&[])
    }

    /// Three columns, if the log has all of them with values.
    pub fn group<const N: usize>(&self, columns: [Column; N]) -> Option<[&[f64]; N]> {
        let mut found = [[].as_slice(); N];
        for (slot, column) in found.iter_mut().zip(columns) {
            *slot = self.column(column).filter(|values| values.iter().any(|v| v.is_finite()))?;
        }
        Some(found)
    }

    /// The text of the flight file. Values are written with the shortest digits that read back to the same bits.
    pub fn to_csv(&self) -> String {
        let present: Vec<usize> = (0..COLUMNS.len()).filter(|&c| self.columns[c].is_some()).collect();
        let mut text = present.iter().map(|&c| COLUMNS[c]).collect::<Vec<_>>().join(",");
        text.push('\n');
        for row in 0..self.len() {
            for (k, &c) in present.iter().enumerate() {
                if k > 0 {
                    text.push(',');
                }
                let value = self.columns[c].as_ref().map_or(f64::NAN, |values| values[row]);
                if value.is_finite() {
                    let _ = write!(text, "{value}");
                }
            }
            text.push('\n');
        }
        text
    }

    /// What cannot be right whatever the vehicle.
    fn check(&self, path: &Path) -> Result<(), FlightError> {
        let t = self.required(Column::T);
        if let Some(row) = t.iter().position(|t| !t.is_finite()) {
            let (row, column, text) = (row + 2, "t".to_owned(), String::new());
            return Err(FlightError::Field { path: path.into(), row, column, text });
        }
        if let Some(k) = t.windows(2).position(|w| w[1] <= w[0]) {
            let (before, after) = (t[k], t[k + 1]);
            return Err(FlightError::Time { path: path.into(), row: k + 3, before, after });
        }
        if t.len() < 2 {
            let (rows, duration_s, needed_s) = (t.len(), 0.0, 2.0);
            return Err(FlightError::TooShort { path: path.into(), rows, duration_s, needed_s });
        }
        for (index, column) in COLUMNS[..REQUIRED].iter().enumerate() {
            if self.columns[index].as_ref().is_some_and(|c| c.iter().all(|v| v.is_nan())) {
                return Err(FlightError::NoValues { path: path.into(), column });
            }
        }
        self.check_units(path)
    }

    fn check_units(&self, path: &Path) -> Result<(), FlightError> {
        let refuse = |column: &str, observed: String, advice| {
            Err(FlightError::Unit { path: path.into(), column: column.into(), observed, advice })
        };
        let t = self.required(Column::T);
        let period = median_step(t);
        if !(0.0005..0.2).contains(&period) {
            let advice = "seconds are expected at 5 to 2000 samples a second; divide milliseconds by 1000";
            return refuse("t", format!("steps by {period}"), advice);
        }
        let largest = |column: Column| {
            self.required(column).iter().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()))
        };
        for column in [Column::Phi, Column::Theta] {
            let peak = largest(column);
            if peak > 3.3 {
                let advice = "radians are expected; these look like degrees: multiply by pi/180";
                return refuse(COLUMNS[column as usize], format!("reaches {peak}"), advice);
            }
        }
        for column in [Column::X, Column::Y, Column::Z] {
            let (low, high) = finite_range(self.required(column));
            if high - low > 500.0 {
                let advice = "metres are expected; these look like millimetres: divide by 1000";
                return refuse(COLUMNS[column as usize], format!("ranges over {}", high - low), advice);
            }
        }
        for (rate, angle) in [(Column::P, Column::Phi), (Column::Q, Column::Theta)] {
            let factor = rate_factor(t, self.required(angle), self.required(rate));
            if factor.is_some_and(|f| f > 20.0) {
                let advice = "radians per second are expected; these look like degrees per second";
                let observed = format!("is {:.0} times the rate of the attitude", factor.unwrap_or(0.0));
                return refuse(COLUMNS[rate as usize], observed, advice);
            }
        }
        let volts = largest(Column::Vbat);
        if volts > 200.0 {
            let advice = "volts are expected; divide millivolts by 1000";
            return refuse("vbat", format!("reaches {volts}"), advice);
        }
        Ok(())
    }

    /// What cannot be right for this vehicle: commands in another unit.
    pub fn check_against(&self, vehicle: &Vehicle, path: &Path) -> Result<(), FlightError> {
        let [low, high] = vehicle.motors.command_range;
        let margin = 0.25 * (high - low);
        for column in [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4] {
            let mut sorted: Vec<f64> =
                self.required(column).iter().copied().filter(|v| v.is_finite()).collect();
            sorted.sort_by(f64::total_cmp);
            let Some(&median) = sorted.get(sorted.len() / 2) else { continue };
            if !(low - margin..=high + margin).contains(&median) {
                return Err(FlightError::Unit {
                    path: path.into(),
                    column: COLUMNS[column as usize].into(),
                    observed: format!(
                        "has the median {median}, the vehicle \"{}\" takes {low} to {high} {}",
                        vehicle.name, vehicle.motors.command_unit
                    ),
                    advice: "use the vehicle file that belongs to the flight, or convert the commands to its unit",
                });
            }
        }
        Ok(())
    }
}

/// Median sampling period, s.
pub fn median_step(t: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return f64::NAN;
    }
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn finite_range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)))
}

/// How much larger a logged rate is than the rate of change of the angle; nothing when the craft hardly turned.
fn rate_factor(t: &[f64], angle: &[f64], rate: &[f64]) -> Option<f64> {
    const SPAN: usize = 10;
    let (mut logged, mut differenced) = (0.0, 0.0);
    for k in (0..t.len().saturating_sub(SPAN)).step_by(SPAN) {
        let turn = (angle[k + SPAN] - angle[k]) / (t[k + SPAN] - t[k]);
        let mean = rate[k..k + SPAN].iter().sum::<f64>() / SPAN as f64;
        if turn.is_finite() && mean.is_finite() && turn.abs() < 20.0 {
            logged += mean * turn;
            differenced += turn * turn;
        }
    }
    (differenced > 1e-3).then(|| logged / differenced)
}

struct Header {
    /// For each field of a row: the place of its column in `known`, nothing for an unknown column.
    fields: Vec<Option<usize>>,
    /// Known columns that the file has, in file order.
    known: Vec<usize>,
}

fn read_header(line: &[u8], path: &Path) -> Result<Header, FlightError> {
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

fn shortened(text: &str) -> String {
    if text.chars().count() <= 120 { text.into() } else { text.chars().take(117).collect::<String>() + "..." }
}

/// Bytes read at once.
const BLOCK_BYTES: usize = 256 * 1024;

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

/// How other log files begin, what they are, and how flight files are made of them.
const FOREIGN: [(&[u8], &str, &str); 7] = [
    (
        b"ULog\x01\x12\x35",
        "a PX4 ULog",
        "export its topics with ulog2csv and join vehicle_local_position, vehicle_attitude, vehicle_angular_velocity, \
         actuator_outputs and battery_status into the columns t, x, y, z, phi, ...",
    ),
    (
        b"\xbc",
        "a Crazyflie SD-card log",
        "decode it with the firmware's cfusdlog.py and write its variables into the columns t, x, y, z, phi, ... (north-east-down, radians)",
    ),
    (
        b"\xa3\x95",
        "an ArduPilot DataFlash log",
        "export it with mavlogdump.py --format csv and join its messages into the columns t, x, y, z, phi, ...",
    ),
    (
        b"H Product:Blackbox",
        "a Betaflight blackbox log",
        "decode it with blackbox_decode and write its fields into the columns t, x, y, z, phi, ...",
    ),
    (b"PK\x03\x04", "a zip archive or spreadsheet", "unpack it, or save the sheet as CSV with commas"),
    (b"\x1f\x8b", "a gzip archive", "unpack it with gunzip"),
    (b"PAR1", "a Parquet file", "write its columns as CSV"),
];

/// What a file is that is no text, by how it begins.
fn foreign(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let known = FOREIGN.iter().find(|(magic, _, _)| bytes.starts_with(magic));
    // Text has no control characters in its first line but tabs and ends of lines.
    let first = &bytes[..bytes.len().min(512)];
    let binary = first.iter().any(|b| *b < b' ' && !b.is_ascii_whitespace());
    known.map(|(_, what, mend)| (*what, *mend)).or_else(|| {
        binary.then_some((
            "a binary file",
            "write its values as text with a header row such as t,x,y,z,phi,theta,psi,p,q,r,cmd1,...",
        ))
    })
}

/// Reads files without quotes, whole rows at a time.
struct PlainReader {
    header: Header,
    table: Vec<Vec<f64>>,
    row: usize,
}

impl PlainReader {
    /// Starts with the first rows of a file of `size` bytes.
    fn new(first: &[u8], size: usize, path: &Path) -> Result<Self, FlightError> {
        let bytes = without_mark(first, path)?;
        let header_end = memchr::memchr(b'\n', bytes).unwrap_or(bytes.len());
        let header = read_header(&bytes[..header_end], path)?;
        let body = &bytes[(header_end + 1).min(bytes.len())..];
        // A guess of the row count from the first row saves growing the vectors.
        let row_bytes = memchr::memchr(b'\n', body).unwrap_or(body.len()).max(1);
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

    fn finish(self, path: &Path) -> Result<Flight, FlightError> {
        Flight::from_table(&self.header, self.table, path)
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
        let fields: Vec<&str> = text.trim_end().split(',').collect();
        if fields.len() != header.fields.len() {
            let (found, expected) = (fields.len(), header.fields.len());
            return FlightError::FieldCount { path: path.into(), row, found, expected };
        }
        let column = header.fields[self.column].map_or("?", |k| COLUMNS[header.known[k]]).to_owned();
        FlightError::Field { path: path.into(), row, column, text: shortened(fields[self.column].trim()) }
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
                    let column = COLUMNS[header.known[k]].to_owned();
                    let text = shortened(&String::from_utf8_lossy(field));
                    return Err(FlightError::Field { path: path.into(), row, column, text });
                }
            }
        }
    }
    Ok(table)
}
