//! ArduPilot logs: what pymavlink finds in them, and what the craft did.

use std::path::Path;

use crate::common::{damage, motion};
use logs::{Log, Recording, decode, record};
use proptest::prelude::*;
use serde_json::Value;

const FILES: [&str; 4] = [
    "ardupilot_copter35.bin",
    "ardupilot_copter36_a.bin",
    "ardupilot_copter36_b.bin",
    "ardupilot_plane_cut.BIN",
];

/// A log of the shared data and what its own decoder finds in it.
fn log_and_expected(name: &str) -> Option<(Log, Value)> {
    let path = crate::common::shared(&format!("data/logs/{name}"))?;
    let text = std::fs::read_to_string(path.with_file_name("expected.json")).expect("expected.json");
    let expected: Value = serde_json::from_str(&text).expect("JSON");
    let bytes = std::fs::read(&path).expect("a log");
    Some((decode(&bytes, &path).expect("a log"), expected[name].clone()))
}

/// The recording of a log of the shared data.
fn recording(name: &str) -> Option<(Recording, Value)> {
    let (log, expected) = log_and_expected(name)?;
    let mut recordings = record(&log, Path::new(name)).expect("a recording");
    assert_eq!(recordings.len(), 1);
    Some((recordings.remove(0), expected))
}

/// Counts, first and last time and sums of every type of message.
#[test]
fn messages_are_those_of_pymavlink() {
    for name in FILES {
        let Some((log, expected)) = log_and_expected(name) else { continue };
        let types = expected["types"].as_object().expect("types");
        let names: Vec<&String> = log.tables.iter().map(|table| &table.name).collect();
        assert_eq!(names, types.keys().collect::<Vec<_>>(), "{name}");
        for (table, expected) in log.tables.iter().zip(types.values()) {
            let what = format!("{name}, {}", table.name);
            assert_eq!(table.rows as u64, expected["count"].as_u64().expect("count"), "{what}");
            assert_eq!(table.times.first().copied(), expected["first"].as_i64(), "{what}");
            assert_eq!(table.times.last().copied(), expected["last"].as_i64(), "{what}");
            for (field, sum) in expected["sums"].as_object().into_iter().flatten() {
                let column = table.column(field).unwrap_or_else(|| panic!("{what}: {field}"));
                let (found, sum) = (column.to_f64().iter().sum::<f64>(), sum.as_f64().expect("a number"));
                assert!((found - sum).abs() <= 1e-6 * sum.abs(), "{what}: {field} {found} {sum}");
            }
        }
        assert_eq!(
            log.parameters.len() as u64,
            expected["parameters"].as_u64().expect("parameters"),
            "{name}"
        );
        assert_eq!(log.firmware.as_deref(), expected["firmware"].as_str(), "{name}");
        assert_eq!(log.information.get("frame").map(String::as_str), expected["frame"].as_str(), "{name}");
        for (parameter, expected) in
            [("FRAME_CLASS", &expected["frame_class"]), ("FRAME_TYPE", &expected["frame_type"])]
        {
            assert_eq!(log.parameters.get(parameter).copied(), expected.as_f64(), "{name}: {parameter}");
        }
    }
}

/// Which messages the quantities are from.
#[test]
fn quantities_are_from_the_expected_messages() {
    for name in &FILES[..3] {
        let Some((recording, expected)) = recording(name) else { continue };
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
            let expected = expected["flight_format"][quantity].as_str();
            assert_eq!(source.map(String::as_str), expected, "{name}: {quantity}");
        }
        assert!(
            recording
                .limits
                .iter()
                .any(|limit| limit.contains("10 Hz: forces can be fitted, rotation cannot"))
        );
        assert!(recording.notes.is_empty(), "{:?}", recording.notes);
    }
}

/// Off the ground (28) to landed (18), as the logs' own events have it; the second log ends in the air.
#[test]
fn flights_lie_between_take_off_and_landing() {
    let flights: [(&str, &[[f64; 2]]); 3] = [
        (FILES[0], &[[352.47, 500.40], [567.33, 706.50]]),
        (FILES[1], &[[62.53, 112.93]]),
        (FILES[2], &[[109.48, 150.62], [192.80, 222.44]]),
    ];
    for (name, expected) in flights {
        let Some((recording, _)) = recording(name) else { continue };
        assert_eq!(recording.airborne.len(), expected.len(), "{name}");
        for (found, expected) in recording.airborne.iter().zip(expected) {
            // Within it the motors are above idle.
            assert!((expected[0] - 0.01..expected[0] + 0.5).contains(&found[0]), "{name} {found:?}");
            assert!((expected[1] - 1.5..=expected[1] + 0.01).contains(&found[1]), "{name} {found:?}");
        }
    }
}

/// Slope of b over a through the origin.
fn slope(a: &[f64], b: &[f64]) -> f64 {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    product(a, b) / product(a, a)
}

/// Body rates from the quaternions' changes: twice the vector part of q* dq/dt.
fn rates_of(attitude: &[Vec<f64>; 4], step_s: f64) -> [Vec<f64>; 3] {
    let q = attitude.each_ref().map(|component| motion::smooth(component, step_s));
    let d = attitude.each_ref().map(|component| motion::derivative(component, step_s));
    let part = |a: usize, b: usize, c: usize| {
        (0..q[0].len())
            .map(|k| 2.0 * (q[0][k] * d[a][k] - q[a][k] * d[0][k] - q[b][k] * d[c][k] + q[c][k] * d[b][k]))
            .collect()
    };
    [part(1, 2, 3), part(2, 3, 1), part(3, 1, 2)]
}

/// Frames, signs and order of motors by what moves what.
#[test]
fn motion_agrees_with_itself() {
    const STEP_S: f64 = 0.05;
    for name in &FILES[..3] {
        let Some((recording, _)) = recording(name) else { continue };
        let signals = &recording.signals;
        for [start, end] in &recording.airborne {
            let times = motion::grid([start + 2.0, end - 2.0], STEP_S);
            let attitude = motion::at(signals.attitude.as_ref().expect("attitude"), &times);
            let rates = motion::at(signals.rates.as_ref().expect("rates"), &times);
            let force = motion::at(signals.specific_force.as_ref().expect("specific force"), &times);
            let position = motion::at(signals.position.as_ref().expect("position"), &times);
            let velocity = motion::at(signals.velocity.as_ref().expect("velocity"), &times);
            let commands = motion::at(signals.commands.as_ref().expect("commands"), &times);
            let turned = rates_of(&attitude, STEP_S);
            // Attitude at 10 Hz is smoother than the gyro. The indoor flights hold their heading.
            for axis in 0..if *name == FILES[0] { 3 } else { 2 } {
                let slope = slope(&turned[axis], &motion::smooth(&rates[axis], STEP_S));
                assert!((1.0..1.2).contains(&slope), "{name}, axis {axis}: {slope}");
            }
            assert!((-9.95..-9.4).contains(&motion::mean(&force[2])), "{name}");
            assert!(motion::mean(&force[0]).abs() < 0.6 && motion::mean(&force[1]).abs() < 0.6, "{name}");
            // Beacons move the horizontal position of the indoor flights.
            for axis in if *name == FILES[0] { 0 } else { 2 }..3 {
                let moved = motion::derivative(&position[axis], STEP_S);
                let slope = slope(&moved, &motion::smooth(&velocity[axis], STEP_S));
                assert!((0.85..1.1).contains(&slope), "{name}, axis {axis}: {slope}");
            }
            let signs = rates.each_ref().map(|rate| motion::motor_signs(&commands, rate, STEP_S));
            assert_eq!(signs, ["+--+", "++--", "-+-+"], "{name}");
        }
    }
}

/// What the logs say of the craft.
#[test]
fn hints_of_real_logs() {
    if let Some((recording, _)) = recording(FILES[0]) {
        let hints = &recording.hints;
        assert_eq!(hints.command_range, Some([1105.0, 1905.0]));
        assert_eq!(hints.command_unit.as_deref(), Some("us"));
        assert_eq!(hints.spin, Some(["cw", "ccw", "cw", "ccw"]));
        // At 50.4 degrees north and 360 m.
        assert!((hints.gravity.expect("gravity") - 9.810).abs() < 0.001);
        assert!((1.1..1.25).contains(&hints.air_density.expect("air density")));
        assert!(recording.limits.iter().any(|limit| limit.contains("BATT_MONITOR")));
    }
    if let Some((recording, _)) = recording(FILES[2]) {
        let volts = recording.signals.voltage.expect("voltage");
        assert!((10.0..17.0).contains(&motion::mean(&volts.values[0])));
        // A reset of the heading in each flight.
        assert_eq!(recording.untrusted.len(), 2);
    }
}

#[test]
fn a_plane_is_refused_by_name() {
    let Some((log, _)) = log_and_expected(FILES[3]) else { return };
    let error = record(&log, Path::new(FILES[3])).expect_err("a plane");
    damage::check_message(&error);
    assert!(error.to_string().contains("fixed wing (ArduPlane), ArduPlane V3.8.2-dev"), "{error}");
}

/// A log written by the test: types of messages, and messages, in both notations.
#[derive(Default)]
pub(crate) struct Written {
    types: Vec<(&'static str, &'static str)>,
    pub(crate) binary: Vec<u8>,
    pub(crate) text: String,
}

/// A field of a message.
#[derive(Clone, Copy)]
pub(crate) enum Field<'text> {
    Number(f64),
    Text(&'text str),
}

impl Written {
    /// Describes a type of message.
    pub(crate) fn describe(&mut self, name: &'static str, letters: &'static str, labels: &str) {
        let kind = 129 + self.types.len() as u8;
        let width = |letter| match letter {
            'B' | 'M' => 1,
            'c' | 'C' | 'h' | 'H' => 2,
            'I' | 'f' | 'L' | 'e' | 'E' | 'n' => 4,
            'Q' => 8,
            'N' => 16,
            'Z' => 64,
            _ => panic!("{letter}"),
        };
        let length = 3 + letters.chars().map(width).sum::<usize>();
        self.types.push((name, letters));
        let padded = |text: &str, length: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(length, 0);
            bytes
        };
        self.binary.extend([0xa3, 0x95, 0x80, kind, length as u8]);
        self.binary.extend([padded(name, 4), padded(letters, 16), padded(labels, 64)].concat());
        self.text += &format!("FMT, {kind}, {length}, {name}, {letters}, {labels}\n");
    }

    /// Writes a message.
    pub(crate) fn message(&mut self, name: &str, fields: &[Field]) {
        let kind = self.types.iter().position(|(known, _)| *known == name).expect("a type");
        self.binary.extend([0xa3, 0x95, 129 + kind as u8]);
        self.text += name;
        for (letter, field) in self.types[kind].1.chars().zip(fields) {
            let bytes = match (letter, field) {
                (_, Field::Text(text)) => {
                    let mut bytes = text.as_bytes().to_vec();
                    bytes.resize(if letter == 'N' { 16 } else { 64 }, 0);
                    bytes
                }
                ('B' | 'M', Field::Number(number)) => (*number as u8).to_le_bytes().to_vec(),
                ('h', Field::Number(number)) => (*number as i16).to_le_bytes().to_vec(),
                ('H', Field::Number(number)) => (*number as u16).to_le_bytes().to_vec(),
                ('c', Field::Number(number)) => ((number * 100.0).round() as i16).to_le_bytes().to_vec(),
                ('C', Field::Number(number)) => ((number * 100.0).round() as u16).to_le_bytes().to_vec(),
                ('e', Field::Number(number)) => ((number * 100.0).round() as i32).to_le_bytes().to_vec(),
                ('E', Field::Number(number)) => ((number * 100.0).round() as u32).to_le_bytes().to_vec(),
                ('L', Field::Number(number)) => ((number * 1e7).round() as i32).to_le_bytes().to_vec(),
                ('I', Field::Number(number)) => (*number as u32).to_le_bytes().to_vec(),
                ('f', Field::Number(number)) => (*number as f32).to_le_bytes().to_vec(),
                ('Q', Field::Number(number)) => (*number as u64).to_le_bytes().to_vec(),
                _ => panic!("{letter}"),
            };
            self.binary.extend(bytes);
            self.text += &match field {
                Field::Text(text) => format!(", {text}"),
                Field::Number(number) => format!(", {number}"),
            };
        }
        self.text += "\n";
    }

    /// Writes a message of numbers.
    pub(crate) fn numbers(&mut self, name: &str, numbers: &[f64]) {
        let fields: Vec<Field> = numbers.iter().map(|&number| Field::Number(number)).collect();
        self.message(name, &fields);
    }

    /// Writes a parameter.
    fn parameter(&mut self, name: &str, value: f64) {
        self.message("PARM", &[Field::Number(1.0), Field::Text(name), Field::Number(value)]);
    }
}

/// A copter with its types described, its firmware and some parameters said.
pub(crate) fn copter(firmware: &str, parameters: &[(&str, f64)]) -> Written {
    let mut log = Written::default();
    log.describe("PARM", "QNf", "TimeUS,Name,Value");
    log.describe("MSG", "QZ", "TimeUS,Message");
    log.describe("ATT", "QccccC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw");
    log.describe("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
    log.describe("RCOU", "QHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6");
    log.describe("XKF1", "QBffffff", "TimeUS,C,PN,PE,PD,VN,VE,VD");
    log.describe("BAT", "QBf", "TimeUS,Inst,Volt");
    log.describe("ESC", "QBe", "TimeUS,Instance,RPM");
    log.describe("GPS", "QBLLe", "TimeUS,Status,Lat,Lng,Alt");
    log.message("MSG", &[Field::Number(1.0), Field::Text(firmware)]);
    for (name, value) in parameters {
        log.parameter(name, *value);
    }
    log
}

/// Two seconds of hover with two of everything.
pub(crate) fn hover(log: &mut Written) {
    for step in 0..20 {
        let t = 1e6 + 1e5 * f64::from(step);
        log.numbers("ATT", &[t, 0.0, 1.5, 0.0, -2.5, f64::from((355 + step) % 360)]);
        for instance in [0.0, 1.0] {
            log.numbers("IMU", &[t, instance, 0.5 + instance, -0.25, 0.125, 0.0, 0.5, -9.75]);
            log.numbers("XKF1", &[t, instance, 1.0 + instance, 2.0, -3.0, 0.5, 0.25, -0.125]);
            log.numbers("BAT", &[t, instance, 15.5 - 10.0 * instance]);
        }
        for instance in 0..4 {
            log.numbers("ESC", &[t, f64::from(instance), 6000.0 + 60.0 * f64::from(instance)]);
        }
        log.numbers("RCOU", &[t, 1501.0, 1502.0, 1503.0, 1504.0, 1100.0, 1900.0]);
        log.numbers("GPS", &[t, 3.0, 0.0, 10.0, 0.0]);
    }
}

pub(crate) const QUAD_X: [(&str, f64); 2] = [("FRAME_CLASS", 1.0), ("FRAME_TYPE", 1.0)];

fn recorded(bytes: &[u8]) -> Result<Recording, String> {
    let path = Path::new("written");
    let recordings = decode(bytes, path).and_then(|log| record(&log, path));
    recordings.map(|mut recordings| recordings.remove(0)).map_err(|error| {
        damage::check_message(&error);
        error.to_string()
    })
}

/// Both notations give the same numbers.
#[test]
fn text_says_what_binary_says() {
    let mut log = copter("ArduCopter V4.5.0 (abc)", &QUAD_X);
    hover(&mut log);
    let binary = decode(&log.binary, Path::new("binary")).expect("a log");
    let text = decode(log.text.as_bytes(), Path::new("text")).expect("a log");
    assert_eq!(binary, text);
    assert_eq!(recorded(&log.binary), recorded(log.text.replace('\n', "\r\n").as_bytes()));
}

/// The first of each sensor, motors by their order, angles into quaternions.
#[test]
fn quantities_of_a_written_log() {
    let mut log = copter("ArduCopter V4.5.0 (abc)", &QUAD_X);
    hover(&mut log);
    let recording = recorded(&log.binary).expect("a recording");
    let signals = &recording.signals;
    let first = |values: &[Vec<f64>]| values.iter().map(|values| values[0]).collect::<Vec<_>>();
    let rates = signals.rates.as_ref().expect("rates");
    assert_eq!((rates.t.len(), first(&rates.values)), (20, vec![0.5, -0.25, 0.125]));
    let position = signals.position.as_ref().expect("position");
    assert_eq!((position.t.len(), first(&position.values)), (20, vec![1.0, 2.0, -3.0]));
    assert_eq!(first(&signals.voltage.as_ref().expect("voltage").values), [15.5]);
    assert_eq!(first(&signals.commands.as_ref().expect("commands").values), [1503.0, 1501.0, 1504.0, 1502.0]);
    let speed = first(&signals.rotor_speed.as_ref().expect("speeds").values);
    let expected = [6120.0, 6000.0, 6180.0, 6060.0].map(|rpm: f64| rpm * std::f64::consts::TAU / 60.0);
    assert!(speed.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{speed:?}");
    // Heading 355 to 14 degrees, across north: no jump in the signs.
    let attitude = signals.attitude.as_ref().expect("attitude");
    let steps = attitude.values[3].windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(steps.fold(0.0, f64::max) < 0.01);
    let half = (355.0_f64 - 360.0).to_radians() / 2.0;
    let size = attitude.values[0][0].hypot(attitude.values[3][0]);
    assert!((attitude.values[3][0].abs() - half.sin().abs()).abs() < 0.002 && (size - 1.0).abs() < 0.002);
    assert!((recording.hints.gravity.expect("gravity") - 9.780_325).abs() < 1e-5);
    assert_eq!(recording.airborne.len(), 1);
    assert!(recording.limits.iter().any(|limit| limit.contains("LOG_BITMASK")));
}

/// Frame types by their order of motors, and outputs by the function that each has.
#[test]
fn motors_by_frame_type_and_function() {
    let commands = |parameters: &[(&str, f64)]| {
        let mut log = copter("ArduCopter V4.5.0 (abc)", parameters);
        hover(&mut log);
        let recording = recorded(&log.binary)?;
        let signal = recording.signals.commands.ok_or("no commands")?;
        Ok::<_, String>((signal.values.map(|motor| motor[0] as i32), recording.hints.spin))
    };
    let x = Some(["cw", "ccw", "cw", "ccw"]);
    let of_type = |kind: f64| commands(&[("FRAME_CLASS", 1.0), ("FRAME_TYPE", kind)]);
    assert_eq!(of_type(12.0), Ok(([1504, 1502, 1501, 1503], x)));
    assert_eq!(of_type(13.0), Ok(([1502, 1501, 1504, 1503], x)));
    assert_eq!(of_type(14.0), Ok(([1504, 1501, 1502, 1503], x)));
    assert_eq!(of_type(18.0), Ok(([1504, 1502, 1501, 1503], Some(["ccw", "cw", "ccw", "cw"]))));
    let functions = [
        ("SERVO1_FUNCTION", 0.0),
        ("SERVO2_FUNCTION", 36.0),
        ("SERVO3_FUNCTION", 33.0),
        ("SERVO4_FUNCTION", 34.0),
        ("SERVO6_FUNCTION", 35.0),
    ];
    assert_eq!(commands(&[&QUAD_X[..], &functions].concat()), Ok(([1900, 1503, 1502, 1504], x)));
    let error = commands(&[&QUAD_X[..], &functions[..3]].concat()).expect_err("two motors");
    assert!(error.contains("SERVOn_FUNCTION"), "{error}");
}

/// Controllers on outputs 9 to 12 are counted from 0 where a second processor has the first eight.
#[test]
fn controllers_behind_a_second_processor() {
    let functions = [33.0, 34.0, 35.0, 36.0];
    let names: Vec<String> = (9..13).map(|output| format!("SERVO{output}_FUNCTION")).collect();
    let outputs = names.iter().map(String::as_str).zip(functions);
    let mut log = copter("ArduCopter V4.5.0 (abc)", &QUAD_X.into_iter().chain(outputs).collect::<Vec<_>>());
    hover(&mut log);
    let speeds = recorded(&log.binary).expect("a recording").signals.rotor_speed.expect("speeds");
    let rpm = speeds.values.map(|speed| (speed[0] * 60.0 / std::f64::consts::TAU).round());
    assert_eq!(rpm, [6120.0, 6000.0, 6180.0, 6060.0]);
}

/// What is no quadcopter of ours is refused by its name.
#[test]
fn other_craft_are_refused_by_name() {
    let refusal = |firmware: &str, parameters: &[(&str, f64)]| {
        let mut log = copter(firmware, parameters);
        hover(&mut log);
        recorded(&log.binary).expect_err("not ours")
    };
    type Case<'text> = (&'text str, &'text [(&'text str, f64)], &'text str);
    let cases: [Case; 9] = [
        ("ArduCopter V4.5.0", &[("FRAME_CLASS", 2.0)], "hexacopter"),
        ("ArduCopter V4.5.0", &[("FRAME_CLASS", 3.0)], "octocopter"),
        ("ArduCopter V4.5.0", &[("FRAME_CLASS", 7.0)], "tricopter"),
        ("ArduCopter V4.5.0", &[("FRAME_CLASS", 1.0), ("FRAME_TYPE", 0.0)], "plus"),
        ("ArduCopter V4.5.0", &[("FRAME_CLASS", 1.0), ("FRAME_TYPE", 3.0)], "(H)"),
        ("ArduCopter V4.5.0", &[("FRAME_CLASS", 1.0), ("FRAME_TYPE", 99.0)], "unknown"),
        ("ArduRover V4.2.0", &[], "rover"),
        ("ArduSub V4.1.0", &[], "submarine"),
        ("nothing known", &[], "which vehicle"),
    ];
    for (firmware, parameters, name) in cases {
        let error = refusal(firmware, parameters);
        assert!(error.contains(name), "{error}");
    }
    assert!(refusal("ArduCopter V3.4.1", &[("FRAME", 0.0)]).contains("plus"));
}

/// Logs before 3.3: milliseconds, `Ch1`, volts in hundredths, no class of frame.
#[test]
fn an_old_log_in_milliseconds() {
    let mut log = Written::default();
    log.describe("PARM", "Nf", "Name,Value");
    log.describe("MSG", "Z", "Message");
    log.describe("ATT", "IccccC", "TimeMS,DesRoll,Roll,DesPitch,Pitch,Yaw");
    log.describe("IMU", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
    log.describe("RCOU", "Ihhhh", "TimeMS,Ch1,Ch2,Ch3,Ch4");
    log.describe("CURR", "Ihh", "TimeMS,Volt,Curr");
    log.message("MSG", &[Field::Text("ArduCopter V3.2.1 (36b405fb)")]);
    log.message("PARM", &[Field::Text("FRAME"), Field::Number(1.0)]);
    for step in 0..50 {
        // One absurd time in between.
        let t = if step == 20 { 4e9 } else { 10_000.0 + 20.0 * f64::from(step) };
        log.numbers("ATT", &[t, 0.0, 1.0, 0.0, 1.0, 90.0]);
        log.numbers("IMU", &[t, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8]);
        log.numbers("RCOU", &[t, 1601.0, 1602.0, 1603.0, 1604.0]);
        log.numbers("CURR", &[t, 1567.0, 1200.0]);
    }
    let decoded = decode(&log.binary, Path::new("old")).expect("a log");
    assert_eq!(decoded.table("ATT").expect("ATT").times[20], 4_000_000_000);
    let recording = recorded(&log.binary).expect("a recording");
    let attitude = recording.signals.attitude.as_ref().expect("attitude");
    assert_eq!((attitude.t.len(), attitude.t[0], attitude.t[48]), (49, 10.0, 10.98));
    assert_eq!(
        recording.signals.commands.expect("commands").values.map(|motor| motor[0]),
        [1603.0, 1601.0, 1604.0, 1602.0]
    );
    let voltage = recording.signals.voltage.expect("voltage");
    assert_eq!(voltage.source, "CURR");
    assert!((voltage.values[0][0] - 15.67).abs() < 1e-9);
    assert!(recording.notes.iter().any(|note| note.starts_with("1 rows of ATT")), "{:?}", recording.notes);
    assert!(recording.notes.iter().any(|note| note.contains("how many rotors")), "{:?}", recording.notes);
}

/// What lies before and after a damage stays.
#[test]
fn rows_on_both_sides_of_a_damage_stay() {
    let Some(path) = crate::common::shared("data/logs/ardupilot_copter36_b.bin") else { return };
    let whole = std::fs::read(&path).expect("a log");
    let rows = |bytes: &[u8]| {
        let log = decode(bytes, &path).expect("a log");
        let table = log.table("IMU").expect("IMU");
        (table.rows, table.times.first().copied(), table.times.last().copied(), log.losses.damage)
    };
    let undamaged = rows(&whole);
    assert!(undamaged.3.is_empty());
    let middle = whole.len() / 2;
    for (what, replacement) in [
        ("zeros", vec![0; 4096]),
        ("nothing", Vec::new()),
        ("noise", (0..4096_u32).map(|i| (i * i * 37 + i / 7) as u8).collect()),
    ] {
        let damaged = [&whole[..middle], &replacement, &whole[middle + 4096..]].concat();
        let found = rows(&damaged);
        assert!(undamaged.0 - found.0 < 25, "{what}: {} of {}", found.0, undamaged.0);
        assert_eq!((found.1, found.2), (undamaged.1, undamaged.2), "{what}");
        assert_eq!(found.3.len(), 1, "{what}: {:?}", found.3);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_logs_neither_panic_nor_fill_the_memory(changes in damage::changes(), text in any::<bool>()) {
        let mut log = copter("ArduCopter V4.5.0 (abc)", &QUAD_X);
        hover(&mut log);
        let mut bytes = if text { log.text.into_bytes() } else { log.binary };
        changes.iter().for_each(|change| change.apply(&mut bytes));
        damage::survives(&bytes);
    }

    #[test]
    fn damaged_real_logs_neither_panic_nor_fill_the_memory(changes in damage::changes(), plane in any::<bool>()) {
        static REAL: std::sync::OnceLock<[Option<Vec<u8>>; 2]> = std::sync::OnceLock::new();
        let read = |index: usize| crate::common::shared(&format!("data/logs/{}", FILES[index])).map(|path| std::fs::read(path).expect("a log"));
        if let Some(mut bytes) = REAL.get_or_init(|| [read(1), read(3)])[usize::from(plane)].clone() {
            changes.iter().for_each(|change| change.apply(&mut bytes));
            damage::survives(&bytes);
        }
    }

    #[test]
    fn anything_neither_panics_nor_fills_the_memory(mut bytes in proptest::collection::vec(any::<u8>(), 0..3000), text in any::<bool>()) {
        bytes.splice(0..0, if text { b"FMT, ".to_vec() } else { vec![0xa3, 0x95, 0x80] });
        damage::survives(&bytes);
    }
}
