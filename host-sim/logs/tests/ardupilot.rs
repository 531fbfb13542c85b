//! ArduPilot logs: what pymavlink finds in them.

mod common;

use logs::{Log, decode};
use serde_json::Value;

const FILES: [&str; 4] =
    ["ardupilot_copter35.bin", "ardupilot_copter36_a.bin", "ardupilot_copter36_b.bin", "ardupilot_plane_cut.BIN"];

/// A log of the shared data and what its own decoder finds in it.
fn log_and_expected(name: &str) -> Option<(Log, Value)> {
    let path = common::shared(&format!("data/logs/{name}"))?;
    let text = std::fs::read_to_string(path.with_file_name("expected.json")).expect("expected.json");
    let expected: Value = serde_json::from_str(&text).expect("JSON");
    let bytes = std::fs::read(&path).expect("a log");
    Some((decode(&bytes, &path).expect("a log"), expected[name].clone()))
}

/// Counts, first and last time and sums of every type of message.
#[test]
fn messages_are_those_of_pymavlink() {
    for name in FILES {
        let Some((log, expected)) = log_and_expected(name) else { continue };
        println!("{name} {:?} {:#?} {:?}", log.losses, log.information, log.firmware);
        let types = expected["types"].as_object().expect("types");
        let names: Vec<&String> = log.tables.iter().map(|table| &table.name).collect();
        assert_eq!(names, types.keys().collect::<Vec<_>>(), "{name}");
        for (table, expected) in log.tables.iter().zip(types.values()) {
            let what = format!("{name}, {}", table.name);
            assert_eq!(table.rows as u64, expected["count"].as_u64().expect("count"), "{what}");
            assert_eq!(table.times.first().copied(), expected["first"].as_i64(), "{what}");
            assert_eq!(table.times.last().copied(), expected["last"].as_i64(), "{what}");
            for (field, sum) in expected["sums"].as_object().into_iter().flatten() {
                let found: f64 = table.column(field).unwrap_or_else(|| panic!("{what}: {field}")).to_f64().iter().sum();
                let sum = sum.as_f64().expect("a number");
                println!("{what} {field} {:e}", (found / sum - 1.0).abs());
                assert!((found - sum).abs() <= 1e-6 * sum.abs(), "{what}: {field} {found} {sum}");
            }
        }
        assert_eq!(log.parameters.len() as u64, expected["parameters"].as_u64().expect("parameters"), "{name}");
        assert_eq!(log.firmware.as_deref(), expected["firmware"].as_str(), "{name}");
        assert_eq!(log.information.get("frame").map(String::as_str), expected["frame"].as_str(), "{name}");
        for (parameter, expected) in [("FRAME_CLASS", &expected["frame_class"]), ("FRAME_TYPE", &expected["frame_type"])] {
            assert_eq!(log.parameters.get(parameter).copied(), expected.as_f64(), "{name}: {parameter}");
        }
    }
}
