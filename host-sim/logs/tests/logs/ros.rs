//! ROS bags and MCAP: what `rosbags` finds in them, and the flights that were made from them.

use std::path::Path;

use crate::common::flight::{ANGLES, COMMANDS, FORCE, POSITION, RATES, Reference, VELOCITY, angles, smooth};
use crate::common::mutations::survives;
use crate::common::{expected, expected_sum, recorded, shared};
use logs::{Format, Log, Signal, Values, decode};
use serde_json::Value;

/// Types, counts, first and last times, sums.
fn agrees(log: &Log, expected: &Value) {
    assert_eq!(log.losses.damage, Vec::<String>::new());
    let topics = expected["topics"].as_object().unwrap();
    assert_eq!(log.tables.len(), topics.len());
    for (topic, found) in topics {
        let table = log.table(topic).unwrap();
        assert_eq!(table.message_type.as_deref(), found["type"].as_str());
        assert_eq!(table.rows as u64, found["count"].as_u64().unwrap(), "{topic}");
        assert_eq!(Some(table.times[0]), found["first_ns"].as_i64());
        assert_eq!(table.times.last().copied(), found["last_ns"].as_i64());
        for (key, sum) in found.get("sums").and_then(Value::as_object).into_iter().flatten() {
            let sum = sum.as_f64().unwrap();
            match key.as_str() {
                "stamp_offset_s" => {
                    let Some(Values::I64(stamps)) = table.column("header.stamp") else {
                        panic!("{topic} has no stamp")
                    };
                    let offset: f64 = stamps.iter().map(|stamp| (stamp - table.times[0]) as f64 * 1e-9).sum();
                    // The reference subtracts two times since 1970 as floating-point numbers: 2e-7 s each.
                    assert!(
                        (offset - sum).abs() < 2.4e-7 * table.rows as f64 + 1e-7 * sum,
                        "{topic}: {offset}, not {sum}"
                    );
                }
                _ => {
                    let column = match key.split('.').next().unwrap() {
                        "position" | "orientation" => format!("pose.{key}"),
                        "linear" => format!("twist.{key}"),
                        _ => key.clone(),
                    };
                    expected_sum(table, &column, sum, 8);
                }
            }
        }
    }
}

#[test]
fn bags_hold_what_rosbags_finds() {
    for (name, format) in [
        ("crazyflie_ros1.bag", Format::Rosbag1),
        ("crazyflie_log203.db3", Format::Rosbag2),
        ("crazyflie_log203.mcap", Format::Mcap),
    ] {
        let Some((log, expected)) = expected(name) else { return };
        assert_eq!(log.format, format);
        agrees(&log, &expected);
    }
}

/// The names of the topics that the reference conversion takes.
#[test]
fn sources_are_those_of_the_reference() {
    for name in ["crazyflie_ros1.bag", "crazyflie_log203.db3", "crazyflie_log203.mcap"] {
        let Some((log, expected)) = expected(name) else { return };
        let recording = recorded(&log, Path::new(name)).unwrap();
        let signals = &recording.signals;
        let told = &expected["flight_format"];
        let of = |source: Option<&String>| source.map_or(Value::Null, |name| Value::from(name.as_str()));
        assert_eq!(of(signals.position.as_ref().map(|signal| &signal.source)), told["position"]);
        assert_eq!(of(signals.attitude.as_ref().map(|signal| &signal.source)), told["attitude"]);
        assert_eq!(of(signals.rates.as_ref().map(|signal| &signal.source)), told["rates"]);
        assert_eq!(of(signals.specific_force.as_ref().map(|signal| &signal.source)), told["specific_force"]);
        assert_eq!(of(signals.commands.as_ref().map(|signal| &signal.source)), told["commands"]);
        assert_eq!(of(signals.rotor_speed.as_ref().map(|signal| &signal.source)), told["rotor_speed"]);
        assert_eq!(of(signals.voltage.as_ref().map(|signal| &signal.source)), told["voltage"]);
    }
}

/// The bag keeps the slow clock of the log that it was made from, so its times are stretched by 85/84
/// first. It has all rows of the sensor and the motors, which agree to the five digits of the flight;
/// every second or third row of poses and twists, between which the craft moves on for 10 ms, where the
/// flight has means of three rows of 4 ms.
#[test]
fn log203_is_its_flight() {
    let Some(path) = shared("data/crazyswarm2/log203.csv") else { return };
    let reference = Reference::read(&path);
    for name in ["crazyflie_log203.db3", "crazyflie_log203.mcap"] {
        let Some((log, _)) = expected(name) else { return };
        let signals = recorded(&log, Path::new(name)).unwrap().signals;
        let began = signals.rates.as_ref().unwrap().t[0];
        let stretched = |t: &[f64]| t.iter().map(|t| (t - began) * 85.0 / 84.0).collect::<Vec<f64>>();
        let position = signals.position.as_ref().unwrap();
        let position = Signal { t: stretched(&position.t), ..position.clone() };
        let offset = reference.begin(&position, <[f64]>::to_vec);
        let near = |names: &[&str], t: &[f64], values: &[Vec<f64>], tolerance: [f64; 2]| {
            for (name, values) in names.iter().zip(values) {
                println!(
                    "{name} {:?} {tolerance:?}",
                    reference.differences(name, &stretched(t), values, offset)
                );
            }
        };
        let smoothed = |values: &[Vec<f64>]| values.iter().map(|values| smooth(values)).collect::<Vec<_>>();
        let signal = |names: &[&str; 3], signal: &Signal<3>, tolerance: [f64; 2]| {
            near(names, &signal.t, &signal.values, tolerance)
        };
        let at_full_rate = |names: &[&str; 3], signal: &Signal<3>, tolerance| {
            near(names, &signal.t, &smoothed(&signal.values), tolerance)
        };
        signal(&POSITION, signals.position.as_ref().unwrap(), [5e-3, 1e-3]);
        signal(&VELOCITY, signals.velocity.as_ref().unwrap(), [0.015, 3e-3]);
        at_full_rate(&RATES, signals.rates.as_ref().unwrap(), [1e-4, 1e-5]);
        at_full_rate(&FORCE, signals.specific_force.as_ref().unwrap(), [6e-4, 2e-4]);
        let attitude = signals.attitude.as_ref().unwrap();
        near(&ANGLES, &attitude.t, &angles(attitude), [6e-3, 1e-3]);
        let commands = signals.commands.as_ref().unwrap();
        // The bag has forces in N, the flight the square root of their share of 0.15 N.
        let roots = commands
            .values
            .each_ref()
            .map(|forces| forces.iter().map(|force| (force / 0.15).sqrt()).collect::<Vec<f64>>());
        near(&COMMANDS, &commands.t, &smoothed(&roots), [1e-4, 1e-4]);
        for (name, load) in &signals.extra {
            // Where the load is jumps by 0.3 m in single rows of the log, which the flight has a third of.
            near(&[name], &load.t, &load.values, [0.2, 2e-3]);
        }
        assert_eq!(signals.extra.len(), 3);
    }
}

const BAGS: [&str; 3] = ["crazyflie_ros1.bag", "crazyflie_log203.db3", "crazyflie_log203.mcap"];

fn rows(log: &Log) -> usize {
    log.tables.iter().map(|table| table.rows).sum()
}

/// Part of a bag, whole log, and what is left in it.
fn left(name: &str, change: impl Fn(&mut Vec<u8>)) -> Option<f64> {
    let (whole, _) = expected(name)?;
    let mut bytes = std::fs::read(shared(&format!("data/logs/{name}"))?).unwrap();
    change(&mut bytes);
    let log = decode(&bytes, Path::new(name)).unwrap();
    assert!(!log.losses.damage.is_empty(), "{name}");
    println!("{name}: {} of {} messages; {:?}", rows(&log), rows(&whole), log.losses.damage);
    Some(rows(&log) as f64 / rows(&whole) as f64)
}

/// A recorder that was killed leaves a bag without its end. Where an index is at the end, the messages
/// are in less than the whole.
#[test]
fn bags_that_were_not_closed_keep_what_is_there() {
    for name in BAGS {
        let Some(part) = left(name, |bytes| bytes.truncate(bytes.len() * 6 / 10)) else { return };
        assert!((0.55..0.67).contains(&part), "{name}: {part}");
    }
}

/// Ones over a page of sqlite in the middle.
#[test]
fn messages_behind_damage_are_there() {
    for name in BAGS {
        let Some(part) = left(name, |bytes| {
            let middle = bytes.len() / 2;
            bytes[middle..middle + 4096].fill(0xff);
        }) else {
            return;
        };
        assert!(part > 0.98, "{name}: {part}");
    }
}

#[test]
fn damaged_bags_do_no_harm() {
    for name in BAGS {
        let Some(path) = shared(&format!("data/logs/{name}")) else { return };
        survives(name, &std::fs::read(path).unwrap(), 300);
    }
}

/// As it lies beside each bag.
#[test]
fn the_list_of_a_bags_files_is_no_log() {
    let text = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - a_0.db3\n";
    let refused =
        logs::import_bytes(text.as_bytes(), Path::new("metadata.yaml"), &flights::ColumnMap::default());
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("metadata.yaml") && message.contains(".db3 or .mcap"), "{message}");
}
