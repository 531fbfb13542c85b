//! Crazyflie logs: what the firmware's own decoder finds in them, and the flights that were made from them.

mod common;

use std::path::Path;

use common::flight::{Reference, angles, smooth};
use common::{expected, expected_sum, shared};
use logs::{Format, Recording, Signal, TimeUnit, record};
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
        let recording = record(&log, Path::new(name)).unwrap();
        sources_agree(&recording, &expected);
        // All of these logs are from before the clock was mended.
        assert!(recording.notes[0].contains("85/84"), "{name}: {:?}", recording.notes);
    }
}

/// Names of the columns of a flight file, of the signals that they are from.
const POSITION: [&str; 3] = ["x", "y", "z"];
const VELOCITY: [&str; 3] = ["vx", "vy", "vz"];
const ANGLES: [&str; 3] = ["phi", "theta", "psi"];
const RATES: [&str; 3] = ["p", "q", "r"];
const FORCE: [&str; 3] = ["ax", "ay", "az"];
const COMMANDS: [&str; 4] = ["cmd1", "cmd2", "cmd3", "cmd4"];

/// The flight was made by the same steps from the same rows: means of three rows, then 100 Hz by interpolation. Doing both here leaves
/// the five digits that it is written with, 5e-5 of the value: of 10 m/s^2, 5 rad/s or rad, 1 m.
#[test]
fn log201_is_its_flight() {
    let (Some((log, _)), Some(path)) = (expected("crazyflie_sd_load_log201"), shared("data/crazyswarm2/log201.csv")) else {
        return;
    };
    let recording = record(&log, Path::new("log201")).unwrap();
    smoothed_agrees(&recording, &Reference::read(&path));
}

fn smoothed_agrees(recording: &Recording, reference: &Reference) {
    let signals = &recording.signals;
    let position = signals.position.as_ref().unwrap();
    let began = position.t[0];
    let smooth_near = |name: &str, t: &[f64], values: &[f64], offset: f64, tolerance: f64| {
        reference.near(name, t, &smooth(values), offset, [tolerance, tolerance]);
    };
    // The first 30 samples were cut off, gaps among them too: look where it fits.
    let misfit = |offset: &f64| {
        let parts = POSITION.iter().zip(&position.values);
        parts.map(|(name, values)| reference.differences(name, &position.t, &smooth(values), *offset).1).sum::<f64>()
    };
    let offsets = (30..100).map(|k| began + f64::from(k) * 0.01);
    let offset = offsets.min_by(|a, b| misfit(a).total_cmp(&misfit(b))).unwrap();
    for (name, values) in POSITION.iter().zip(&position.values) {
        smooth_near(name, &position.t, values, offset, 6e-5);
    }
    let three = |names: [&str; 3], signal: &Signal<3>, tolerance: f64| {
        for (name, values) in names.iter().zip(&signal.values) {
            smooth_near(name, &signal.t, values, offset, tolerance);
        }
    };
    three(VELOCITY, signals.velocity.as_ref().unwrap(), 6e-5);
    three(RATES, signals.rates.as_ref().unwrap(), 3e-4);
    three(FORCE, signals.specific_force.as_ref().unwrap(), 1e-3);
    let attitude = signals.attitude.as_ref().unwrap();
    for (name, values) in ANGLES.iter().zip(&angles(attitude)) {
        smooth_near(name, &attitude.t, values, offset, 6e-5);
    }
    let commands = signals.commands.as_ref().unwrap();
    for (name, values) in COMMANDS.iter().zip(&commands.values) {
        smooth_near(name, &commands.t, values, offset, 6e-5);
    }
    let names: Vec<&str> = signals.extra.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["load_north", "load_east", "load_down"]);
    for (name, signal) in &signals.extra {
        // Written with four digits.
        smooth_near(name, &signal.t, &signal.values[0], offset, 6e-4);
    }
}

/// The flight has the rows of the log with their own times, rounded to 0.1 ms, and six digits.
#[test]
fn the_old_log_is_its_flight() {
    let flight = shared("data/neuralswarm/c21_randomwalk_s_cf50_01.csv");
    let (Some((log, _)), Some(path)) = (expected("crazyflie_sd_old"), flight) else { return };
    let recording = record(&log, Path::new("old")).unwrap();
    let reference = Reference::read(&path);
    let signals = &recording.signals;
    let t = &signals.position.as_ref().unwrap().t;
    // The time at which the flight begins fits all rows to the rounding of 0.1 ms: see that the clock does not drift.
    let row_of = |time: f64| t.partition_point(|&own| own < time - 2e-3);
    let offset = 2.018;
    let times = reference.column("t");
    let drift = times.iter().map(|time| (t[row_of(time + offset)] - time - offset).abs()).fold(0.0, f64::max);
    assert!(drift < 1.1e-4, "{drift}");
    let same = |name: &str, values: &[f64], tolerance: f64| {
        let rows = times.iter().zip(reference.column(name));
        let largest = rows.map(|(time, value)| (values[row_of(time + offset)] - value).abs()).fold(0.0, f64::max);
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
