//! Damage to files: bytes changed, missing, added, numbers made large.
#![allow(dead_code, reason = "not every test needs all of it")]

use std::path::Path;

use logs::{LogError, decode, record};
use proptest::prelude::*;

/// A change of a file, at a part of its length.
#[derive(Debug, Clone)]
pub(crate) enum Mutation {
    Set { at: f64, byte: u8 },
    Ones { at: f64, count: usize },
    Zeros { at: f64, count: usize },
    Remove { at: f64, count: usize },
    Repeat { at: f64, count: usize },
    Cut { at: f64 },
}

/// Some changes; half of them near the beginning, where headers are.
pub(crate) fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    let at = || {
        prop_oneof![
            0.0..1.0,
            (0.0_f64..1.0).prop_map(|part| part.powi(6)),
            (0.0_f64..1.0).prop_map(|part| 1.0 - part.powi(6))
        ]
    };
    let one = prop_oneof![
        4 => (at(), any::<u8>()).prop_map(|(at, byte)| Mutation::Set { at, byte }),
        2 => (at(), 1_usize..9).prop_map(|(at, count)| Mutation::Ones { at, count }),
        1 => (at(), 1_usize..5000).prop_map(|(at, count)| Mutation::Zeros { at, count }),
        1 => (at(), 1_usize..2000).prop_map(|(at, count)| Mutation::Remove { at, count }),
        1 => (at(), 1_usize..2000).prop_map(|(at, count)| Mutation::Repeat { at, count }),
        1 => at().prop_map(|at| Mutation::Cut { at }),
    ];
    proptest::collection::vec(one, 1..5)
}

/// The file with the changes.
pub(crate) fn changed(bytes: &[u8], mutations: &[Mutation]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for mutation in mutations {
        let place = |at: f64| ((bytes.len() as f64 * at) as usize).min(bytes.len());
        let end = |at: usize, count: usize| (at + count).min(bytes.len());
        match *mutation {
            Mutation::Set { at, byte } => {
                let at = place(at);
                bytes.iter_mut().skip(at).take(1).for_each(|old| *old = byte);
            }
            Mutation::Ones { at, count } => {
                let at = place(at);
                bytes.iter_mut().skip(at).take(count).for_each(|old| *old = 0xff);
            }
            Mutation::Zeros { at, count } => {
                let at = place(at);
                bytes.iter_mut().skip(at).take(count).for_each(|old| *old = 0);
            }
            Mutation::Remove { at, count } => {
                let at = place(at);
                let end = end(at, count);
                bytes.drain(at..end);
            }
            Mutation::Repeat { at, count } => {
                let at = place(at);
                let again = bytes[at..end(at, count)].to_vec();
                bytes.splice(at..at, again);
            }
            Mutation::Cut { at } => bytes.truncate(place(at)),
        }
    }
    bytes
}

/// Decodes changed files: nothing panics, hangs, or takes more memory than a file of this size may;
/// messages are one line.
pub(crate) fn survives(name: &str, bytes: &[u8], cases: u32) {
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(mutations in mutations())| {
        let bytes = changed(bytes, &mutations);
        let began = std::time::Instant::now();
        let memory = allocation_counter::measure(|| look(name, &bytes));
        // What compressed parts and columns may become: the decoders' own limits; far below what four
        // damaged bytes can ask for.
        prop_assert!(memory.bytes_max < (160 << 20) + 400 * bytes.len() as u64, "{} bytes", memory.bytes_max);
        prop_assert!(began.elapsed().as_secs() < 20, "{:?}", began.elapsed());
    });
}

fn look(name: &str, bytes: &[u8]) {
    let path = Path::new(name);
    let one_line = |error: LogError| {
        let message = error.to_string();
        assert!(message.len() < 400 && !message.contains(char::is_control), "{message}");
    };
    match decode(bytes, path) {
        Ok(log) => {
            assert!(log.losses.damage.len() <= 6, "{:?}", log.losses.damage);
            for table in &log.tables {
                assert!(table.times.is_empty() || table.times.len() == table.rows);
                assert!(
                    table.columns.iter().all(|column| column.values.len() == table.rows),
                    "{}",
                    table.name
                );
            }
            if let Err(error) = record(&log, path) {
                one_line(error);
            }
        }
        Err(error) => one_line(error),
    }
}
