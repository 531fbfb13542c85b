//! What the tests of this crate share.

pub(crate) mod damage;
pub(crate) mod flight;
pub(crate) mod motion;
pub(crate) mod mutations;

use std::path::{Path, PathBuf};

use logs::{Log, LogError, Recording, Table, decode};
use serde_json::Value;

/// A place in the shared data (beside the repository, or where `QUADLAB_SHARED` points); nothing, and says so, where it is not there.
pub(crate) fn shared(inside: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let path = std::env::var_os("QUADLAB_SHARED").map_or_else(beside, PathBuf::from).join(inside);
    if path.exists() {
        return Some(path);
    }
    println!(
        "SKIPPED: {} is not there (set QUADLAB_SHARED to the folder that holds {inside})",
        path.display()
    );
    None
}

/// The only recording of a log.
pub(crate) fn recorded(log: &Log, path: &Path) -> Result<Recording, LogError> {
    logs::record(log, path).map(|mut all| all.remove(0))
}

/// A log of the shared data, decoded, and what the format's own decoder finds in it.
pub(crate) fn expected(name: &str) -> Option<(Log, Value)> {
    let path = shared(&format!("data/logs/{name}"))?;
    let all = std::fs::read_to_string(shared("data/logs/expected.json")?).unwrap();
    let all: Value = serde_json::from_str(&all).unwrap();
    let log = decode(&std::fs::read(&path).unwrap(), &path).unwrap();
    Some((log, all[name].clone()))
}

/// Compares the sum of a column, NaN left out, with one that is written with so many digits. Where
/// positive and negative numbers cancel, the order of adding shows: so it is as exact as the sum of the
/// magnitudes.
pub(crate) fn expected_sum(table: &Table, column: &str, expected: f64, digits: i32) {
    let values = table.column(column).unwrap_or_else(|| panic!("{} lacks {column}", table.name)).to_f64();
    let there = || values.iter().filter(|value| !value.is_nan());
    let (sum, magnitude): (f64, f64) = (there().sum(), there().map(|value| value.abs()).sum());
    let tolerance = 5.01 * 10_f64.powi(-digits) * expected.abs() + 1e-12 * magnitude;
    assert!((sum - expected).abs() <= tolerance, "{} {column}: {sum}, not {expected}", table.name);
}
