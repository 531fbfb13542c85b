//! Betaflight logs: what the format's own decoder (blackbox_decode) finds in them, and what the craft did.

use std::path::Path;

use crate::common::{damage, motion};
use logs::{Log, Recording, decode, record};
use proptest::prelude::*;
use serde_json::Value;

const FILES: [&str; 4] =
    ["betaflight_2_logs.bbl", "betaflight_44_logs.bbl", "betaflight_damaged.bbl", "betaflight_mag.BFL"];

/// A log of the shared data and what its own decoder finds in it.
fn log_and_expected(name: &str) -> Option<(Log, Value)> {
    let path = crate::common::shared(&format!("data/logs/{name}"))?;
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
    }
}

/// The recordings of a file of the shared data.
fn recordings(name: &str) -> Option<Vec<Recording>> {
    let (log, _) = log_and_expected(name)?;
    Some(record(&log, Path::new(name)).expect("recordings"))
}

/// A recording for each log that holds anything, from the expected fields.
#[test]
fn quantities_are_from_the_expected_fields() {
    for name in FILES {
        let Some((log, expected)) = log_and_expected(name) else { continue };
        let recordings = record(&log, Path::new(name)).expect("recordings");
        let filled: Vec<_> = log.tables.iter().filter(|table| table.rows > 0).collect();
        assert_eq!(recordings.len(), filled.len(), "{name}");
        for (recording, table) in recordings.iter().zip(filled) {
            let signals = &recording.signals;
            let sources = [
                ("position", signals.position.as_ref().map(|signal| &signal.source)),
                ("attitude", signals.attitude.as_ref().map(|signal| &signal.source)),
                ("rates", signals.rates.as_ref().map(|signal| &signal.source)),
                ("specific_force", signals.specific_force.as_ref().map(|signal| &signal.source)),
                ("commands", signals.commands.as_ref().map(|signal| &signal.source)),
                ("rotor_speed", signals.rotor_speed.as_ref().map(|signal| &signal.source)),
                ("voltage", signals.voltage.as_ref().map(|signal| &signal.source)),
            ];
            for (quantity, source) in sources {
                let expected = expected["flight_format"][quantity]
                    .as_str()
                    .map(|field| format!("{}: {field}", table.name));
                assert_eq!(source, expected.as_ref(), "{name}: {quantity}");
            }
            assert!(
                recording
                    .limits
                    .iter()
                    .any(|limit| limit.starts_with("attitude and position are not logged"))
            );
            assert!(recording.limits.iter().any(|limit| limit.starts_with("which way the motors turn")));
            let hints = &recording.hints;
            assert_eq!((hints.spin, hints.command_range), (None, Some([158.0, 2047.0])), "{name}");
            // Batteries of four cells and of six.
            let volts = motion::mean(&signals.voltage.as_ref().expect("voltage").values[0]);
            assert!((13.0..26.0).contains(&volts), "{name}: {volts}");
        }
    }
}

/// Signs and order of motors by what moves what; gravity on the accelerometer.
#[test]
fn motion_agrees_with_itself() {
    const STEP_S: f64 = 0.004;
    // Which log of which file, how the motors turn the craft right by yaw, mean specific force down.
    let flights = [
        (FILES[0], "log 2", "++--", -9.3),
        (FILES[1], "log 4", "+-+-", -11.1),
        (FILES[3], "log 1", "+-+-", -10.0),
    ];
    for (name, table, yaw, down) in flights {
        let Some(recordings) = recordings(name) else { continue };
        let of_log = |recording: &&Recording| {
            recording
                .signals
                .rates
                .as_ref()
                .is_some_and(|rates| rates.source.starts_with(&format!("{table}:")))
        };
        let signals = &recordings.iter().find(of_log).expect("the log").signals;
        let rates = signals.rates.as_ref().expect("rates");
        let times = motion::grid([rates.t[0] + 0.5, rates.t[rates.t.len() - 1] - 0.5], STEP_S);
        let rates = motion::at(rates, &times);
        let force = motion::at(signals.specific_force.as_ref().expect("specific force"), &times);
        let commands = motion::at(signals.commands.as_ref().expect("commands"), &times);
        let squared = commands.map(|motor| motor.iter().map(|command| (command / 1000.0).powi(2)).collect());
        let signs = rates.each_ref().map(|rate| motion::motor_signs(&squared, rate, STEP_S));
        assert_eq!(signs, ["+--+", "++--", yaw], "{name}");
        let mean = motion::mean(&force[2]);
        assert!((mean - down).abs() < 0.1, "{name}: {mean}");
    }
}

/// The throttle says when the craft flies.
#[test]
fn flights_lie_where_the_throttle_is_raised() {
    let flown = |name: &str, log: usize| {
        let recordings = recordings(name)?;
        Some((recordings[log].airborne.clone(), recordings[log].limits.clone()))
    };
    if let Some((airborne, limits)) = flown(FILES[1], 1) {
        let length: f64 = airborne.iter().map(|[start, end]| end - start).sum();
        assert!((100.0..146.0).contains(&length), "{airborne:?}");
        assert!(!limits.iter().any(|limit| limit.contains("never raised")));
    }
    if let Some((_, limits)) = flown(FILES[0], 1) {
        assert!(limits.iter().any(|limit| limit.contains("never raised")), "{limits:?}");
    }
}

/// A log written by the test: whole frames of single bytes, and what the firmware says of itself.
fn written(settings: &str, fields: &[&str], rows: usize, value: impl Fn(usize, usize) -> i32) -> Vec<u8> {
    let header = "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n";
    let names = [&["loopIteration", "time"], fields].concat();
    let list = |number: &str| vec![number; names.len()].join(",");
    let mut bytes = format!(
        "{header}H Field I name:{}\nH Field I signed:{}\nH Field I predictor:{}\nH Field I encoding:{}\n\
         H Field P predictor:{}\nH Field P encoding:{}\n{settings}",
        names.join(","),
        list("1"),
        list("0"),
        list("0"),
        list("0"),
        list("0")
    )
    .into_bytes();
    let number = |value: i64, bytes: &mut Vec<u8>| {
        let mut left = ((value << 1) ^ (value >> 63)) as u64 & 0xffff_ffff;
        while left > 0x7f {
            bytes.push(left as u8 | 0x80);
            left >>= 7;
        }
        bytes.push(left as u8);
    };
    for row in 0..rows {
        bytes.push(b'I');
        number(row as i64 * 32, &mut bytes);
        // A second before the clock of 32 bits wraps.
        number((0xffff_ffff - 1_000_000 + row as i64 * 10_000) as u32 as i32 as i64, &mut bytes);
        for field in 0..fields.len() {
            number(value(row, field).into(), &mut bytes);
        }
    }
    bytes.extend(b"E\xffEnd of log\0");
    bytes
}

pub(crate) const BETAFLIGHT: &str = "H Firmware revision:Betaflight 4.5.1 (abc) STM32H743\nH gyro_scale:0x3f800000\nH acc_1G:2048\n\
                          H motorOutput:158,2047\nH motor_poles:14\nH blackbox_high_resolution:1\nH Craft name:Test\n";
pub(crate) const INAV: &str = "H Firmware revision:INAV 7.1.0 (abc) MATEKF405\nH gyro_scale:0x3f800000\nH acc_1G:512\nH motorOutput:1000,2000\n";
const FIELDS: [&str; 15] = [
    "gyroADC[0]",
    "gyroADC[1]",
    "gyroADC[2]",
    "accSmooth[0]",
    "accSmooth[1]",
    "accSmooth[2]",
    "motor[0]",
    "motor[1]",
    "motor[2]",
    "motor[3]",
    "eRPM[0]",
    "eRPM[1]",
    "eRPM[2]",
    "eRPM[3]",
    "vbatLatest",
];

fn recorded(bytes: &[u8]) -> Result<Vec<Recording>, String> {
    let path = Path::new("written");
    decode(bytes, path).and_then(|log| record(&log, path)).map_err(|error| {
        damage::check_message(&error);
        error.to_string()
    })
}

/// Scales, axes and order; the clock goes on over its wrap; numbers too wide for 16 bits are kept.
#[test]
fn quantities_of_a_written_log() {
    let values = [900, 450, 90, 0, 0, 2048, 1000, 1001, 1002, 1003, 70, 71, 72, 73, 1512];
    let bytes =
        written(
            BETAFLIGHT,
            &FIELDS,
            300,
            |row, field| if row == 299 && field == 6 { 70_000 } else { values[field] },
        );
    let recording = &recorded(&bytes).expect("recordings")[0];
    let signals = &recording.signals;
    let first = |values: &[Vec<f64>]| values.iter().map(|values| values[0]).collect::<Vec<_>>();
    let near = |a: Vec<f64>, b: &[f64]| {
        assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}")
    };
    let rates = signals.rates.as_ref().expect("rates");
    near(first(&rates.values), &[90.0_f64.to_radians(), -45.0_f64.to_radians(), -9.0_f64.to_radians()]);
    assert_eq!(rates.t.len(), 300);
    assert!(rates.t.windows(2).all(|t| (t[1] - t[0] - 0.01).abs() < 1e-6));
    near(first(&signals.specific_force.as_ref().expect("force").values), &[0.0, 0.0, -9.81]);
    let commands = signals.commands.as_ref().expect("commands");
    near(first(&commands.values), &[1003.0, 1001.0, 1000.0, 1002.0]);
    assert_eq!(commands.values[2][299], 70_000.0);
    let speed = |erpm: f64| erpm * 100.0 / 7.0 * std::f64::consts::TAU / 60.0;
    near(
        first(&signals.rotor_speed.as_ref().expect("speeds").values),
        &[speed(73.0), speed(71.0), speed(70.0), speed(72.0)],
    );
    near(first(&signals.voltage.as_ref().expect("voltage").values), &[15.12]);
    assert_eq!(recording.hints.name.as_deref(), Some("Test"));
    assert_eq!(recording.hints.command_unit.as_deref(), Some("1"));
}

/// INAV: north, east, up in centimetres; roll right, pitch down, heading.
#[test]
fn inav_knows_where_it_is() {
    let fields = [
        &FIELDS[..10],
        &[
            "navPos[0]",
            "navPos[1]",
            "navPos[2]",
            "navVel[0]",
            "navVel[1]",
            "navVel[2]",
            "attitude[0]",
            "attitude[1]",
            "attitude[2]",
            "vbat",
        ],
    ]
    .concat();
    let values = [0, 0, 0, 0, 0, 512, 1500, 1500, 1500, 1500, 100, 200, 300, 10, 20, 30, 100, 200, 900, 1590];
    let recording = &recorded(&written(INAV, &fields, 10, |_, field| values[field])).expect("recordings")[0];
    let signals = &recording.signals;
    let first = |values: &[Vec<f64>]| values.iter().map(|values| values[0]).collect::<Vec<_>>();
    assert_eq!(first(&signals.position.as_ref().expect("position").values), [1.0, 2.0, -3.0]);
    assert_eq!(first(&signals.velocity.as_ref().expect("velocity").values), [0.1, 0.2, -0.3]);
    let q = nalgebra::Vector4::from_vec(first(&signals.attitude.as_ref().expect("attitude").values));
    let angles = model::frames::euler_from_quaternion(&q).map(f64::to_degrees);
    assert!((angles - nalgebra::Vector3::new(10.0, -20.0, 90.0)).norm() < 1e-9, "{angles}");
    assert!((signals.voltage.as_ref().expect("voltage").values[0][0] - 15.9).abs() < 1e-9);
    assert_eq!(recording.hints.command_unit.as_deref(), Some("us"));
}

#[test]
fn what_is_no_quadcopter_or_empty_is_refused() {
    let hexa = [&FIELDS[..10], &["motor[4]", "motor[5]"]].concat();
    let error = recorded(&written(BETAFLIGHT, &hexa, 10, |_, _| 1000)).expect_err("six motors");
    assert!(error.contains("6 motors"), "{error}");
    let error = recorded(&written(BETAFLIGHT, &FIELDS, 0, |_, _| 0).repeat(3)).expect_err("empty");
    assert!(error.contains("all its 3 logs are empty"), "{error}");
    let unknown = written(BETAFLIGHT, &FIELDS, 5, |_, _| 0);
    let at = memchr::memmem::find(&unknown, b"I encoding:0").expect("the encodings") + 11;
    let unknown = [&unknown[..at], b"77", &unknown[at + 1..]].concat();
    let log = decode(&unknown, Path::new("unknown")).expect("a log");
    assert!(log.losses.damage[0].contains("encoding 77 is not known"), "{:?}", log.losses);
}

/// What lies before and after a damage stays, however long it is.
#[test]
fn rows_on_both_sides_of_a_damage_stay() {
    let Some(path) = crate::common::shared("data/logs/betaflight_44_logs.bbl") else { return };
    let whole = std::fs::read(&path).expect("a log");
    let rows = |bytes: &[u8]| {
        let log = decode(bytes, &path).expect("a log");
        let table = &log.tables[3];
        (table.rows, table.times.first().copied(), table.times.last().copied(), log.losses.damage)
    };
    let undamaged = rows(&whole);
    assert!(undamaged.3.is_empty(), "{:?}", undamaged.3);
    let middle = whole.len() / 2;
    for (length, byte, most) in
        [(1, 0x17, 40), (400, 0, 80), (400, 0xff, 80), (100_000, 0, 4000), (100_000, 0xff, 4000)]
    {
        let mut damaged = whole.clone();
        damaged[middle..middle + length].fill(byte);
        let found = rows(&damaged);
        assert!(undamaged.0 - found.0 < most, "{length} times {byte}: {} of {}", found.0, undamaged.0);
        assert_eq!((found.1, found.2), (undamaged.1, undamaged.2), "{length} times {byte}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_logs_neither_panic_nor_fill_the_memory(changes in damage::changes(), inav in any::<bool>()) {
        let settings = if inav { INAV } else { BETAFLIGHT };
        let mut bytes = written(settings, &FIELDS, 30, |row, field| (row * field) as i32 - 200);
        changes.iter().for_each(|change| change.apply(&mut bytes));
        damage::survives(&bytes);
    }

    #[test]
    fn damaged_real_logs_neither_panic_nor_fill_the_memory(changes in damage::changes(), short in any::<bool>()) {
        static REAL: std::sync::OnceLock<[Option<Vec<u8>>; 2]> = std::sync::OnceLock::new();
        let read = |index: usize| crate::common::shared(&format!("data/logs/{}", FILES[index])).map(|path| std::fs::read(path).expect("a log"));
        if let Some(mut bytes) = REAL.get_or_init(|| [read(3), read(2)])[usize::from(short)].clone() {
            changes.iter().for_each(|change| change.apply(&mut bytes));
            damage::survives(&bytes);
        }
    }

    #[test]
    fn anything_neither_panics_nor_fills_the_memory(mut bytes in proptest::collection::vec(any::<u8>(), 0..3000)) {
        let log = written(BETAFLIGHT, &FIELDS, 0, |_, _| 0);
        bytes.splice(0..0, log[..log.len() - 13].iter().copied());
        damage::survives(&bytes);
    }
}
