//! ROS bags and MCAP: what `rosbags` finds in them, and the flights that were made from them.

mod common;

use common::{expected, expected_sum};
use logs::{Format, Log, Values};
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
                    let Some(Values::I64(stamps)) = table.column("header.stamp") else { panic!("{topic} has no stamp") };
                    let offset: f64 = stamps.iter().map(|stamp| (stamp - table.times[0]) as f64 * 1e-9).sum();
                    // The reference subtracts two times since 1970 as floating-point numbers: 2e-7 s each.
                    assert!((offset - sum).abs() < 2.4e-7 * table.rows as f64 + 1e-7 * sum, "{topic}: {offset}, not {sum}");
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
        let recording = logs::record(&log, std::path::Path::new(name)).unwrap();
        println!("{name} {:?} {:?} {:?}", recording.notes, recording.limits, recording.hints);
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
