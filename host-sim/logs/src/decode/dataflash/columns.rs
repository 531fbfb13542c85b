//! Fields of messages into typed columns.

use super::format::{Field, is_text};
use super::messages::Messages;
use crate::log::{Column, Table, TimeUnit, Values};

/// Messages that are read at a time, field after field: few enough to stay in the cache.
const BLOCK: usize = 512;
/// Numbers in an array field.
const ARRAY: usize = 32;

/// A table of all messages of a type. Text has no column.
pub(super) fn table(messages: &Messages, bytes: &[u8]) -> Table {
    let format = &messages.format;
    let rows = messages.starts.len();
    let time = format.time_field();
    let mut times = Vec::with_capacity(if time.is_some() { rows } else { 0 });
    let mut columns = Vec::new();
    let mut sources = Vec::new();
    for (index, field) in format.fields.iter().enumerate() {
        if Some(index) == time || is_text(field.letter) {
            continue;
        }
        for element in 0..if field.letter == b'a' { ARRAY } else { 1 } {
            let name = if field.letter == b'a' {
                format!("{}[{element}]", field.label)
            } else {
                field.label.clone()
            };
            columns.push(Column { name, values: empty(field.letter, rows) });
            sources.push(Field { offset: field.offset + 2 * element, ..field.clone() });
        }
    }
    for starts in messages.starts.chunks(BLOCK) {
        if let Some(field) = time.and_then(|time| format.fields.get(time)) {
            append_times(&mut times, bytes, starts, field);
        }
        for (column, field) in columns.iter_mut().zip(&sources) {
            append(&mut column.values, bytes, starts, field);
        }
    }
    Table {
        name: format.name.clone(),
        message_type: None,
        time_unit: time_unit(format, time),
        times,
        rows,
        columns,
    }
}

/// Milliseconds in logs before 3.3, else microseconds.
pub(super) fn time_unit(format: &super::format::MessageFormat, time: Option<usize>) -> TimeUnit {
    match time.and_then(|time| format.fields.get(time)) {
        Some(field) if field.label == "TimeMS" => TimeUnit::Milliseconds,
        _ => TimeUnit::Microseconds,
    }
}

/// An empty column for a letter.
pub(super) fn empty(letter: u8, rows: usize) -> Values {
    match letter {
        b'b' => Values::I8(Vec::with_capacity(rows)),
        b'B' | b'M' => Values::U8(Vec::with_capacity(rows)),
        b'h' | b'a' => Values::I16(Vec::with_capacity(rows)),
        b'H' => Values::U16(Vec::with_capacity(rows)),
        b'i' => Values::I32(Vec::with_capacity(rows)),
        b'I' => Values::U32(Vec::with_capacity(rows)),
        b'q' => Values::I64(Vec::with_capacity(rows)),
        b'Q' => Values::U64(Vec::with_capacity(rows)),
        // Hundredths of 16 bits are as exact in single precision as they are in the log.
        b'f' | b'g' | b'c' | b'C' => Values::F32(Vec::with_capacity(rows)),
        _ => Values::F64(Vec::with_capacity(rows)),
    }
}

/// Appends a field of some messages to its column.
fn append(values: &mut Values, bytes: &[u8], starts: &[u32], field: &Field) {
    let at = field.offset;
    match (values, field.letter) {
        (Values::I8(values), _) => gather(values, bytes, starts, at, i8::from_le_bytes),
        (Values::U8(values), _) => gather(values, bytes, starts, at, u8::from_le_bytes),
        (Values::I16(values), _) => gather(values, bytes, starts, at, i16::from_le_bytes),
        (Values::U16(values), _) => gather(values, bytes, starts, at, u16::from_le_bytes),
        (Values::I32(values), _) => gather(values, bytes, starts, at, i32::from_le_bytes),
        (Values::U32(values), _) => gather(values, bytes, starts, at, u32::from_le_bytes),
        (Values::I64(values), _) => gather(values, bytes, starts, at, i64::from_le_bytes),
        (Values::U64(values), _) => gather(values, bytes, starts, at, u64::from_le_bytes),
        (Values::F32(values), b'c') => {
            gather(values, bytes, starts, at, |raw| (f64::from(i16::from_le_bytes(raw)) * 0.01) as f32);
        }
        (Values::F32(values), b'C') => {
            gather(values, bytes, starts, at, |raw| (f64::from(u16::from_le_bytes(raw)) * 0.01) as f32);
        }
        (Values::F32(values), b'g') => gather(values, bytes, starts, at, half),
        (Values::F32(values), _) => gather(values, bytes, starts, at, f32::from_le_bytes),
        (Values::F64(values), b'e') => {
            gather(values, bytes, starts, at, |raw| f64::from(i32::from_le_bytes(raw)) * 0.01)
        }
        (Values::F64(values), b'E') => {
            gather(values, bytes, starts, at, |raw| f64::from(u32::from_le_bytes(raw)) * 0.01)
        }
        (Values::F64(values), b'L') => {
            gather(values, bytes, starts, at, |raw| f64::from(i32::from_le_bytes(raw)) * 1e-7)
        }
        (Values::F64(values), _) => gather(values, bytes, starts, at, f64::from_le_bytes),
    }
}

/// Appends the times of some messages.
fn append_times(times: &mut Vec<i64>, bytes: &[u8], starts: &[u32], field: &Field) {
    let at = field.offset;
    match field.letter {
        b'Q' => {
            gather(times, bytes, starts, at, |raw| i64::try_from(u64::from_le_bytes(raw)).unwrap_or(i64::MAX))
        }
        b'q' => gather(times, bytes, starts, at, i64::from_le_bytes),
        b'I' => gather(times, bytes, starts, at, |raw| u32::from_le_bytes(raw).into()),
        b'i' => gather(times, bytes, starts, at, |raw| i32::from_le_bytes(raw).into()),
        b'H' => gather(times, bytes, starts, at, |raw| u16::from_le_bytes(raw).into()),
        b'h' => gather(times, bytes, starts, at, |raw| i16::from_le_bytes(raw).into()),
        b'B' => gather(times, bytes, starts, at, |raw| u8::from_le_bytes(raw).into()),
        _ => gather(times, bytes, starts, at, |raw| i8::from_le_bytes(raw).into()),
    }
}

/// Appends the value at an offset of each message. The messages lie within the bytes: the index has seen to it.
fn gather<const N: usize, T>(
    values: &mut Vec<T>,
    bytes: &[u8],
    starts: &[u32],
    offset: usize,
    value: impl Fn([u8; N]) -> T,
) {
    values.extend(starts.iter().map(|&start| {
        let at = start as usize + offset;
        value(bytes.get(at..at + N).and_then(|raw| raw.try_into().ok()).unwrap_or([0; N]))
    }));
}

/// One field as a number, if it is one.
pub(super) fn number(bytes: &[u8], letter: u8) -> Option<f64> {
    let field = Field { label: String::new(), letter, offset: 0 };
    if is_text(letter) {
        return None;
    }
    let mut values = empty(letter, 1);
    append(&mut values, bytes, &[0], &field);
    values.to_f64().first().copied()
}

/// IEEE 754 half precision.
fn half(raw: [u8; 2]) -> f32 {
    let bits = u16::from_le_bytes(raw);
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let fraction = f32::from(bits & 0x3ff);
    match (bits >> 10) & 0x1f {
        0 => sign * fraction * 2.0_f32.powi(-24),
        0x1f if fraction == 0.0 => sign * f32::INFINITY,
        0x1f => f32::NAN,
        exponent => sign * (1.0 + fraction / 1024.0) * 2.0_f32.powi(i32::from(exponent) - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_as_ieee_754_has_it() {
        let cases = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
            (0xfc00, f32::NEG_INFINITY),
        ];
        for (bits, value) in cases {
            assert_eq!(half(u16::to_le_bytes(bits)), value, "{bits:#06x}");
        }
        assert!(half(u16::to_le_bytes(0x7e00)).is_nan());
    }
}
