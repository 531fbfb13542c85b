//! Crazyflie logs: what the firmware's own decoder finds in them, and the flights that were made from them.

use std::path::Path;

use crate::common::flight::{
    ANGLES, COMMANDS, FORCE, POSITION, RATES, Reference, VELOCITY, angles, smoothed_agrees,
};
use crate::common::mutations::survives;
use crate::common::{expected, expected_sum, recorded, shared};
use logs::{Format, Recording, Signal, TimeUnit, decode};
use serde_json::Value;

const LOGS: [&str; 5] = [
    "crazyflie_sd_load_log201",
    "crazyflie_sd_log10",
    "crazyflie_sd_log16",
    "crazyflie_sd_old",
    "crazyflie_sd_two_events",
];

/// Counts, first and last times and sums of every variable.
#[test]
fn logs_hold_what_the_firmwares_decoder_finds() {
    for name in LOGS {
        let Some((log, expected)) = expected(name) else { return };
        assert_eq!(log.format, Format::Crazyflie);
        assert_eq!(log.information["version"], expected["version"].to_string());
        assert_eq!(log.losses.damage.is_empty(), expected["crc_ok"].as_bool().unwrap());
        let events = expected["events"].as_object().unwrap();
        assert_eq!(log.tables.len(), events.len());
        for (event, found) in events {
            let table = log.table(event).unwrap();
            assert_eq!(table.rows as u64, found["count"].as_u64().unwrap(), "{name} {event}");
            let (first, last) = (table.times[0] as f64, *table.times.last().unwrap() as f64);
            let times = match table.time_unit {
                TimeUnit::Microseconds if found.get("first_ms").is_some() => ["first_ms", "last_ms"],
                _ => ["first_us", "last_us"],
            };
            let ticks = if times[0] == "first_ms" { 1e3 } else { 1.0 };
            for (time, key) in [first, last].into_iter().zip(times) {
                // Ten digits are written.
                let told = found[key].as_f64().unwrap() * ticks;
                assert!((time - told).abs() <= 1e-9 * told, "{name} {event} {key}: {time} {told}");
            }
            let sums = found["sums"].as_object().unwrap();
            assert_eq!(table.columns.len(), sums.len());
            for (variable, sum) in sums {
                expected_sum(table, variable, sum.as_f64().unwrap(), 10);
            }
        }
    }
}

/// The names of the sources that the reference conversion takes.
fn sources_agree(recording: &Recording, expected: &Value) {
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

#[test]
fn sources_are_those_of_the_reference() {
    for name in LOGS {
        let Some((log, expected)) = expected(name) else { return };
        let recording = recorded(&log, Path::new(name)).unwrap();
        sources_agree(&recording, &expected);
        // All of these logs are from before the clock was mended.
        assert!(recording.notes[0].contains("85/84"), "{name}: {:?}", recording.notes);
    }
}

/// The flight was made by the same steps from the same rows.
#[test]
fn log201_is_its_flight() {
    let (Some((log, _)), Some(path)) =
        (expected("crazyflie_sd_load_log201"), shared("data/crazyswarm2/log201.csv"))
    else {
        return;
    };
    let recording = recorded(&log, Path::new("log201")).unwrap();
    smoothed_agrees(&recording, &Reference::read(&path));
}

/// The flight has the rows of the log with their own times, rounded to 0.1 ms, and six digits.
#[test]
fn the_old_log_is_its_flight() {
    let flight = shared("data/neuralswarm/c21_randomwalk_s_cf50_01.csv");
    let (Some((log, _)), Some(path)) = (expected("crazyflie_sd_old"), flight) else { return };
    let recording = recorded(&log, Path::new("old")).unwrap();
    let reference = Reference::read(&path);
    let signals = &recording.signals;
    let t = &signals.position.as_ref().unwrap().t;
    // The time at which the flight begins fits all rows to the rounding of 0.1 ms: see that the clock
    // does not drift.
    let row_of = |time: f64| t.partition_point(|&own| own < time - 2e-3);
    let offset = 2.018;
    let times = reference.column("t");
    let drift = times.iter().map(|time| (t[row_of(time + offset)] - time - offset).abs()).fold(0.0, f64::max);
    assert!(drift < 1.1e-4, "{drift}");
    let same = |name: &str, values: &[f64], tolerance: f64| {
        let rows = times.iter().zip(reference.column(name));
        let largest =
            rows.map(|(time, value)| (values[row_of(time + offset)] - value).abs()).fold(0.0, f64::max);
        assert!(largest <= tolerance, "{name}: {largest}");
    };
    let three = |names: [&str; 3], signal: &Signal<3>, tolerance: f64| {
        for (name, values) in names.iter().zip(&signal.values) {
            same(name, values, tolerance);
        }
    };
    three(POSITION, signals.position.as_ref().unwrap(), 1e-5);
    three(VELOCITY, signals.velocity.as_ref().unwrap(), 1e-5);
    three(RATES, signals.rates.as_ref().unwrap(), 1e-5);
    // Five digits of 10 m/s^2.
    three(FORCE, signals.specific_force.as_ref().unwrap(), 5.1e-4);
    for (name, values) in ANGLES.iter().zip(&angles(signals.attitude.as_ref().unwrap())) {
        same(name, values, 1e-5);
    }
    for (name, values) in COMMANDS.iter().zip(&signals.commands.as_ref().unwrap().values) {
        same(name, values, 1e-5);
    }
    same("vbat", &signals.voltage.as_ref().unwrap().values[0], 1e-5);
}

#[test]
fn damaged_logs_do_no_harm() {
    for (name, cases) in
        [("crazyflie_sd_two_events", 1500), ("crazyflie_sd_old", 700), ("crazyflie_sd_load_log201", 300)]
    {
        let Some(path) = shared(&format!("data/logs/{name}")) else { return };
        survives(name, &std::fs::read(path).unwrap(), cases);
    }
}

/// Bytes that are missing in the middle cost the rows around them.
#[test]
fn rows_behind_damage_are_there() {
    for (name, lost) in [("crazyflie_sd_two_events", 2), ("crazyflie_sd_log10", 2), ("crazyflie_sd_old", 20)]
    {
        let Some((whole, _)) = expected(name) else { return };
        let mut bytes = std::fs::read(shared(&format!("data/logs/{name}")).unwrap()).unwrap();
        let middle = bytes.len() / 2;
        bytes.drain(middle..middle + 3);
        let log = decode(&bytes, Path::new(name)).unwrap();
        let rows = |log: &logs::Log| log.tables.iter().map(|table| table.rows).sum::<usize>();
        assert!(rows(&log) + lost >= rows(&whole), "{name}: {} of {}", rows(&log), rows(&whole));
        assert!(!log.losses.damage.is_empty());
        assert_eq!(log.tables[0].times.last(), whole.tables[0].times.last());
    }
}
