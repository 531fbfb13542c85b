//! Logs of any program through the whole import, up to flights and the draft of a vehicle.

use std::path::Path;

use flights::{Column, ColumnMap};
use logs::import_bytes;

/// Whether a log of this name holds a flight, or why it was refused.
pub(crate) fn import(name: &str, bytes: &[u8]) -> Result<bool, String> {
    let import = import_bytes(bytes.to_vec(), Path::new(name), &ColumnMap::default())
        .map_err(|error| error.to_string())
        .inspect_err(|text| {
            assert!(text.chars().count() < 400 && !text.contains(char::is_control), "{text:?}");
        })?;
    assert!(import.losses.damage.len() <= 9, "{:?}", import.losses.damage);
    for sentence in import.losses.damage.iter().chain(&import.limits).chain(&import.notes) {
        assert!(sentence.len() < 2000 && !sentence.contains(char::is_control), "{sentence:?}");
    }
    for part in &import.flights {
        let t = part.flight.column(Column::T).expect("a flight has times");
        assert!(t.len() > 1 && t.windows(2).all(|pair| pair[0] < pair[1]), "times do not rise");
    }
    let has_flights = !import.flights.is_empty();
    let _ = logs::draft(&[import]);
    Ok(has_flights)
}
