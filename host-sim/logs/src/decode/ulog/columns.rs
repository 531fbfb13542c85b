//! Rows into columns.

use crate::log::{Column, Values};

use super::formats::Place;
use super::records::Kind;

/// Rows that are copied at once: few enough that what they lie in stays in the cache for all columns.
const ROWS_AT_ONCE: usize = 128;

/// Copies columns out of the rows that start at the given places of the file.
pub(super) fn columns(bytes: &[u8], rows: &[usize], places: Vec<Place>) -> Vec<Column> {
    let mut values: Vec<Values> = places.iter().map(|place| with_capacity(place.kind, rows.len())).collect();
    for rows in rows.chunks(ROWS_AT_ONCE) {
        for (values, place) in values.iter_mut().zip(&places) {
            copy(bytes, rows, place.offset, values);
        }
    }
    places.into_iter().zip(values).map(|(place, values)| Column { name: place.name, values }).collect()
}

fn with_capacity(kind: Kind, rows: usize) -> Values {
    match kind {
        Kind::I8 => Values::I8(Vec::with_capacity(rows)),
        Kind::U8 | Kind::Bool | Kind::Char | Kind::Named => Values::U8(Vec::with_capacity(rows)),
        Kind::I16 => Values::I16(Vec::with_capacity(rows)),
        Kind::U16 => Values::U16(Vec::with_capacity(rows)),
        Kind::I32 => Values::I32(Vec::with_capacity(rows)),
        Kind::U32 => Values::U32(Vec::with_capacity(rows)),
        Kind::I64 => Values::I64(Vec::with_capacity(rows)),
        Kind::U64 => Values::U64(Vec::with_capacity(rows)),
        Kind::F32 => Values::F32(Vec::with_capacity(rows)),
        Kind::F64 => Values::F64(Vec::with_capacity(rows)),
    }
}

fn copy(bytes: &[u8], rows: &[usize], offset: usize, values: &mut Values) {
    match values {
        Values::I8(values) => extend(bytes, rows, offset, values, i8::from_le_bytes),
        Values::U8(values) => extend(bytes, rows, offset, values, u8::from_le_bytes),
        Values::I16(values) => extend(bytes, rows, offset, values, i16::from_le_bytes),
        Values::U16(values) => extend(bytes, rows, offset, values, u16::from_le_bytes),
        Values::I32(values) => extend(bytes, rows, offset, values, i32::from_le_bytes),
        Values::U32(values) => extend(bytes, rows, offset, values, u32::from_le_bytes),
        Values::I64(values) => extend(bytes, rows, offset, values, i64::from_le_bytes),
        Values::U64(values) => extend(bytes, rows, offset, values, u64::from_le_bytes),
        Values::F32(values) => extend(bytes, rows, offset, values, f32::from_le_bytes),
        Values::F64(values) => extend(bytes, rows, offset, values, f64::from_le_bytes),
    }
}

/// One value a row. Rows are as long as their format when they are taken in: none is missing here.
pub(super) fn extend<T, const SIZE: usize>(
    bytes: &[u8],
    rows: &[usize],
    offset: usize,
    values: &mut Vec<T>,
    read: impl Fn([u8; SIZE]) -> T,
) {
    values.extend(rows.iter().map(|row| {
        let field = bytes.get(row + offset..).and_then(|field| field.first_chunk());
        read(*field.unwrap_or(&[0; SIZE]))
    }));
}
