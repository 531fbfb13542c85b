//! A log as its program wrote it: tables with the format's own names, numbers and times.

use std::collections::BTreeMap;

use proto::Telemetry;

use crate::format::Format;

/// A decoded log: what it holds, under the names that its format gives, in its own units and frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// Which format.
    pub format: Format,
    /// The program and version that flew, as the log says it.
    pub firmware: Option<String>,
    /// One table a kind of message and instance.
    pub tables: Vec<Table>,
    /// Parameters of the craft, by name, when the log began.
    pub parameters: BTreeMap<String, f64>,
    /// Parameters that were set afterwards, in the order of the log.
    pub changes: Vec<ParameterChange>,
    /// What else the log says about itself, by the name that the format gives.
    pub information: BTreeMap<String, String>,
    /// What is missing or could not be read.
    pub losses: Losses,
    /// What quadlab's own ground station heard of its craft; empty in logs of other programs.
    pub telemetry: Vec<Telemetry>,
}

/// Rows of one kind of message.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// The format's own name: `vehicle_attitude[0]`, `ATT`, `log 1`, `fixedFrequency`, `/cf/pose`.
    pub name: String,
    /// The type of the messages where it is not the name: `geometry_msgs/msg/PoseStamped`.
    pub message_type: Option<String>,
    /// Unit of `times`.
    pub time_unit: TimeUnit,
    /// The time of each row in the order of the file, which may go back; empty where rows have no time.
    pub times: Vec<i64>,
    /// Rows; those of `times` where rows have times.
    pub rows: usize,
    /// One column a field, each as long as there are rows.
    pub columns: Vec<Column>,
}

/// A field of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The format's own name, elements of an array counted: `q[0]`.
    pub name: String,
    /// A value a row, not scaled but where the format itself defines the scale (DataFlash's hundredths).
    pub values: Values,
}

/// Values in the width the log has them in, so that a log takes about its own size in memory.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "named like the type they hold")]
pub enum Values {
    I8(Vec<i8>),
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    I64(Vec<i64>),
    U64(Vec<u64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// A parameter that was set while the log was written.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterChange {
    /// When, on the log's clock, s; minus infinity before the first row.
    pub time_s: f64,
    /// Which.
    pub name: String,
    /// What it is from then on.
    pub value: f64,
}

/// The unit that a table's times are in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the units say it")]
pub enum TimeUnit {
    Nanoseconds,
    Microseconds,
    Milliseconds,
}

/// What is missing of a log or could not be read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Losses {
    /// Times at which the craft could not write fast enough.
    pub dropouts: usize,
    /// What they lost in all, s.
    pub dropouts_s: f64,
    /// When: first and last moment of each on the log's clock, s.
    pub dropout_spans_s: Vec<[f64; 2]>,
    /// Damage, a sentence each: where, what was left out. No more than a handful; the rest is counted.
    pub damage: Vec<String>,
}

impl Log {
    /// A log without anything in it yet.
    pub fn new(format: Format) -> Self {
        Self {
            format,
            firmware: None,
            tables: Vec::new(),
            parameters: BTreeMap::new(),
            changes: Vec::new(),
            information: BTreeMap::new(),
            losses: Losses::default(),
            telemetry: Vec::new(),
        }
    }

    /// A table by its name.
    pub fn table(&self, name: &str) -> Option<&Table> {
        self.tables.iter().find(|table| table.name == name)
    }
}

impl Table {
    /// Times in seconds on the log's clock, in the order of the file.
    pub fn times_s(&self) -> Vec<f64> {
        let unit_s = self.time_unit.seconds();
        self.times.iter().map(|&ticks| ticks as f64 * unit_s).collect()
    }

    /// A column's values, by name.
    pub fn column(&self, name: &str) -> Option<&Values> {
        self.columns.iter().find(|column| column.name == name).map(|column| &column.values)
    }

    /// Columns as floating-point numbers, if all of them are there.
    pub fn group<const N: usize>(&self, names: [&str; N]) -> Option<[Vec<f64>; N]> {
        let mut found = [const { Vec::new() }; N];
        for (slot, name) in found.iter_mut().zip(names) {
            *slot = self.column(name)?.to_f64();
        }
        Some(found)
    }
}

impl TimeUnit {
    /// Seconds in a unit.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Nanoseconds => 1e-9,
            Self::Microseconds => 1e-6,
            Self::Milliseconds => 1e-3,
        }
    }
}

/// The same expression for every width.
macro_rules! each_width {
    ($values:expr, $inner:ident => $what:expr) => {
        match $values {
            Values::I8($inner) => $what,
            Values::U8($inner) => $what,
            Values::I16($inner) => $what,
            Values::U16($inner) => $what,
            Values::I32($inner) => $what,
            Values::U32($inner) => $what,
            Values::I64($inner) => $what,
            Values::U64($inner) => $what,
            Values::F32($inner) => $what,
            Values::F64($inner) => $what,
        }
    };
}

impl Values {
    /// How many.
    pub fn len(&self) -> usize {
        each_width!(self, values => values.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// As floating-point numbers.
    #[expect(clippy::unnecessary_cast, reason = "the same for every width, f64 among them")]
    pub fn to_f64(&self) -> Vec<f64> {
        each_width!(self, values => values.iter().map(|&value| value as f64).collect())
    }
}
