//! Damage: bytes changed, taken out, put in; what must hold whatever stands in a file.

use std::path::Path;

use logs::{Log, LogError, Values, decode, record};
use proptest::prelude::*;

/// One change of a file.
#[derive(Debug, Clone)]
pub(crate) enum Change {
    Set(f64, u8),
    Flip(f64, u8),
    Remove(f64, usize),
    Insert(f64, Vec<u8>),
    Fill(f64, usize, u8),
    Repeat(f64, usize),
    Cut(f64),
}

/// A few changes anywhere in a file.
pub(crate) fn changes() -> impl Strategy<Value = Vec<Change>> {
    let at = || 0.0..1.0_f64;
    let change = prop_oneof![
        4 => (at(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        4 => (at(), 0..8_u8).prop_map(|(at, bit)| Change::Flip(at, bit)),
        2 => (at(), 1..400_usize).prop_map(|(at, length)| Change::Remove(at, length)),
        2 => (at(), proptest::collection::vec(any::<u8>(), 1..40)).prop_map(|(at, bytes)| Change::Insert(at, bytes)),
        1 => (at(), 1..4096_usize, prop_oneof![Just(0_u8), Just(0xff_u8), Just(b'P'), any::<u8>()]).prop_map(|(at, length, byte)| Change::Fill(at, length, byte)),
        1 => (at(), 1..300_usize).prop_map(|(at, length)| Change::Repeat(at, length)),
        1 => at().prop_map(Change::Cut),
    ];
    // Half of all changes within the first part, where a log describes itself.
    let early =
        (change, any::<bool>()).prop_map(|(change, early)| if early { change.earlier() } else { change });
    proptest::collection::vec(early, 1..8)
}

impl Change {
    /// The same within the first twentieth of the file.
    fn earlier(self) -> Self {
        const PART: f64 = 0.05;
        match self {
            Self::Set(at, byte) => Self::Set(at * PART, byte),
            Self::Flip(at, bit) => Self::Flip(at * PART, bit),
            Self::Remove(at, length) => Self::Remove(at * PART, length),
            Self::Insert(at, bytes) => Self::Insert(at * PART, bytes),
            Self::Fill(at, length, byte) => Self::Fill(at * PART, length, byte),
            Self::Repeat(at, length) => Self::Repeat(at * PART, length),
            Self::Cut(at) => Self::Cut(at),
        }
    }

    /// Changes a file.
    pub(crate) fn apply(&self, bytes: &mut Vec<u8>) {
        let place = |at: f64, length: usize| (at * length as f64) as usize;
        let range = |at: f64, length: usize, all: usize| {
            let start = place(at, all);
            start..(start + length).min(all)
        };
        match self {
            Self::Set(at, byte) => {
                let at = place(*at, bytes.len());
                if let Some(slot) = bytes.get_mut(at) {
                    *slot = *byte;
                }
            }
            Self::Flip(at, bit) => {
                let at = place(*at, bytes.len());
                if let Some(slot) = bytes.get_mut(at) {
                    *slot ^= 1 << bit;
                }
            }
            Self::Remove(at, length) => drop(bytes.drain(range(*at, *length, bytes.len()))),
            Self::Insert(at, more) => {
                let at = place(*at, bytes.len());
                drop(bytes.splice(at..at, more.iter().copied()));
            }
            Self::Fill(at, length, byte) => {
                let range = range(*at, *length, bytes.len());
                bytes[range].fill(*byte);
            }
            Self::Repeat(at, length) => {
                let range = range(*at, *length, bytes.len());
                let part = bytes[range.clone()].to_vec();
                drop(bytes.splice(range.start..range.start, part));
            }
            Self::Cut(at) => bytes.truncate(place(*at, bytes.len())),
        }
    }
}

/// Decodes and maps a file that may hold anything: no panic, bounded memory, short messages.
pub(crate) fn survives(bytes: &[u8]) {
    let path = Path::new("damaged");
    let answer = decode(bytes, path).and_then(|log| {
        check_size(&log, bytes.len());
        record(&log, path).map(|recordings| {
            for recording in &recordings {
                let rates = recording.signals.rates.as_ref();
                assert!(rates.is_none_or(|rates| rates.t.windows(2).all(|t| t[0] < t[1])));
            }
        })
    });
    if let Err(error) = answer {
        check_message(&error);
    }
}

/// Tables are of a shape, and take no more than a few times the file.
fn check_size(log: &Log, file: usize) {
    let width = |values: &Values| match values {
        Values::I8(_) | Values::U8(_) => 1,
        Values::I16(_) | Values::U16(_) => 2,
        Values::I32(_) | Values::U32(_) | Values::F32(_) => 4,
        Values::I64(_) | Values::U64(_) | Values::F64(_) => 8,
    };
    let mut taken = 0;
    for table in &log.tables {
        assert!(table.times.is_empty() || table.times.len() == table.rows, "{}", table.name);
        taken += 8 * table.times.len();
        for column in &table.columns {
            assert_eq!(column.values.len(), table.rows, "{} {}", table.name, column.name);
            taken += width(&column.values) * table.rows;
        }
    }
    assert!(taken <= 8 * file + (1 << 17), "{taken} bytes of {file}");
    assert!(log.losses.damage.len() <= 6);
    assert!(
        log.losses
            .damage
            .iter()
            .all(|sentence| sentence.len() < 300 && !sentence.chars().any(char::is_control))
    );
}

/// A message is one short line.
pub(crate) fn check_message(error: &LogError) {
    let text = error.to_string();
    assert!(text.len() < 400 && !text.chars().any(char::is_control), "{text:?}");
}
