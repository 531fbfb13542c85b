//! PX4 logs: what pyulog finds in them, what a reference conversion makes of them, and damaged ones.

use std::path::{Path, PathBuf};

use logs::{Log, LogError, Recording, Signal, Table, Values};
use proptest::prelude::*;

use crate::common::{recorded, shared};

const SYNC: [u8; 8] = [0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12];

/// The PX4 logs with what pyulog finds in them.
fn expected() -> Vec<(PathBuf, serde_json::Value)> {
    let Some(folder) = shared("data/logs") else { return Vec::new() };
    let text = std::fs::read_to_string(folder.join("expected.json")).expect("expected.json");
    let all: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text).expect("JSON");
    let logs = all.into_iter().filter(|(_, log)| log["format"] == "ulog");
    let logs: Vec<_> = logs.map(|(name, log)| (folder.join(name), log)).collect();
    assert_eq!(logs.len(), 7);
    logs
}

fn decoded(path: &Path) -> Log {
    logs::decode(&std::fs::read(path).expect("log"), path).expect("decoded")
}

fn named(name: &str) -> Option<(Log, PathBuf)> {
    let path = shared(&format!("data/logs/{name}"))?;
    Some((decoded(&path), path))
}

#[test]
fn tables_are_those_of_pyulog() {
    for (path, expected) in expected() {
        let log = decoded(&path);
        let topics = expected["topics"].as_object().expect("topics");
        assert_eq!(log.tables.len(), topics.len(), "{path:?}");
        for (name, topic) in topics {
            let place = format!("{path:?} {name}");
            let table = log.table(name).expect(&place);
            let back = table.times.windows(2).filter(|pair| pair[1] < pair[0]).count();
            assert_eq!(topic["count"], table.rows, "{place}");
            assert_eq!(topic["first_us"], *table.times.first().expect("rows"), "{place}");
            assert_eq!(topic["last_us"], *table.times.last().expect("rows"), "{place}");
            assert_eq!(topic["out_of_order"].as_u64().unwrap_or(0), back as u64, "{place}");
            for (column, of_column) in topic["sums"].as_object().into_iter().flatten() {
                let values = table.column(column).expect(&place).to_f64();
                let sum = values.iter().filter(|value| !value.is_nan()).sum::<f64>();
                let nan = values.iter().filter(|value| value.is_nan()).count();
                let expected = of_column["sum"].as_f64().expect("sum");
                assert!(
                    (sum - expected).abs() <= 1e-9 * expected.abs(),
                    "{place} {column}: {sum} {expected}"
                );
                assert_eq!(of_column["nan"].as_u64().unwrap_or(0), nan as u64, "{place} {column}");
            }
            for column in &table.columns {
                assert_eq!(column.values.len(), table.rows, "{place} {}", column.name);
            }
        }
        assert_eq!(expected["samples"], log.tables.iter().map(|table| table.rows).sum::<usize>(), "{path:?}");
    }
}

#[test]
fn all_else_is_that_of_pyulog() {
    for (path, expected) in expected() {
        let log = decoded(&path);
        let told = |name: &str| log.information[name].parse::<u64>().expect("number");
        assert_eq!(expected["dropouts"]["count"], log.losses.dropouts, "{path:?}");
        let dropouts_ms = (log.losses.dropouts_s * 1e3).round() as u64;
        assert_eq!(expected["dropouts"]["total_ms"], dropouts_ms, "{path:?}");
        assert_eq!(log.losses.damage, Vec::<String>::new(), "{path:?}");
        assert_eq!(expected["parameters"], log.parameters.len(), "{path:?}");
        assert_eq!(expected["changed_parameters"], told("changed_parameters"), "{path:?}");
        assert_eq!(expected["messages"], told("logged_messages"), "{path:?}");
        assert_eq!(expected["tagged_messages"], told("logged_messages_tagged"), "{path:?}");
        assert_eq!(expected["start_us"], told("start_us"), "{path:?}");
        assert_eq!(expected["appended"], told("appended_parts") > 0, "{path:?}");
        assert_eq!(expected["mav_type"].as_f64(), log.parameters.get("MAV_TYPE").copied(), "{path:?}");
        assert_eq!(expected["autostart"].as_f64(), log.parameters.get("SYS_AUTOSTART").copied(), "{path:?}");
        assert_eq!(
            expected["hardware"].as_str(),
            log.information.get("ver_hw").map(String::as_str),
            "{path:?}"
        );
    }
}

fn source<const N: usize>(signal: &Option<Signal<N>>) -> Option<&str> {
    signal.as_ref().map(|signal| signal.source.as_str())
}

#[test]
fn quantities_come_from_the_expected_topics() {
    let mut accepted = 0;
    for (path, expected) in expected() {
        let Ok(Recording { signals, .. }) = recorded(&decoded(&path), &path) else { continue };
        accepted += 1;
        let from = &expected["flight_format"];
        assert_eq!(from["position"].as_str(), source(&signals.position), "{path:?}");
        assert_eq!(from["attitude"].as_str(), source(&signals.attitude), "{path:?}");
        assert_eq!(from["rates"].as_str(), source(&signals.rates), "{path:?}");
        assert_eq!(from["specific_force"].as_str(), source(&signals.specific_force), "{path:?}");
        assert_eq!(from["commands"].as_str(), source(&signals.commands), "{path:?}");
        assert_eq!(from["rotor_speed"].as_str(), source(&signals.rotor_speed), "{path:?}");
        assert_eq!(from["voltage"].as_str(), source(&signals.voltage), "{path:?}");
        // A tenth of a volt is no voltage: that craft has no sensor.
        let has_voltage = signals.voltage.as_ref().is_some_and(|voltage| !voltage.t.is_empty());
        assert_eq!(has_voltage, !path.ends_with("px4_indoor_vision.ulg"), "{path:?}");
    }
    assert!(accepted == 3 || shared("data/logs").is_none());
}

#[test]
fn other_crafts_are_refused_by_name() {
    for (name, reason) in [
        ("px4_fixed_wing.ulg", "fixed-wing"),
        ("px4_sample_small.ulg", "VTOL"),
        ("px4_appended_multiple.ulg", "never armed"),
        ("px4_custom_topics.ulg", "vehicle_attitude"),
    ] {
        let Some((log, path)) = named(name) else { return };
        let refused = recorded(&log, &path).expect_err(name);
        assert!(matches!(refused, LogError::Refused { .. }), "{name}");
        let text = refused.to_string();
        assert!(text.contains(reason) && !text.contains(char::is_control), "{text}");
    }
}

fn at<const N: usize>(signal: &Option<Signal<N>>, t: f64) -> [f64; N] {
    let signal = signal.as_ref().expect("signal");
    let next = signal.t.partition_point(|&time| time < t).clamp(1, signal.t.len() - 1);
    let part = (t - signal.t[next - 1]) / (signal.t[next] - signal.t[next - 1]);
    std::array::from_fn(|axis| {
        let values = &signal.values[axis];
        values[next - 1] + part * (values[next] - values[next - 1])
    })
}

/// Roll, pitch, yaw of an interpolated quaternion.
fn angles(q: [f64; 4]) -> [f64; 3] {
    let length = q.iter().map(|q| q * q).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|q| q / length);
    [
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
        (2.0 * (w * y - z * x)).asin(),
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
    ]
}

fn assert_close(what: &str, found: &[f64], expected: &[f64], tolerance: f64) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{what}: {found} {expected}");
    }
}

/// Position, velocity, angles, rates after a time, as the reference conversion (linear, 50 Hz) has them.
type Sampled = (f64, [f64; 12]);

/// Samples of the reference conversion (pyulog, numpy) at times after the beginning of its grid.
#[test]
fn quantities_are_those_of_the_reference_conversion() {
    const NAN: f64 = f64::NAN;
    let sampled: [(&str, f64, [Sampled; 2]); 3] = [
        (
            "px4_quadrotor.ulg",
            110.085419,
            [
                (
                    20.0,
                    [
                        NAN, NAN, -1.93641, NAN, NAN, -0.0368, 0.00668, -0.0029, 0.38153, 0.00285, -0.01462,
                        0.0286,
                    ],
                ),
                (
                    35.0,
                    [
                        NAN, NAN, -1.48824, NAN, NAN, -0.17099, 0.01184, 0.02288, 0.67584, 0.15976, -0.1827,
                        -0.0037,
                    ],
                ),
            ],
        ),
        (
            "px4_indoor_vision.ulg",
            163.286699,
            [
                (
                    20.0,
                    [
                        -0.70435, 3.56733, -1.07203, -0.33705, 0.22029, 0.00851, 0.06193, 0.05238, 1.4065,
                        0.36823, -0.22837, -0.04745,
                    ],
                ),
                (
                    35.0,
                    [
                        -2.52424, 4.24367, -1.00509, 0.06304, 0.04948, -0.02884, -0.0279, 0.00488, 1.44056,
                        0.04196, 0.03695, -0.0023,
                    ],
                ),
            ],
        ),
        (
            "px4_esc_rpm.ulg",
            5080.501645,
            [
                (
                    20.0,
                    [
                        -6.05433, -4.48248, -16.51295, 5.37541, 0.85887, 0.34845, -0.09412, -0.34237,
                        0.54737, 1.2294, 0.52514, -0.16848,
                    ],
                ),
                (
                    35.0,
                    [
                        -0.653, -2.20614, -8.18334, -0.00056, 0.02965, 0.71765, -0.02273, 0.01863, -1.83074,
                        -0.19789, -0.02205, 0.12839,
                    ],
                ),
            ],
        ),
    ];
    for (name, start, samples) in sampled {
        let Some((log, path)) = named(name) else { return };
        let signals = recorded(&log, &path).expect(name).signals;
        for (after, expected) in samples {
            let t = start + after;
            let mut found = Vec::new();
            found.extend(at(&signals.position, t));
            found.extend(at(&signals.velocity, t));
            found.extend(angles(at(&signals.attitude, t)));
            found.extend(at(&signals.rates, t));
            for (number, (found, expected)) in found.iter().zip(expected).enumerate() {
                let same = (found - expected).abs() < 2e-5 || (found.is_nan() && expected.is_nan());
                assert!(same, "{name} {after} s, number {number}: {found} {expected}");
            }
        }
    }
}

#[test]
fn electrics_are_those_of_the_reference_conversion() {
    let Some((log, path)) = named("px4_esc_rpm.ulg") else { return };
    let recording = recorded(&log, &path).expect("quadcopter");
    let signals = &recording.signals;
    let t = 5080.501645 + 20.0;
    assert_close(
        "commands",
        &at(&signals.commands, t),
        &[4409.80334, 4603.4707, 5107.14053, 5063.38966],
        2e-5,
    );
    assert_close("speeds", &at(&signals.rotor_speed, t), &[244.41591, 254.72483, 279.08691, 265.65944], 2e-5);
    assert_close("voltage", &at(&signals.voltage, t), &[21.9346], 2e-5);
    assert_eq!(recording.hints.command_range, Some([0.0, 8191.0]));
    assert_eq!(recording.hints.cells, Some(6));
    // Zurich (the log's latitude is 47.36 degrees): 9.8068 m/s^2.
    assert!((recording.hints.gravity.expect("GPS") - 9.8068).abs() < 2e-4);
    assert!(recording.limits.iter().any(|limit| limit.contains("rotor speeds are logged at 3 Hz")));
}

/// Where the torques that were asked for are logged faster than the motors, commands come from them.
#[test]
fn rebuilt_commands_agree_with_the_logged_ones() {
    for name in ["px4_quadrotor.ulg", "px4_indoor_vision.ulg"] {
        let Some((log, path)) = named(name) else { return };
        let recording = recorded(&log, &path).expect(name);
        let commands = recording.signals.commands.as_ref().expect("commands");
        let logged = log.table("actuator_motors[0]").expect("motors");
        assert!(commands.t.len() > 4 * logged.rows, "{name}");
        assert!(recording.notes.iter().any(|note| note.contains("used between its rows")), "{name}");
        let Some(Values::U64(samples)) = logged.column("timestamp_sample") else {
            panic!("times of samples")
        };
        let motors = logged.group(["control[2]", "control[0]", "control[3]", "control[1]"]).expect("motors");
        let mut compared = 0;
        for (row, &us) in samples.iter().enumerate() {
            let Some(place) = commands.t.iter().position(|t| (t * 1e6).round() == us as f64) else {
                continue;
            };
            for (ours, theirs) in commands.values.iter().zip(&motors) {
                assert_eq!(ours[place], theirs[row], "{name} row {row}");
            }
            compared += 1;
        }
        assert!(compared > 700, "{name}: {compared}");
        assert!(commands.values.iter().flatten().all(|command| (0.0..=1.0).contains(command)), "{name}");
        assert_eq!(recording.hints.spin, Some(["cw", "ccw", "cw", "ccw"]), "{name}");
    }
}

fn in_flight(recording: &Recording, t: f64) -> bool {
    let within = |spans: &[[f64; 2]]| spans.iter().any(|[start, end]| (*start..=*end).contains(&t));
    within(&recording.airborne) && !within(&recording.untrusted)
}

/// Slope of b over a, through zero.
fn slope(pairs: &[(f64, f64)]) -> f64 {
    pairs.iter().map(|(a, b)| a * b).sum::<f64>() / pairs.iter().map(|(a, _)| a * a).sum::<f64>()
}

/// Turning between two attitudes over the time between them, in body axes.
fn turning(a: [f64; 4], b: [f64; 4], dt: f64) -> [f64; 3] {
    let [w, x, y, z] = b;
    let [aw, ax, ay, az] = a;
    [aw * x - ax * w - ay * z + az * y, aw * y + ax * z - ay * w - az * x, aw * z - ax * y + ay * x - az * w]
        .map(|part| 2.0 * part / dt)
}

/// Axes and signs: the gyro is what the attitude turns by.
#[test]
fn rates_are_those_of_the_attitude() {
    for (name, axes, band) in [
        // Its estimator corrected the heading all the time, and told so at the end of the flight.
        ("px4_quadrotor.ulg", 0..2, 0.9..1.15),
        ("px4_indoor_vision.ulg", 0..3, 0.9..1.15),
        // Its gyro is logged at 8 Hz: single samples stand for a step of the attitude.
        ("px4_esc_rpm.ulg", 0..3, 0.8..1.15),
    ] {
        let Some((log, path)) = named(name) else { return };
        let recording = recorded(&log, &path).expect(name);
        let attitude = recording.signals.attitude.as_ref().expect("attitude");
        let rates = recording.signals.rates.as_ref().expect("rates");
        let mut pairs = [const { Vec::new() }; 3];
        for row in 1..attitude.t.len() {
            let (start, end) = (attitude.t[row - 1], attitude.t[row]);
            let inside = rates.t.partition_point(|&t| t < start)..rates.t.partition_point(|&t| t <= end);
            if inside.is_empty() || !in_flight(&recording, start) || !in_flight(&recording, end) {
                continue;
            }
            let quaternion = |row: usize| std::array::from_fn(|axis| attitude.values[axis][row]);
            let turned = turning(quaternion(row - 1), quaternion(row), end - start);
            for axis in 0..3 {
                let count = inside.len() as f64;
                let mean = rates.values[axis][inside.clone()].iter().sum::<f64>() / count;
                pairs[axis].push((turned[axis], mean));
            }
        }
        for axis in axes {
            let pairs = &pairs[axis];
            let slope = slope(pairs);
            println!("{name} axis {axis}: gyro over rates from attitude {slope:.3}, {} steps", pairs.len());
            assert!(band.contains(&slope), "{name} axis {axis}: {slope}");
        }
    }
}

#[test]
fn velocity_is_that_of_the_position() {
    for (name, axes) in
        [("px4_quadrotor.ulg", 2..3), ("px4_indoor_vision.ulg", 0..3), ("px4_esc_rpm.ulg", 0..3)]
    {
        let Some((log, path)) = named(name) else { return };
        let recording = recorded(&log, &path).expect(name);
        let position = recording.signals.position.as_ref().expect("position");
        let velocity = recording.signals.velocity.as_ref().expect("velocity");
        for axis in axes {
            let rows = (1..position.t.len()).filter(|&row| {
                in_flight(&recording, position.t[row - 1]) && in_flight(&recording, position.t[row])
            });
            let pairs: Vec<_> = rows
                .map(|row| {
                    let dt = position.t[row] - position.t[row - 1];
                    let moved = (position.values[axis][row] - position.values[axis][row - 1]) / dt;
                    (moved, 0.5 * (velocity.values[axis][row] + velocity.values[axis][row - 1]))
                })
                .collect();
            let slope = slope(&pairs);
            println!("{name} axis {axis}: velocity over change of position {slope:.3}");
            assert!((0.84..1.03).contains(&slope), "{name} axis {axis}: {slope}");
        }
    }
}

#[test]
fn specific_force_carries_the_craft() {
    for (name, band) in [
        ("px4_quadrotor.ulg", -9.9..-9.7),
        ("px4_indoor_vision.ulg", -9.9..-9.7),
        // A flight of hard turns.
        ("px4_esc_rpm.ulg", -11.1..-10.5),
    ] {
        let Some((log, path)) = named(name) else { return };
        let recording = recorded(&log, &path).expect(name);
        let force = recording.signals.specific_force.as_ref().expect("force");
        let flying = force.t.iter().zip(&force.values[2]).filter(|(t, _)| in_flight(&recording, **t));
        let values: Vec<f64> = flying.map(|(_, force)| *force).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        println!("{name}: mean specific force along z {mean:.3}");
        assert!(band.contains(&mean), "{name}: {mean}");
    }
}

// ---- Logs written here.

/// A ULog being written.
pub(crate) struct Writer(pub(crate) Vec<u8>);

impl Writer {
    pub(crate) fn new() -> Self {
        let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
        bytes.extend(1_000_000_u64.to_le_bytes());
        let mut writer = Self(bytes);
        writer.record(b'B', &[0; 40]);
        writer
    }

    pub(crate) fn record(&mut self, kind: u8, body: &[u8]) -> &mut Self {
        self.0.extend(u16::try_from(body.len()).expect("short").to_le_bytes());
        self.0.push(kind);
        self.0.extend(body);
        self
    }

    pub(crate) fn pair(&mut self, kind: u8, key: &str, value: &[u8]) -> &mut Self {
        self.record(kind, &[&[key.len() as u8], key.as_bytes(), value].concat())
    }

    pub(crate) fn subscribe(&mut self, number: u16, instance: u8, name: &str) -> &mut Self {
        let [low, high] = number.to_le_bytes();
        self.record(b'A', &[&[instance, low, high], name.as_bytes()].concat())
    }

    pub(crate) fn row(&mut self, number: u16, time_us: u64, fields: &[u8]) -> &mut Self {
        self.record(b'D', &[&number.to_le_bytes()[..], &time_us.to_le_bytes(), fields].concat())
    }

    fn decoded(&self) -> Log {
        logs::decode(&self.0, Path::new("written.ulg")).expect("decoded")
    }
}

/// A quadcopter that hovers, at 50 Hz: all that a flight needs, in some twenty kilobytes.
pub(crate) fn hover(parameters: &[(&str, i32)], rows: u64) -> Writer {
    hover_with(parameters, rows, |_, _| {})
}

/// The same; `before` may write something before each row, whose number it is told.
fn hover_with(parameters: &[(&str, i32)], rows: u64, before: impl Fn(&mut Writer, u64)) -> Writer {
    let mut log = Writer::new();
    log.record(b'F', b"vehicle_attitude:uint64_t timestamp;uint64_t timestamp_sample;float[4] q;");
    log.record(b'F', b"vehicle_local_position:uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;uint8_t xy_reset_counter;bool z_valid;");
    log.record(
        b'F',
        b"actuator_motors:uint64_t timestamp;float[4] control;uint16_t flags;uint8_t[6] _padding0;",
    );
    log.record(b'F', b"vehicle_status:uint64_t timestamp;uint8_t arming_state;");
    log.pair(b'I', "char[3] sys_name", b"PX4");
    for (name, value) in parameters {
        log.pair(b'P', &format!("int32_t {name}"), &value.to_le_bytes());
    }
    for (number, name) in ["vehicle_attitude", "vehicle_local_position", "actuator_motors", "vehicle_status"]
        .into_iter()
        .enumerate()
    {
        log.subscribe(number as u16, 0, name);
    }
    log.row(3, 1_000_000, &[2]);
    for row in 0..rows {
        before(&mut log, row);
        let us = 1_000_000 + row * 20_000;
        let floats =
            |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        log.row(0, us + 300, &[&us.to_le_bytes()[..], &floats(&[-1.0, 0.0, 0.0, 0.0])].concat());
        let jumped = u8::from(row >= rows / 2);
        log.row(1, us, &[&floats(&[0.0, 0.0, -1.0, 0.0, 0.0, 0.0])[..], &[jumped, 1]].concat());
        log.row(2, us, &[&floats(&[0.1, 0.2, 0.3, f32::NAN])[..], &[0, 0]].concat());
        if row % 20 == 0 {
            log.record(b'S', &SYNC);
        }
    }
    log
}

#[test]
fn a_written_log_is_read() {
    let log = hover(&[("MAV_TYPE", 2)], 100).decoded();
    assert_eq!(log.losses.damage, Vec::<String>::new());
    let recording = recorded(&log, Path::new("written.ulg")).expect("quadcopter");
    let attitude = recording.signals.attitude.as_ref().expect("attitude");
    // The time of the sample, not of its publication.
    assert_eq!((attitude.t.len(), attitude.t[0]), (100, 1.0));
    // PX4's motors 3, 1, 4, 2; not a number is a motor that is off.
    let commands = recording.signals.commands.as_ref().expect("commands");
    assert_close("order", &[commands.values[0][0], commands.values[1][0]], &[0.3, 0.1], 1e-6);
    assert!(commands.values[2][0].is_nan());
    assert_close("order", &[commands.values[3][0]], &[0.2], 1e-6);
    // The jump between rows 49 and 50.
    assert_eq!(recording.untrusted.len(), 1);
    assert_close("jump", &recording.untrusted[0], &[1.93, 2.05], 1e-9);
    assert_eq!(recording.airborne.len(), 1);
}

/// The dropout of 40 ms stands before row 100, so it begins with row 99. Less than a gap of 50 Hz, it is cut as one.
#[test]
fn a_dropout_is_cut_out_where_it_was() {
    let written = hover_with(&[("MAV_TYPE", 2)], 300, |log, row| {
        if row == 100 {
            log.record(b'O', &40_u16.to_le_bytes());
        }
    });
    let log = written.decoded();
    let [span] = log.losses.dropout_spans_s[..] else { panic!("{:?}", log.losses) };
    assert_close("dropout", &span, &[2.98, 3.02], 1e-3);
    let import =
        logs::import_bytes(written.0.clone(), Path::new("written.ulg"), &flights::ColumnMap::default())
            .expect("flight");
    let [part] = &import.flights[..] else { panic!("{} flights", import.flights.len()) };
    let rows = part.cuts.iter().find(|cut| cut.why == logs::Cause::Dropout).expect("cut");
    assert_close("cut", &rows.span, &[2.96, 3.04], 1e-6);
    assert_eq!((part.cuts.len(), part.flight.len()), (2, 297));
    // The position that was reset between rows 149 and 150.
    let position = part.cuts.iter().find(|cut| cut.why == logs::Cause::Position).expect("reset");
    assert_close("reset", &position.span, &[3.93, 4.05], 1e-9);
}

/// The log of a VTOL, in which rows that had waited stand just before the dropout: it begins with the latest of all rows, and
/// nothing is of the time that it lasted, but for one row of its first millisecond that was published when it began.
#[test]
fn no_row_lies_within_a_dropout() {
    let Some((log, _)) = named("px4_sample_small.ulg") else { return };
    let [[start_s, end_s]] = log.losses.dropout_spans_s[..] else { panic!("{:?}", log.losses) };
    assert!((end_s - start_s - 0.03).abs() < 1e-9 && (start_s - 20.33).abs() < 0.001, "{start_s}");
    let times: Vec<f64> = log.tables.iter().flat_map(logs::Table::times_s).collect();
    assert_eq!(times.iter().filter(|time| (start_s + 1e-3..end_s).contains(*time)).count(), 0);
    assert!(times.iter().filter(|time| (start_s - 0.05..start_s).contains(*time)).count() > 20);
}

#[test]
fn a_rotor_that_moves_in_flight_makes_it_two() {
    let mut parameters = vec![("MAV_TYPE", 2), ("CA_ROTOR_COUNT", 4)];
    for (names, [front, right, spin]) in [
        (["CA_ROTOR0_PX", "CA_ROTOR0_PY", "CA_ROTOR0_KM"], [2, 2, 1]),
        (["CA_ROTOR1_PX", "CA_ROTOR1_PY", "CA_ROTOR1_KM"], [-2, -2, 1]),
        (["CA_ROTOR2_PX", "CA_ROTOR2_PY", "CA_ROTOR2_KM"], [2, -2, -1]),
        (["CA_ROTOR3_PX", "CA_ROTOR3_PY", "CA_ROTOR3_KM"], [-2, 2, -1]),
    ] {
        parameters.extend(names.into_iter().zip([front, right, spin]));
    }
    let written = hover_with(&parameters, 600, |log, row| {
        // Of no account, and then of some.
        if row == 100 {
            log.pair(b'P', "float MC_ROLLRATE_P", &0.2_f32.to_le_bytes());
        }
        if row == 300 {
            log.pair(b'P', "float CA_ROTOR0_PX", &3.0_f32.to_le_bytes());
        }
    });
    let recordings = logs::record(&written.decoded(), Path::new("written.ulg")).expect("quadcopter");
    let front_right = |k: usize| recordings[k].hints.rotor_positions_m.expect("positions")[1];
    assert_eq!((recordings.len(), front_right(0), front_right(1)), (2, [2.0, 2.0], [3.0, 2.0]));
    let import =
        logs::import_bytes(written.0.clone(), Path::new("written.ulg"), &flights::ColumnMap::default())
            .expect("flights");
    let [first, second] = &import.flights[..] else { panic!("{} flights", import.flights.len()) };
    assert_close("ends", &[first.span[1], second.span[0]], &[6.98, 6.98], 0.03);
    assert!(
        import.notes.iter().any(|note| note.starts_with("CA_ROTOR0_PX was set from 2 to 3 at 7.0 s")),
        "{:?}",
        import.notes
    );
}

/// Times that go back, come twice or are damaged.
#[test]
fn times_are_put_in_order() {
    let mut log = hover(&[("MAV_TYPE", 2)], 100);
    let upright = [&[0; 8][..], &1.0_f32.to_le_bytes(), &[0; 12]].concat();
    for us in [1_010_000, 1_000_300, u64::MAX, 900_000_000_000] {
        log.row(0, us, &upright);
    }
    let recording = recorded(&log.decoded(), Path::new("written.ulg")).expect("quadcopter");
    let attitude = recording.signals.attitude.expect("attitude");
    assert!(attitude.t.windows(2).all(|pair| pair[0] < pair[1]));
    assert_eq!(attitude.t.len(), 102);
    assert!((attitude.t[101] - 2.98).abs() < 1e-9);
    // Signs are continuous, and the first one is that of an upright craft.
    assert!(attitude.values[0].iter().all(|w| *w == 1.0));
    assert_eq!(recording.notes.len(), 2, "{:?}", recording.notes);
}

#[test]
fn crafts_that_are_no_x_are_refused() {
    let refusal = |parameters: &[(&str, i32)]| {
        let log = hover(parameters, 30).decoded();
        recorded(&log, Path::new("written.ulg")).err().map_or(String::new(), |error| error.to_string())
    };
    assert_eq!(refusal(&[]), "");
    for (kind, name) in [
        (1, "fixed-wing"),
        (13, "hexacopter"),
        (14, "octocopter"),
        (15, "tricopter"),
        (19, "VTOL"),
        (25, "VTOL"),
    ] {
        assert!(refusal(&[("MAV_TYPE", kind)]).contains(name), "{kind}");
    }
    assert!(refusal(&[("MAV_TYPE", 2), ("SYS_AUTOSTART", 5001)]).contains("plus"));
    assert!(refusal(&[("CA_ROTOR_COUNT", 6)]).contains("6 rotors"));
}

/// Rotors by parameters: positions and sense of turning in PX4's numbers.
fn rotors(places: [(f32, f32, f32); 4]) -> Result<Recording, String> {
    let mut log = hover(&[("MAV_TYPE", 2)], 30);
    let mut definitions = Writer::new();
    definitions.pair(b'P', "int32_t CA_ROTOR_COUNT", &4_i32.to_le_bytes());
    for (rotor, (x, y, ratio)) in places.into_iter().enumerate() {
        for (name, value) in [("PX", x), ("PY", y), ("KM", ratio)] {
            definitions.pair(b'P', &format!("float CA_ROTOR{rotor}_{name}"), &value.to_le_bytes());
        }
    }
    log.0.splice(16..59, definitions.0.split_off(16));
    recorded(&log.decoded(), Path::new("written.ulg")).map_err(|error| error.to_string())
}

#[test]
fn rotors_are_found_by_their_parameters() {
    // Another order than PX4's own: front-left first, then clockwise.
    let recording =
        rotors([(0.1, -0.2, -0.05), (0.1, 0.2, 0.05), (-0.1, 0.2, -0.05), (-0.1, -0.2, 0.05)]).expect("X");
    let commands = recording.signals.commands.expect("commands");
    let first: Vec<f64> = commands.values[..3].iter().map(|values| values[0]).collect();
    assert_close("order", &first, &[0.1, 0.2, 0.3], 1e-6);
    assert_eq!(recording.hints.spin, Some(["cw", "ccw", "cw", "ccw"]));
    let positions = recording.hints.rotor_positions_m.expect("positions");
    assert_close("position", &positions[3], &[-0.1, -0.2], 1e-6);
    let plus = rotors([(0.0, 0.2, 0.05), (0.0, -0.2, 0.05), (0.2, 0.0, -0.05), (-0.2, 0.0, -0.05)]);
    assert!(plus.expect_err("plus").contains("plus"));
    let same = rotors([(0.1, 0.1, 0.05), (-0.1, -0.1, 0.05), (0.1, -0.1, 0.05), (-0.1, 0.1, 0.05)]);
    assert!(same.expect_err("spin").contains("turn"));
    let corner = rotors([(0.1, 0.1, 0.05), (0.1, 0.1, 0.05), (0.1, -0.1, -0.05), (-0.1, 0.1, -0.05)]);
    assert!(corner.expect_err("corner").contains("corner"));
}

/// The specification's rules that no log at hand has.
#[test]
fn rules_of_the_specification() {
    let mut log = Writer::new();
    // A type before it is defined, arrays of formats, padding within and at the end.
    log.record(b'F', b"outer:uint64_t timestamp;uint8_t[3] _padding0;inner[2] part;inner one;int16_t last;uint8_t[5] _padding1;");
    log.record(b'F', b"inner:float[2] v;bool on;uint8_t[3] _padding0;");
    log.pair(b'I', "uint32_t ver_sw_release", &0x0104_02ff_u32.to_le_bytes());
    log.record(b'M', &[&[0, 9], &b"char[2] mab"[..]].concat());
    log.record(b'M', &[&[1, 9], &b"char[2] mcd"[..]].concat());
    log.pair(b'P', "float A", &1.5_f32.to_le_bytes());
    // A kind of record that is not known is passed over.
    log.record(b'Z', b"something later");
    log.subscribe(7, 3, "outer");
    log.pair(b'P', "float A", &2.5_f32.to_le_bytes());
    let part = |value: f32| [&value.to_le_bytes()[..], &(-value).to_le_bytes(), &[1, 9, 9, 9]].concat();
    let mut fields = [&[9; 3][..], &part(1.0), &part(2.0), &part(3.0), &(-7_i16).to_le_bytes()].concat();
    log.row(7, 5, &fields);
    fields.extend([9; 5]);
    log.row(7, 4, &fields);
    log.record(b'L', &[&b"6"[..], &8_u64.to_le_bytes(), b"hello"].concat());
    log.record(b'C', &[&b"6"[..], &[1, 0], &8_u64.to_le_bytes(), b"tagged"].concat());
    log.record(b'O', &[0x10, 0x01]);
    log.0.extend([200, 0, b'D', 7, 0, 1, 2]);
    let log = log.decoded();
    let table = log.table("outer[3]").expect("table");
    assert_eq!(table.times, [5, 4]);
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "part[0].v[0]",
            "part[0].v[1]",
            "part[0].on",
            "part[1].v[0]",
            "part[1].v[1]",
            "part[1].on",
            "one.v[0]",
            "one.v[1]",
            "one.on",
            "last"
        ]
    );
    assert_eq!(table.column("part[1].v[1]"), Some(&Values::F32(vec![-2.0, -2.0])));
    assert_eq!(table.column("one.on"), Some(&Values::U8(vec![1, 1])));
    assert_eq!(table.column("last"), Some(&Values::I16(vec![-7, -7])));
    assert_eq!(log.parameters["A"], 1.5);
    assert_eq!((log.losses.dropouts, log.losses.dropouts_s), (1, 0.272));
    for (name, value) in [
        ("m", "abcd"),
        ("changed_parameters", "1"),
        ("logged_messages", "1"),
        ("logged_messages_tagged", "1"),
    ] {
        assert_eq!(log.information[name], value);
    }
    assert!(log.information["logged_text"].contains("hello"));
    // The record that is cut is left out, and said to be.
    assert_eq!(log.losses.damage.len(), 1);
}

#[test]
fn flags_that_are_not_known_are_refused() {
    let mut log = hover(&[], 10);
    log.0[16 + 3 + 8] |= 1;
    assert!(logs::decode(&log.0, Path::new("a.ulg")).is_ok());
    for byte in 8..16 {
        let mut log = hover(&[], 10);
        log.0[16 + 3 + byte] |= 4;
        let refused = logs::decode(&log.0, Path::new("a.ulg")).expect_err("flag").to_string();
        assert!(refused.starts_with("a.ulg: ") && refused.contains("incompatible"), "{refused}");
    }
}

/// Data that was appended goes on after a record that was cut.
#[test]
fn appended_data_is_followed() {
    let mut log = hover(&[], 20);
    let end = log.0.len() - 9;
    log.0.truncate(end);
    log.0[16 + 3 + 8] |= 1;
    log.0[16 + 3 + 16..][..8].copy_from_slice(&(end as u64).to_le_bytes());
    log.row(3, 9_000_000, &[1]);
    let log = log.decoded();
    assert_eq!(log.table("vehicle_status[0]").expect("status").times, [1_000_000, 9_000_000]);
    assert_eq!(log.losses.damage, Vec::<String>::new());
}

// ---- Damage.

/// Bytes that a log takes in memory, apart from the vectors themselves.
fn bytes_of(log: &Log) -> usize {
    fn of_column(values: &Values) -> usize {
        let width = match values {
            Values::I8(_) | Values::U8(_) => 1,
            Values::I16(_) | Values::U16(_) => 2,
            Values::I32(_) | Values::U32(_) | Values::F32(_) => 4,
            Values::I64(_) | Values::U64(_) | Values::F64(_) => 8,
        };
        width * values.len()
    }
    let of_table = |table: &Table| {
        table.times.len() * 8 + table.columns.iter().map(|column| of_column(&column.values)).sum::<usize>()
    };
    log.tables.iter().map(of_table).sum()
}

/// Any bytes: a log or a sentence, no more memory than the file, one line of a reason.
fn survives(bytes: &[u8]) -> Option<Log> {
    let path = Path::new("damaged.ulg");
    let told = |error: LogError| {
        let text = error.to_string();
        assert!(text.len() < 400 && !text.contains(char::is_control), "{text}");
    };
    let log = logs::decode(bytes, path).map_err(told).ok()?;
    assert!(bytes_of(&log) <= bytes.len(), "{} of {} bytes", bytes_of(&log), bytes.len());
    // Columns take more room than their values where there are few rows.
    assert!(log.tables.iter().map(|table| table.columns.len()).sum::<usize>() <= 200_000);
    assert!(log.losses.damage.len() <= 9, "{:?}", log.losses.damage);
    if let Err(error) = recorded(&log, path) {
        told(error);
    }
    Some(log)
}

#[test]
fn a_log_that_other_readers_panic_on() {
    let Some(path) = shared("data/broken/px4_panic.ulg") else { return };
    let log = survives(&std::fs::read(path).expect("log")).expect("decoded");
    assert!(!log.losses.damage.is_empty());
}

/// What stands after damage is kept: at most the rows around it are lost.
#[test]
fn damage_in_the_middle_costs_what_it_covers() {
    let mut logs = vec![("written", hover(&[("MAV_TYPE", 2)], 300).0)];
    for name in ["px4_quadrotor.ulg", "px4_indoor_vision.ulg", "px4_esc_rpm.ulg"] {
        logs.extend(
            shared(&format!("data/logs/{name}")).map(|path| (name, std::fs::read(path).expect("log"))),
        );
    }
    for (name, whole) in logs {
        let rows = |log: &Log| log.tables.iter().map(|table| table.rows).sum::<usize>();
        let all = rows(&survives(&whole).expect(name));
        let middle = whole.len() * 2 / 3;
        let overwritten = |value: u8| {
            let mut bytes = whole.clone();
            bytes[middle..middle + 400].fill(value);
            bytes
        };
        let mut inserted = whole.clone();
        inserted.splice(middle..middle, (0..333_u32).map(|byte| (byte * 97 % 251) as u8));
        let mut cut_out = whole.clone();
        cut_out.drain(middle..middle + 400);
        for (variant, bytes) in
            [overwritten(0), overwritten(0xFF), overwritten(b'D'), inserted, cut_out].into_iter().enumerate()
        {
            let log = survives(&bytes).expect(name);
            assert!(
                rows(&log) + 40 > all && rows(&log) <= all,
                "{name}, {variant}: {} of {all}, {:?}",
                rows(&log),
                log.losses
            );
            assert!((1..=3).contains(&log.losses.damage.len()), "{name}: {:?}", log.losses.damage);
        }
    }
}

/// Definitions that would take all memory or time if they were believed.
#[test]
fn definitions_without_measure() {
    let mut log = Writer::new();
    log.record(b'F', b"empty:uint8_t[0] nothing;");
    log.record(b'F', b"itself:uint64_t timestamp;itself more;");
    log.record(b'F', b"wide:uint64_t timestamp;uint8_t[18446744073709551615] all;");
    log.record(b'F', b"none:uint64_t timestamp;empty[18446744073709551615] all;uint8_t[0] zero;");
    log.record(b'F', b"level0:uint8_t value;");
    for level in 1..40 {
        log.record(
            b'F',
            format!("level{level}:level{before}[60] a;level{before}[60] b;", before = level - 1).as_bytes(),
        );
    }
    for (number, name) in ["empty", "itself", "wide", "none", "level39", "level2"].into_iter().enumerate() {
        log.subscribe(number as u16, 0, name);
        log.row(number as u16, 5, &[]);
    }
    for number in 0..20_000 {
        log.subscribe(number, (number % 200) as u8, "level2");
    }
    let log = survives(&log.0).expect("log");
    assert_eq!(log.table("none[0]").map(|table| table.times.clone()), Some(vec![5]));
}

/// Changes of a file: overwritten, taken out, put in, cut.
#[derive(Debug, Clone)]
enum Change {
    Byte(prop::sample::Index, u8),
    Fill(prop::sample::Index, u16, u8),
    Remove(prop::sample::Index, u16),
    Insert(prop::sample::Index, Vec<u8>),
    Repeat(prop::sample::Index, u16),
    Cut(prop::sample::Index),
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let place = any::<prop::sample::Index>;
    let change = prop_oneof![
        8 => (place(), any::<u8>()).prop_map(|(place, byte)| Change::Byte(place, byte)),
        2 => (place(), 0..2000_u16, any::<u8>()).prop_map(|(place, length, byte)| Change::Fill(place, length, byte)),
        2 => (place(), 0..2000_u16).prop_map(|(place, length)| Change::Remove(place, length)),
        2 => (place(), prop::collection::vec(any::<u8>(), 0..64)).prop_map(|(place, bytes)| Change::Insert(place, bytes)),
        1 => (place(), 0..2000_u16).prop_map(|(place, length)| Change::Repeat(place, length)),
        1 => place().prop_map(Change::Cut),
    ];
    prop::collection::vec(change, 1..12)
}

fn changed(mut bytes: Vec<u8>, changes: &[Change]) -> Vec<u8> {
    for change in changes {
        if bytes.is_empty() {
            break;
        }
        let stretch = |place: &prop::sample::Index, length: u16| {
            let start = place.index(bytes.len());
            start..(start + usize::from(length)).min(bytes.len())
        };
        match change {
            Change::Byte(place, byte) => {
                let at = place.index(bytes.len());
                bytes[at] = *byte;
            }
            Change::Fill(place, length, byte) => {
                let stretch = stretch(place, *length);
                bytes[stretch].fill(*byte);
            }
            Change::Remove(place, length) => drop(bytes.drain(stretch(place, *length))),
            Change::Insert(place, more) => {
                let at = place.index(bytes.len());
                bytes.splice(at..at, more.iter().copied());
            }
            Change::Repeat(place, length) => {
                let more = bytes[stretch(place, *length)].to_vec();
                bytes.extend(more);
            }
            Change::Cut(place) => bytes.truncate(place.index(bytes.len())),
        }
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_changed_written_log_survives(changes in changes()) {
        survives(&changed(hover(&[("MAV_TYPE", 2)], 60).0, &changes));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 700, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_changed_real_log_survives(changes in changes(), first in any::<bool>()) {
        let name = if first { "px4_esc_rpm.ulg" } else { "px4_custom_topics.ulg" };
        if let Some(path) = shared(&format!("data/logs/{name}")) {
            survives(&changed(std::fs::read(path).expect("log"), &changes));
        }
    }
}
