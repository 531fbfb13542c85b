//! Betaflight logs: what the format's own decoder (blackbox_decode) finds in them.

mod common;

use logs::{Log, decode};
use serde_json::Value;

const FILES: [&str; 4] =
    ["betaflight_2_logs.bbl", "betaflight_44_logs.bbl", "betaflight_damaged.bbl", "betaflight_mag.BFL"];

/// A log of the shared data and what its own decoder finds in it.
fn log_and_expected(name: &str) -> Option<(Log, Value)> {
    let path = common::shared(&format!("data/logs/{name}"))?;
    let text = std::fs::read_to_string(path.with_file_name("expected.json")).expect("expected.json");
    let expected: Value = serde_json::from_str(&text).expect("JSON");
    let bytes = std::fs::read(&path).expect("a log");
    Some((decode(&bytes, &path).expect("a log"), expected[name].clone()))
}

/// Rows, first and last time and sums of every log of every file.
#[test]
fn rows_and_sums_are_those_of_blackbox_decode() {
    for name in FILES {
        let Some((log, expected)) = log_and_expected(name) else { continue };
        let logs = expected["logs"].as_array().expect("logs");
        assert_eq!(log.tables.len(), logs.len(), "{name}");
        for (table, expected) in log.tables.iter().zip(logs) {
            let what = format!("{name}, {}", table.name);
            assert_eq!(table.name, format!("log {}", expected["index"]), "{what}");
            println!("{what} {} {:?} {:?} {}", table.rows, table.times.first(), table.times.last(), expected);
            assert_eq!(table.rows as u64, expected["rows"].as_u64().expect("rows"), "{what}");
            assert_eq!(table.times.first().copied(), expected["first_us"].as_i64(), "{what}");
            assert_eq!(table.times.last().copied(), expected["last_us"].as_i64(), "{what}");
            for (field, sum) in expected["sums"].as_object().into_iter().flatten() {
                let (column, per_unit) = match field.as_str() {
                    "vbatLatest (V)" => ("vbatLatest", 10.0),
                    "BaroAlt (cm)" => ("BaroAlt", 1.0),
                    column => (column, 1.0),
                };
                let found: f64 =
                    table.column(column).unwrap_or_else(|| panic!("{what}: {column}")).to_f64().iter().sum();
                let sum = sum.as_f64().expect("a number");
                assert!((found / per_unit - sum).abs() <= 1e-6 * sum.abs(), "{what}: {field} {found} {sum}");
            }
        }
        println!("{:?} {:#?}", log.losses, log.information.iter().take(30).collect::<Vec<_>>());
    }
}
