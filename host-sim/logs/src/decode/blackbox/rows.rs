//! Rows of the fields that are kept, in columns as narrow as their numbers allow.

use super::definitions::Places;
use super::header::{Header, MOST_FIELDS};
use super::kept::is_kept;
use super::prediction::{Frame, NOTHING};
use crate::log::{Column, Values};

/// Rows that are gathered before they go into the columns.
const BLOCK: usize = 64;
/// Columns may take as many bytes for each byte of a log; real ones take about one.
const MOST_BYTES_PER_BYTE: usize = 8;

/// Rows of a log.
#[derive(Debug)]
pub(super) struct Rows {
    times: Vec<i64>,
    columns: Vec<Column>,
    /// Where in a frame each column stands, and whether it is signed.
    fields: Vec<(usize, bool)>,
    /// The two frames before those that are not in the columns yet, then those.
    block: Box<[Frame; 2 + BLOCK]>,
    /// How many are not in the columns yet.
    waiting: usize,
    /// Bytes of the log.
    length: usize,
    /// Bytes that may still be filled.
    room: usize,
}

impl Rows {
    /// No rows yet; their memory is bounded by the bytes of the log.
    pub(super) fn new(header: &Header, places: &Places, length: usize) -> Self {
        let (mut columns, mut fields) = (Vec::new(), Vec::new());
        let whole = header.fields.get(&b'I').cloned().unwrap_or_default();
        for (index, name) in whole.names.iter().enumerate() {
            if let Some(place) = places.of(index).filter(|_| is_kept(name)) {
                let signed = whole.signed.get(index).is_some_and(|&signed| signed != 0);
                let values = if signed { Values::I16(Vec::new()) } else { Values::U16(Vec::new()) };
                columns.push(Column { name: name.chars().filter(|c| !c.is_control()).collect(), values });
                fields.push((place, signed));
            }
        }
        let block = Box::new([NOTHING; 2 + BLOCK]);
        let room = length.saturating_mul(MOST_BYTES_PER_BYTE).saturating_add(1 << 16);
        Self { times: Vec::new(), columns, fields, block, waiting: 0, length, room }
    }

    /// Whether there is no room for more.
    pub(super) fn full(&self) -> bool {
        self.room == 0
    }

    /// The last frame but one, the last one and the next one.
    #[inline]
    pub(super) fn frames(&mut self) -> Option<&mut [Frame; 3]> {
        self.block.get_mut(self.waiting..)?.first_chunk_mut()
    }

    /// Appends the next frame, behind which so many bytes of the log are left.
    #[inline]
    pub(super) fn push(&mut self, time_us: i64, left: usize) {
        let end = self.length - left;
        if self.times.len() == self.times.capacity() {
            reserve(&mut self.times, end, self.length);
        }
        self.times.push(time_us);
        self.waiting += 1;
        self.room = self.room.saturating_sub(8 + 4 * self.fields.len());
        if self.waiting == BLOCK {
            self.flush(end);
        }
    }

    /// Puts the waiting frames into the columns.
    fn flush(&mut self, end: usize) {
        let mut numbers = [0; BLOCK];
        for (column, &(place, signed)) in self.columns.iter_mut().zip(&self.fields) {
            let place = place.min(MOST_FIELDS);
            for (number, frame) in numbers.iter_mut().zip(&self.block[2..]) {
                *number = frame[place];
            }
            let numbers = &numbers[..self.waiting];
            widen(&mut column.values, numbers, signed);
            match &mut column.values {
                Values::I16(values) => append(values, numbers, |value| value as i16, end, self.length),
                Values::U16(values) => append(values, numbers, |value| value as u16, end, self.length),
                Values::I32(values) => append(values, numbers, |value| value as i32, end, self.length),
                Values::U32(values) => append(values, numbers, |value| value, end, self.length),
                _ => {}
            }
        }
        self.block.copy_within(self.waiting..self.waiting + 2, 0);
        self.waiting = 0;
    }

    /// Times and columns.
    pub(super) fn finish(mut self) -> (Vec<i64>, Vec<Column>) {
        self.flush(self.length);
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

/// Appends numbers to a column.
fn append<T>(values: &mut Vec<T>, block: &[u32], narrow: impl Fn(u32) -> T, end: usize, length: usize) {
    if values.capacity() - values.len() < block.len() {
        reserve(values, end, length);
    }
    values.extend(block.iter().map(|&value| narrow(value)));
}

/// Makes room for as many rows as the rest of the log has if it is like its beginning, and a few more.
fn reserve<T>(values: &mut Vec<T>, end: usize, length: usize) {
    let rest = length.saturating_sub(end) as f64 / end.max(1) as f64;
    let most = values.len().saturating_mul(4).saturating_add(4 * BLOCK);
    values.reserve_exact(((values.len() as f64 * rest * 1.05) as usize).saturating_add(BLOCK).min(most));
}

/// Makes a column wide enough for some numbers.
fn widen(values: &mut Values, block: &[u32], signed: bool) {
    match values {
        Values::I16(narrow) if signed => {
            // Half the range up, the fitting ones are the lowest.
            let excess = block.iter().fold(0, |excess, &value| excess | (value.wrapping_add(1 << 15) >> 16));
            if excess != 0 {
                *values = Values::I32(narrow.iter().map(|&value| value.into()).collect());
            }
        }
        Values::U16(narrow) if block.iter().fold(0, |excess, &value| excess | (value >> 16)) != 0 => {
            *values = Values::U32(narrow.iter().map(|&value| value.into()).collect());
        }
        _ => {}
    }
}
