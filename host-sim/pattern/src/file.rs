//! A pattern file: what is commanded when.
//!
//! CSV with a header; columns by name, in any order, others left alone:
//!
//! | column | unit | meaning |
//! |---|---|---|
//! | `t` | s | from when on the row holds; the first is 0, rising |
//! | `mode` | | `attitude` (inner loops: roll, pitch, yaw, z) or `position` (x, y, z, yaw) |
//! | `roll,pitch,yaw` | rad | commanded attitude; yaw runs on through turns |
//! | `x,y,z` | m | commanded position in the laboratory's frame, north-east-down: a height of 1 m is `-1` |
//! | `inj1..inj4` | command unit | added to the motor commands; may be left out |
//!
//! Fields that a row's mode does not use, and injections, may be empty; they are 0 then.
//!
//! A row holds until the next one begins. The last row is the end: it is held on without an
//! injection.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Columns of a pattern file, in the order they are written.
pub const COLUMNS: [&str; 12] =
    ["t", "mode", "roll", "pitch", "yaw", "x", "y", "z", "inj1", "inj2", "inj3", "inj4"];

/// The first of [`COLUMNS`] that a file must have.
const REQUIRED: usize = 8;
/// Steeper angles are refused as commands, rad.
const STEEPEST_RAD: f64 = 1.05;
/// Larger headings are taken for degrees and refused, rad.
const MOST_YAW_RAD: f64 = 60.0;
/// Positions farther away are refused, m.
const FARTHEST_M: f64 = 1000.0;
/// Times are compared with this margin, so that one computed as `k Ts` meets one written as a
/// decimal, s.
const SAME_TIME_S: f64 = 1e-9;

/// Which loops are closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// Inner loops: roll, pitch, yaw and z are commanded.
    Attitude,
    /// Outer loop too: x, y, z and yaw are commanded.
    #[default]
    Position,
}

/// What holds from a time on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Row {
    /// From when on, s.
    pub t_s: f64,
    /// Which loops are closed.
    pub mode: Mode,
    /// Roll, pitch, yaw, rad.
    pub attitude_rad: [f64; 3],
    /// Inertial north-east-down, m.
    pub position_m: [f64; 3],
    /// Added to the motor commands, command units.
    pub injection: [f64; 4],
}

/// Rows in order of time, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    rows: Vec<Row>,
}

/// Why a pattern was refused.
#[derive(Debug, thiserror::Error)]
pub enum PatternError {
    /// The file cannot be read.
    #[error("{}: cannot read the pattern file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not CSV.
    #[error("{}: {message}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// The parser's message.
        message: String,
    },
    /// A column is missing.
    #[error("{}: row 1: column \"{column}\" is missing; a pattern has {}", path.display(), COLUMNS.join(","))]
    Column {
        /// The file.
        path: PathBuf,
        /// Which.
        column: &'static str,
    },
    /// A field that cannot be right.
    #[error("{}: row {row}: {column} is \"{text}\": {expected}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// The column.
        column: &'static str,
        /// What stands there.
        text: String,
        /// What it may be.
        expected: &'static str,
    },
    /// Fewer rows than a flight has.
    #[error("{}: has {rows} rows; a pattern has at least two, the last of which is its end", path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Rows found.
        rows: usize,
    },
}

impl Mode {
    /// Its word in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Attitude => "attitude",
            Self::Position => "position",
        }
    }

    fn from_name(name: &str) -> Option<Self> {
        [Self::Attitude, Self::Position].into_iter().find(|mode| mode.name() == name)
    }

    /// Whether a row of this mode needs the column.
    fn needs(self, column: &str) -> bool {
        match column {
            "roll" | "pitch" => self == Self::Attitude,
            "x" | "y" => self == Self::Position,
            "yaw" | "z" => true,
            _ => false,
        }
    }
}

impl Pattern {
    /// A pattern from rows; `path` is for messages.
    ///
    /// # Errors
    /// Fewer than two rows, times that do not rise from 0, values that no craft is asked for.
    pub fn new(rows: Vec<Row>, path: &Path) -> Result<Self, PatternError> {
        if rows.len() < 2 {
            return Err(PatternError::TooShort { path: path.into(), rows: rows.len() });
        }
        let mut before_s = None;
        for (k, row) in rows.iter().enumerate() {
            check(row, before_s).map_err(|(column, value, expected)| PatternError::Field {
                path: path.into(),
                row: k + 2,
                column,
                text: value.to_string(),
                expected,
            })?;
            before_s = Some(row.t_s);
        }
        Ok(Self { rows })
    }

    /// Reads and checks a pattern file.
    pub fn read(path: &Path) -> Result<Self, PatternError> {
        let bytes = std::fs::read(path).map_err(|source| PatternError::Read { path: path.into(), source })?;
        Self::parse(&bytes, path)
    }

    /// Parses and checks the bytes of a pattern file; `path` is for messages.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, PatternError> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
        let unreadable =
            |error: csv::Error| PatternError::Csv { path: path.into(), message: one_line(&error) };
        let header = reader.headers().map_err(unreadable)?.clone();
        let mut places = [None; COLUMNS.len()];
        for (k, column) in COLUMNS.iter().enumerate() {
            places[k] = header.iter().position(|name| name.trim_start_matches('\u{feff}') == *column);
            if places[k].is_none() && k < REQUIRED {
                return Err(PatternError::Column { path: path.into(), column });
            }
        }
        let mut rows = Vec::new();
        for (k, record) in reader.records().enumerate() {
            let record = record.map_err(unreadable)?;
            let text = |column: usize| places[column].and_then(|place| record.get(place)).unwrap_or("");
            rows.push(read_row(&text, k + 2, path)?);
        }
        Self::new(rows, path)
    }

    /// The text of the pattern file. Numbers to a millionth: finer than any actuator or tracker.
    pub fn to_csv(&self) -> String {
        let mut text = COLUMNS.join(",");
        text.push('\n');
        for row in &self.rows {
            let _ = write!(text, "{},{}", decimal(row.t_s), row.mode.name());
            for value in row.attitude_rad.iter().chain(&row.position_m).chain(&row.injection) {
                let _ = write!(text, ",{}", decimal(*value));
            }
            text.push('\n');
        }
        text
    }

    /// Rows in order.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Time of the last row, s.
    pub fn duration_s(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.t_s)
    }

    /// What holds at `time_s`.
    pub fn at(&self, time_s: f64) -> Row {
        let begun = self.rows.partition_point(|row| row.t_s <= time_s + SAME_TIME_S);
        let row = self.rows[begun.saturating_sub(1)];
        if begun < self.rows.len() { row } else { Row { injection: [0.0; 4], ..row } }
    }
}

fn one_line(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
            let row = pos.as_ref().map_or(0, |p| p.record() + 1);
            format!("row {row}: has {len} fields, the header has {expected_len}; mend or delete the row")
        }
        _ => error.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).collect(),
    }
}

fn read_row<'a>(text: &impl Fn(usize) -> &'a str, row: usize, path: &Path) -> Result<Row, PatternError> {
    let refuse = |column: usize, expected| PatternError::Field {
        path: path.into(),
        row,
        column: COLUMNS[column],
        text: text(column).to_owned(),
        expected,
    };
    let mode = Mode::from_name(text(1)).ok_or_else(|| refuse(1, "one of attitude, position"))?;
    let number = |column: usize| -> Result<f64, PatternError> {
        let field = text(column);
        if field.is_empty() && column > 0 {
            return match mode.needs(COLUMNS[column]) {
                true => Err(refuse(column, "a number; this mode commands it")),
                false => Ok(0.0),
            };
        }
        field.parse().map_err(|_| refuse(column, "not a number"))
    };
    Ok(Row {
        t_s: number(0)?,
        mode,
        attitude_rad: [number(2)?, number(3)?, number(4)?],
        position_m: [number(5)?, number(6)?, number(7)?],
        injection: [number(8)?, number(9)?, number(10)?, number(11)?],
    })
}

/// The first field that cannot be right: its column, its value, and what it may be.
fn check(row: &Row, before_s: Option<f64>) -> Result<(), (&'static str, f64, &'static str)> {
    match before_s {
        None if row.t_s != 0.0 => return Err(("t", row.t_s, "the first row is at 0 s")),
        Some(before_s) if !(row.t_s > before_s && row.t_s < 1e6) => {
            return Err(("t", row.t_s, "seconds that rise from row to row"));
        }
        _ => {}
    }
    let [roll, pitch, yaw] = row.attitude_rad;
    let [x, y, z] = row.position_m;
    let limits = [
        ("roll", roll, STEEPEST_RAD, "radians up to 1.05 (60 degrees)"),
        ("pitch", pitch, STEEPEST_RAD, "radians up to 1.05 (60 degrees)"),
        ("yaw", yaw, MOST_YAW_RAD, "radians; more than 60 look like degrees"),
        ("x", x, FARTHEST_M, "metres up to 1000"),
        ("y", y, FARTHEST_M, "metres up to 1000"),
        ("z", z, FARTHEST_M, "metres up to 1000"),
    ];
    for (column, value, limit, expected) in limits {
        if !(value.abs() <= limit) {
            return Err((column, value, expected));
        }
    }
    if z > 0.0 {
        return Err(("z", z, "not above 0: z points down, a height of 1 m is -1"));
    }
    for (column, value) in COLUMNS[REQUIRED..].iter().zip(row.injection) {
        if !value.is_finite() {
            return Err((column, value, "a finite number of command units"));
        }
    }
    Ok(())
}

/// To a millionth, without the digits that a computed number brings.
fn decimal(value: f64) -> f64 {
    // Adding zero takes the sign off a negative zero.
    (value * 1e6).round() / 1e6 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<Pattern, PatternError> {
        Pattern::parse(text.as_bytes(), Path::new("p.csv"))
    }

    const SMALL: &str = "t,mode,roll,pitch,yaw,x,y,z,inj1,inj2,inj3,inj4\n\
                         0,position,,,0.5,1,2,-1,10,,,-10\n\
                         0.5,attitude,0.1,-0.1,0,,,-1.5,1,2,3,4\n\
                         2,position,0,0,0,0,0,-1,9,9,9,9\n";

    #[test]
    fn rows_hold_and_the_last_is_the_end() {
        let pattern = parse(SMALL).unwrap();
        assert_eq!(pattern.duration_s(), 2.0);
        let at = |t| pattern.at(t);
        assert_eq!(at(0.0).position_m, [1.0, 2.0, -1.0]);
        assert_eq!((at(0.49).injection, at(0.5).injection), ([10.0, 0.0, 0.0, -10.0], [1.0, 2.0, 3.0, 4.0]));
        assert_eq!((at(1.99).mode, at(2.0).mode), (Mode::Attitude, Mode::Position));
        assert_eq!((at(2.0).injection, at(50.0).position_m), ([0.0; 4], [0.0, 0.0, -1.0]));
        // A tick computed from its number meets the decimal in the file.
        assert_eq!(at(50.0 * 0.01).mode, Mode::Attitude);
    }

    #[test]
    fn columns_are_found_by_name_and_injections_may_be_left_out() {
        let pattern =
            parse("note,z,y,x,yaw,pitch,roll,mode,t\na,-1,0,0,0,0,0,position,0\nb,-2,0,0,0,0,0,position,1\n");
        assert_eq!(pattern.unwrap().at(1.0).position_m[2], -2.0);
    }

    #[test]
    fn what_cannot_be_right_is_refused_by_row_and_field() {
        for (from, to, expected) in [
            ("0.5,attitude", "0,attitude", "row 3: t is"),
            ("0,position", "1,position", "row 2: t is \"1\": the first row is at 0 s"),
            ("attitude,0.1", "attitude,5.7", "row 3: roll is \"5.7\": radians"),
            ("attitude,0.1", "attitude,", "row 3: roll is \"\": a number"),
            ("1,2,-1,10", "1,2,1,10", "row 2: z is \"1\": not above 0"),
            ("1,2,-1,10", "1,2,-1,NaN", "row 2: inj1 is \"NaN\""),
            ("0.5,attitude", "0.5,acro", "row 3: mode is \"acro\": one of"),
            ("inj1", "jni1", ""),
            ("pitch", "patch", "column \"pitch\" is missing"),
            ("-0.1", "minus", "row 3: pitch is \"minus\": not a number"),
            (",9,9,9,9", ",9,9,9", "row 4: has 11 fields, the header has 12"),
        ] {
            assert!(SMALL.contains(from), "{from}");
            let got = parse(&SMALL.replacen(from, to, 1));
            if expected.is_empty() {
                assert!(got.is_ok());
                continue;
            }
            let error = got.unwrap_err().to_string();
            assert!(error.starts_with("p.csv: ") && error.contains(expected), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        assert!(parse("").is_err() && parse(COLUMNS.join(",").as_str()).is_err());
    }

    proptest! {
        /// What is written is read back, to the millionth that is written.
        #[test]
        fn a_file_reads_back(steps in prop::collection::vec((0.01..2.0_f64, -1.0..1.0_f64, -30.0..30.0_f64), 2..20)) {
            let mut t_s = 0.0;
            let rows = steps.iter().enumerate().map(|(k, (step, a, b))| {
                t_s += if k == 0 { 0.0 } else { *step };
                Row {
                    t_s: decimal(t_s),
                    mode: if k % 2 == 0 { Mode::Position } else { Mode::Attitude },
                    attitude_rad: [decimal(*a), decimal(-a), decimal(*b)],
                    position_m: [decimal(*b), decimal(*a), -1.0],
                    injection: [decimal(*b), 0.0, decimal(-b), decimal(*a)],
                }
            });
            let pattern = Pattern::new(rows.collect(), Path::new("p.csv")).unwrap();
            prop_assert_eq!(parse(&pattern.to_csv()).unwrap(), pattern);
        }

        /// Whatever the bytes, there is a pattern or one line.
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            if let Err(error) = Pattern::parse(&bytes, Path::new("p.csv")) {
                prop_assert!(!error.to_string().contains('\n'));
            }
        }
    }
}
