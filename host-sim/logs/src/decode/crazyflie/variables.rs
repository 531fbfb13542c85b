//! Log variables: their types, and rows into columns.

use crate::log::{Column, Table, TimeUnit, Values};

/// A variable of a row.
#[derive(Debug)]
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// Type of a variable, by its letter in Python's `struct`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    fn of(letter: u8) -> Option<Self> {
        Some(match letter {
            b'b' => Self::I8,
            b'B' | b'?' | b'c' => Self::U8,
            b'h' => Self::I16,
            b'H' => Self::U16,
            b'i' | b'l' => Self::I32,
            b'I' | b'L' => Self::U32,
            b'q' => Self::I64,
            b'Q' => Self::U64,
            b'f' => Self::F32,
            b'd' => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a row.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl Variable {
    /// Out of `name(t)`.
    pub(super) fn parse(text: &[u8]) -> Option<Self> {
        let [name @ .., b'(', letter, b')'] = text else { return None };
        Some(Self { name: String::from_utf8_lossy(name).into_owned(), kind: Kind::of(*letter)? })
    }
}

/// Rows at known places as a table; `times` may be empty.
pub(super) fn table(
    name: &str,
    variables: &[Variable],
    bytes: &[u8],
    rows_at: &[usize],
    times: Vec<i64>,
    time_unit: TimeUnit,
) -> Table {
    let mut offset = 0;
    let columns = variables.iter().map(|variable| {
        let values = column(variable.kind, bytes, rows_at, offset);
        offset += variable.kind.bytes();
        Column { name: variable.name.clone(), values }
    });
    let columns = columns.collect();
    Table { name: name.into(), message_type: None, time_unit, times, rows: rows_at.len(), columns }
}

/// One variable of all rows.
fn column(kind: Kind, bytes: &[u8], rows_at: &[usize], offset: usize) -> Values {
    macro_rules! numbers {
        ($variant:ident, $type:ty) => {{
            let number = |at: &usize| {
                let bytes = bytes.get(at + offset..).and_then(|rest| rest.first_chunk());
                bytes.copied().map_or(<$type>::default(), <$type>::from_le_bytes)
            };
            Values::$variant(rows_at.iter().map(number).collect())
        }};
    }
    match kind {
        Kind::I8 => numbers!(I8, i8),
        Kind::U8 => numbers!(U8, u8),
        Kind::I16 => numbers!(I16, i16),
        Kind::U16 => numbers!(U16, u16),
        Kind::I32 => numbers!(I32, i32),
        Kind::U32 => numbers!(U32, u32),
        Kind::I64 => numbers!(I64, i64),
        Kind::U64 => numbers!(U64, u64),
        Kind::F32 => numbers!(F32, f32),
        Kind::F64 => numbers!(F64, f64),
    }
}
