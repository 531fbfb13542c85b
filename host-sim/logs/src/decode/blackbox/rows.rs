//! Rows of the fields that are kept, in columns as narrow as their numbers allow.

use super::header::Header;
use crate::log::{Column, Values};

/// Beginnings of the names of fields that are kept.
const KEPT: [&str; 15] = [
    "gyroADC",
    "gyroData",
    "accSmooth",
    "motor[",
    "eRPM",
    "vbat",
    "setpoint",
    "magADC",
    "BaroAlt",
    "baroAlt",
    "debug",
    "navPos",
    "navVel",
    "attitude",
    "imuQuaternion",
];
/// Rows that are gathered before they go into the columns.
const BLOCK: usize = 256;

/// Rows of a log.
#[derive(Debug)]
pub(super) struct Rows {
    times: Vec<i64>,
    columns: Vec<Column>,
    /// Where in a frame each column stands, and whether it is signed.
    fields: Vec<(usize, bool)>,
    /// Rows that are not in the columns yet, one after the other.
    block: Vec<u32>,
    /// Bytes that may still be filled.
    room: usize,
}

impl Rows {
    /// No rows yet; at most so many bytes of them.
    pub(super) fn new(header: &Header, room: usize) -> Self {
        let mut rows = Self { times: Vec::new(), columns: Vec::new(), fields: Vec::new(), block: Vec::new(), room };
        let Some(whole) = header.fields.get(&b'I') else { return rows };
        for (index, name) in whole.names.iter().enumerate() {
            if KEPT.iter().any(|kept| name.starts_with(kept)) {
                let signed = whole.signed.get(index).is_some_and(|&signed| signed != 0);
                let values = if signed { Values::I16(Vec::new()) } else { Values::U16(Vec::new()) };
                let name = name.chars().filter(|c| !c.is_control()).collect();
                rows.columns.push(Column { name, values });
                rows.fields.push((index, signed));
            }
        }
        rows
    }

    /// Whether there is no room for more.
    pub(super) fn full(&self) -> bool {
        self.room == 0
    }

    /// Appends the kept fields of a frame.
    pub(super) fn push(&mut self, time_us: i64, frame: &[u32]) {
        self.times.push(time_us);
        self.block.extend(self.fields.iter().map(|&(field, _)| frame.get(field).copied().unwrap_or(0)));
        self.room = self.room.saturating_sub(8 + 4 * self.fields.len());
        if self.times.len() % BLOCK == 0 {
            self.flush();
        }
    }

    /// Puts the gathered rows into the columns.
    fn flush(&mut self) {
        let width = self.fields.len();
        for (index, (column, &(_, signed))) in self.columns.iter_mut().zip(&self.fields).enumerate() {
            let block = self.block.iter().skip(index).step_by(width.max(1)).copied();
            widen(&mut column.values, block.clone(), signed);
            match &mut column.values {
                Values::I16(values) => values.extend(block.map(|value| value as i16)),
                Values::U16(values) => values.extend(block.map(|value| value as u16)),
                Values::I32(values) => values.extend(block.map(|value| value as i32)),
                Values::U32(values) => values.extend(block),
                _ => {}
            }
        }
        self.block.clear();
    }

    /// Times and columns.
    pub(super) fn finish(mut self) -> (Vec<i64>, Vec<Column>) {
        self.flush();
        self.times.shrink_to_fit();
        for column in &mut self.columns {
            match &mut column.values {
                Values::I16(values) => values.shrink_to_fit(),
                Values::U16(values) => values.shrink_to_fit(),
                Values::I32(values) => values.shrink_to_fit(),
                Values::U32(values) => values.shrink_to_fit(),
                _ => {}
            }
        }
        if self.times.is_empty() {
            self.columns.clear();
        }
        (self.times, self.columns)
    }
}

/// Makes a column wide enough for some numbers.
fn widen(values: &mut Values, mut block: impl Iterator<Item = u32>, signed: bool) {
    match values {
        Values::I16(narrow) if signed && block.any(|value| i16::try_from(value as i32).is_err()) => {
            *values = Values::I32(narrow.iter().map(|&value| value.into()).collect());
        }
        Values::U16(narrow) if block.any(|value| u16::try_from(value).is_err()) => {
            *values = Values::U32(narrow.iter().map(|&value| value.into()).collect());
        }
        _ => {}
    }
}
