//! Small logs of flight controllers, and a table, with every kind of record.

use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use super::fuzzing::{Base, cut_before, joined};
use crate::ardupilot::{Field, QUAD_X, copter};
use crate::betaflight::{BETAFLIGHT, INAV};
use crate::px4;

/// Cut into its header and records.
pub(super) fn ulog() -> Vec<Base> {
    let mut log = px4::hover(&[("MAV_TYPE", 2)], 0);
    let mut parameters = px4::Writer::new();
    parameters.pair(b'P', "int32_t CA_ROTOR_COUNT", &4_i32.to_le_bytes());
    let rotors = [(0.1, 0.2, 0.05), (-0.1, -0.2, 0.05), (0.1, -0.2, -0.05), (-0.1, 0.2, -0.05_f32)];
    for (rotor, (x, y, ratio)) in rotors.into_iter().enumerate() {
        for (name, value) in [("PX", x), ("PY", y), ("KM", ratio)] {
            parameters.pair(b'P', &format!("float CA_ROTOR{rotor}_{name}"), &value.to_le_bytes());
        }
    }
    log.record(b'Q', &[&[1, 16], &b"int32_t MAV_TYPE"[..], &2_i32.to_le_bytes()].concat());
    log.pair(b'P', "float PWM_MAIN_MIN", &1000_f32.to_le_bytes());
    log.record(b'M', &[&[0, 9], &b"char[2] mab"[..]].concat());
    log.record(b'F', b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;");
    log.record(b'F', b"esc_status:uint64_t timestamp;uint8_t count;esc_report[4] esc;");
    log.record(
        b'F',
        b"esc_report:uint64_t timestamp;int32_t esc_rpm;uint8_t actuator_function;uint8_t[3] _padding0;",
    );
    log.record(b'F', b"battery_status:uint64_t timestamp;float voltage_v;");
    for (number, name) in ["sensor_combined", "esc_status", "battery_status"].into_iter().enumerate() {
        log.subscribe(4 + number as u16, 0, name);
    }
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    for row in 0..30_u64 {
        let us = 1_000_000 + row * 100_000;
        log.row(0, us + 300, &[&us.to_le_bytes()[..], &floats(&[-1.0, 0.01, 0.0, 0.0])].concat());
        log.row(1, us, &[&floats(&[0.0, 0.0, -1.0, 0.0, 0.0, 0.0])[..], &[u8::from(row > 20), 1]].concat());
        log.row(2, us, &[&floats(&[0.1, 0.2, 0.3, 0.4])[..], &[0, 0]].concat());
        log.row(4, us, &floats(&[0.1, 0.2, 0.3, 0.0, 0.1, -9.8]));
        if row % 10 == 0 {
            let esc = |k: u8| [&us.to_le_bytes()[..], &5000_i32.to_le_bytes(), &[101 + k, 0, 0, 0]].concat();
            log.row(5, us, &[vec![4], esc(0), esc(1), esc(2), esc(3)].concat());
            log.row(6, us, &floats(&[15.5]));
            log.record(b'S', &[0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12]);
            log.record(b'O', &[0x10, 0x01]);
        }
    }
    log.record(b'L', &[&b"6"[..], &8_u64.to_le_bytes(), b"hello"].concat());
    log.record(b'C', &[&b"6"[..], &[1, 0], &8_u64.to_le_bytes(), b"tagged"].concat());
    log.record(b'R', &[6, 0]);
    let mut records = ulog_records(&log.0);
    // Behind the header and the flags: later ones are changes in flight.
    records.splice(2..2, ulog_records(&parameters.0).split_off(2));
    vec![Base { name: "made.ulg", records, seal: sealed_ulog }]
}

/// The header, then records as kind and content without their length.
fn ulog_records(bytes: &[u8]) -> Vec<Vec<u8>> {
    const HEADER: usize = 16;
    let mut records = vec![bytes[..HEADER].to_vec()];
    let mut at = HEADER;
    while at < bytes.len() {
        let end = at + 3 + usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        records.push(bytes[at + 2..end].to_vec());
        at = end;
    }
    records
}

fn sealed_ulog(records: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = records.first().cloned().unwrap_or_default();
    for record in records.iter().skip(1).filter(|record| !record.is_empty()) {
        bytes.extend((record.len() as u16 - 1).to_le_bytes());
        bytes.extend(record);
    }
    bytes
}

/// A copter that hovers for three seconds at 10 Hz.
fn dataflash() -> crate::ardupilot::Written {
    let mut log = copter("ArduCopter V4.5.0 (abc)", &QUAD_X);
    log.describe("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
    log.describe("UNIT", "QBZ", "TimeUS,Id,Label");
    log.describe("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn");
    log.describe("EV", "QB", "TimeUS,Id");
    log.describe("BARO", "QBff", "TimeUS,I,Alt,Press");
    let number = Field::Number;
    log.message("FMTU", &[number(1.0), number(131.0), Field::Text("sddddd"), Field::Text("FBBBBB")]);
    log.message("UNIT", &[number(1.0), number(100.0), Field::Text("deg")]);
    log.numbers("EV", &[1e6, 10.0]);
    log.numbers("MODE", &[1e6, 0.0, 0.0, 1.0]);
    for step in 0..30 {
        let t = 1e6 + 1e5 * f64::from(step);
        log.numbers("ATT", &[t, 0.0, 1.5, 0.0, -2.5, f64::from((355 + step) % 360)]);
        log.numbers("IMU", &[t, 0.0, 0.5, -0.25, 0.125, 0.0, 0.5, -9.75]);
        log.numbers("XKF1", &[t, 0.0, 1.0, 2.0, -3.0, 0.5, 0.25, -0.125]);
        log.numbers("RCOU", &[t, 1501.0, 1502.0, 1503.0, 1504.0, 1100.0, 1900.0]);
        if step % 10 == 0 {
            log.numbers("BAT", &[t, 0.0, 15.5]);
            log.numbers("GPS", &[t, 3.0, 0.0, 10.0, 0.0]);
            (0..4).for_each(|k| log.numbers("ESC", &[t, f64::from(k), 6000.0]));
            log.numbers("BARO", &[t, 0.0, 10.0, 95_000.0]);
        }
    }
    log.numbers("EV", &[4e6, 18.0]);
    log
}

pub(super) fn dataflash_binary() -> Vec<Base> {
    vec![Base { name: "made.bin", records: cut_before(&dataflash().binary, &[0xa3, 0x95]), seal: joined }]
}

pub(super) fn dataflash_text() -> Vec<Base> {
    let lines = dataflash().text.split_inclusive('\n').map(|line| line.as_bytes().to_vec()).collect();
    vec![Base { name: "made.log", records: lines, seal: joined }]
}

/// Fields of a log with their predictors and encodings in whole frames and in differences.
type Fields = [(&'static str, u8, u8, u8, u8); 34];

/// Every encoding and predictor that the format has.
const BLACKBOX: Fields = [
    ("loopIteration", 0, 1, 6, 9),
    ("time", 0, 1, 2, 0),
    ("axisP[0]", 0, 0, 1, 7),
    ("axisP[1]", 0, 0, 1, 7),
    ("axisP[2]", 0, 0, 1, 7),
    ("rcCommand[0]", 0, 0, 1, 8),
    ("rcCommand[1]", 0, 0, 1, 8),
    ("rcCommand[2]", 0, 0, 1, 8),
    ("rcCommand[3]", 4, 1, 1, 8),
    ("setpoint[3]", 0, 0, 1, 0),
    ("vbatLatest", 9, 3, 1, 6),
    ("amperageLatest", 0, 0, 1, 6),
    ("gyroADC[0]", 0, 0, 3, 0),
    ("gyroADC[1]", 0, 0, 3, 0),
    ("gyroADC[2]", 0, 0, 3, 0),
    ("accSmooth[0]", 0, 0, 3, 10),
    ("accSmooth[1]", 0, 0, 3, 10),
    ("accSmooth[2]", 0, 0, 3, 10),
    ("motor[0]", 11, 1, 3, 0),
    ("motor[1]", 5, 0, 3, 0),
    ("motor[2]", 5, 0, 3, 0),
    ("motor[3]", 5, 0, 3, 0),
    ("eRPM[0]", 0, 1, 1, 0),
    ("eRPM[1]", 0, 1, 1, 0),
    ("eRPM[2]", 0, 1, 1, 0),
    ("eRPM[3]", 0, 1, 1, 0),
    ("navPos[0]", 0, 0, 1, 0),
    ("navPos[1]", 0, 0, 1, 0),
    ("navPos[2]", 0, 0, 1, 0),
    ("attitude[0]", 0, 0, 1, 0),
    ("attitude[1]", 0, 0, 1, 0),
    ("attitude[2]", 8, 0, 1, 0),
    ("debug[0]", 0, 0, 1, 0),
    ("debug[1]", 0, 0, 1, 0),
];

/// A log of three seconds and an empty one: a whole frame every 32 ms, one of differences after every second of them,
/// and one of each other kind.
pub(super) fn blackbox() -> Vec<Base> {
    let base = |name, settings| {
        let records: Vec<_> = [90, 0].into_iter().flat_map(|rows| blackbox_log(settings, rows)).collect();
        Base { name, records, seal: joined }
    };
    vec![base("made.bbl", BETAFLIGHT), base("made.txt", INAV)]
}

fn blackbox_log(settings: &str, rows: u64) -> Vec<Vec<u8>> {
    let list =
        |of: fn(&(&str, u8, u8, u8, u8)) -> String| BLACKBOX.iter().map(of).collect::<Vec<_>>().join(",");
    let text = format!(
        "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:32\nH P interval:1/2\n\
         H Field I name:{}\nH Field I signed:{}\nH Field I predictor:{}\nH Field I encoding:{}\nH Field P predictor:{}\n\
         H Field P encoding:{}\n{settings}H vbatref:1600\nH minthrottle:1070\nH maxthrottle:2000\n\
         H Field S name:flightModeFlags,stateFlags\nH Field S signed:0,0\nH Field S predictor:0,0\nH Field S encoding:1,7\n\
         H Field G name:time,GPS_numSat,GPS_coord[0],GPS_coord[1]\nH Field G signed:0,0,1,1\nH Field G predictor:10,0,7,7\n\
         H Field G encoding:1,1,0,0\nH Field H name:GPS_home[0],GPS_home[1]\nH Field H signed:1,1\nH Field H predictor:0,0\n\
         H Field H encoding:0,0\n",
        list(|field| field.0.into()),
        list(|field| u8::from(field.0 != "time").to_string()),
        list(|field| field.1.to_string()),
        list(|field| field.2.to_string()),
        list(|field| field.3.to_string()),
        list(|field| field.4.to_string()),
    );
    let mut records: Vec<Vec<u8>> = text.split_inclusive('\n').map(|line| line.as_bytes().to_vec()).collect();
    for row in 0..rows {
        records.push(whole_frame(row));
        if row % 2 == 0 {
            // All differences are zero: two groups of encodings take a byte each.
            let fields = BLACKBOX.iter().filter(|field| field.4 == 0).count();
            records.push([&b"P"[..], &vec![0; fields + 4]].concat());
        }
    }
    let others: [&[u8]; 7] = [
        b"S\x01\x00",
        b"G\x01\x05\x02\x02",
        b"H\x02\x02",
        b"E\x00\x05",
        b"E\x0d\x05\x07",
        b"E\x0e\x01\x02",
        b"E\x1e\x01\x02",
    ];
    for (place, other) in others.into_iter().enumerate() {
        records.insert((40 + 12 * place).min(records.len()), other.to_vec());
    }
    records.push(b"E\xffEnd of log\0".to_vec());
    records
}

fn whole_frame(row: u64) -> Vec<u8> {
    let mut frame = vec![b'I'];
    for (name, _, encoding, ..) in BLACKBOX {
        let value = match name {
            "loopIteration" => row * 32,
            "time" => 1_000_000 + row * 32_000,
            "setpoint[3]" | "motor[0]" => 300,
            "accSmooth[2]" => 2048,
            _ => 5,
        };
        let mut left = if encoding == 0 { value << 1 } else { value };
        while left > 0x7f {
            frame.push(left as u8 | 0x80);
            left >>= 7;
        }
        frame.push(left as u8);
    }
    frame
}

/// Names, types and values of what a craft logs.
const VARIABLES: [(&str, char, f32); 19] = [
    ("stateEstimate.x", 'f', 1.0),
    ("stateEstimate.y", 'f', 1.0),
    ("stateEstimate.z", 'f', 1.0),
    ("stateEstimateZ.vx", 'h', 100.0),
    ("stateEstimateZ.vy", 'h', 100.0),
    ("stateEstimateZ.vz", 'h', 100.0),
    ("stateEstimateZ.quat", 'I', 0.0),
    ("gyro.x", 'f', 1.0),
    ("gyro.y", 'f', 1.0),
    ("gyro.z", 'f', 1.0),
    ("acc.x", 'f', 0.0),
    ("acc.y", 'f', 0.0),
    ("acc.z", 'f', 1.0),
    ("pwm.m1_pwm", 'H', 40_000.0),
    ("pwm.m2_pwm", 'H', 40_000.0),
    ("pwm.m3_pwm", 'H', 40_000.0),
    ("pwm.m4_pwm", 'H', 40_000.0),
    ("pm.vbatMV", 'H', 3900.0),
    ("motor.flags", 'B', 1.0),
];

fn variable_bytes() -> Vec<u8> {
    let bytes = |(_, letter, value): &(&str, char, f32)| match letter {
        'f' => value.to_le_bytes().to_vec(),
        'I' => 0xc000_0000_u32.to_le_bytes().to_vec(),
        'B' => vec![*value as u8],
        _ => (*value as u16).to_le_bytes().to_vec(),
    };
    VARIABLES.iter().flat_map(bytes).collect()
}

/// Versions 0, 1 and 2, three seconds at 20 Hz.
pub(super) fn crazyflie() -> Vec<Base> {
    vec![
        Base { name: "made01", records: crazyflie_events(1), seal: sealed_crazyflie },
        Base { name: "made02", records: crazyflie_events(2), seal: sealed_crazyflie },
        Base { name: "made00", records: crazyflie_blocks(), seal: sealed_blocks },
    ]
}

fn crazyflie_events(version: u16) -> Vec<Vec<u8>> {
    let names: Vec<Vec<u8>> =
        VARIABLES.iter().map(|(name, letter, _)| format!("{name}({letter})\0").into_bytes()).collect();
    let mut records =
        vec![vec![0xbc], version.to_le_bytes().to_vec(), vec![2, 0], b"\xff\xfffixedFrequency\0".to_vec()];
    records.push((names.len() as u16).to_le_bytes().to_vec());
    records.extend(names);
    records.push(b"\x07\x00seldom\0\x02\x00b.z(b)\0b.w(d)\0".to_vec());
    for row in 0..60_u32 {
        let time = if version == 1 {
            (row * 50).to_le_bytes().to_vec()
        } else {
            u64::from(row * 50_000).to_le_bytes().to_vec()
        };
        records.push([&[0xff, 0xff][..], &time, &variable_bytes()].concat());
        if row % 10 == 0 {
            records.push([&[7, 0][..], &time, &[1], &1.5_f64.to_le_bytes()].concat());
        }
    }
    records
}

fn sealed_crazyflie(records: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = records.concat();
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// The header, then blocks of ten rows.
fn crazyflie_blocks() -> Vec<Vec<u8>> {
    let names: String = VARIABLES.iter().map(|(name, letter, _)| format!("{name}({letter}),")).collect();
    let header = [&[VARIABLES.len() as u8 + 1][..], b"tick(I),", names.as_bytes()].concat();
    let row = |row: u32| [&(row * 50_000).to_le_bytes()[..], &variable_bytes()].concat();
    let block = |block: u32| [vec![10], (0..10).flat_map(|k| row(block * 10 + k)).collect()].concat();
    std::iter::once(header).chain((0..6).map(block)).collect()
}

fn sealed_blocks(records: &[Vec<u8>]) -> Vec<u8> {
    let checked = |record: &Vec<u8>| [&record[..], &(!crc32fast::hash(record)).to_le_bytes()].concat();
    records.iter().flat_map(checked).collect()
}

/// The rows of a Crazyflie in all codecs, two groups of rows, some values missing; and one of every type.
pub(super) fn parquet() -> Vec<Base> {
    let in_parts = |name, file: Vec<u8>| {
        let records = file.chunks(64).map(<[u8]>::to_vec).collect();
        Base { name, records, seal: joined }
    };
    crate::parquet::CODECS.map(|codec| in_parts("made.parquet", parquet_flight(codec()))).into()
}

/// Four million rows of one number, in a few kilobytes.
pub(super) fn long_parquet() -> Vec<u8> {
    const ROWS: usize = 4 << 20;
    let schema = "message rows { required double stateEstimate.x; required double stateEstimate.y; required int64 timestamp; }";
    let schema = Arc::new(parse_message_type(schema).expect("a schema"));
    let properties =
        WriterProperties::builder().set_compression(Compression::ZSTD(Default::default())).build();
    let mut file = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut file, schema, Arc::new(properties)).expect("a writer");
    let mut rows = writer.next_row_group().expect("a group");
    for _ in 0..2 {
        let mut column = rows.next_column().expect("a column").expect("numbers");
        column.typed::<DoubleType>().write_batch(&vec![1.0; ROWS], None, None).expect("written");
        column.close().expect("closed");
    }
    let mut column = rows.next_column().expect("a column").expect("times");
    column.typed::<Int64Type>().write_batch(&vec![5; ROWS], None, None).expect("written");
    column.close().expect("closed");
    rows.close().expect("closed");
    writer.close().expect("closed");
    file
}

fn parquet_flight(compression: Compression) -> Vec<u8> {
    let optional = "pm.vbat";
    let names: Vec<String> =
        ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "gyro.x", "gyro.y", "gyro.z"]
            .into_iter()
            .chain(["acc.x", "acc.y", "acc.z", "pwm.m1_pwm", "pwm.m2_pwm", "pwm.m3_pwm", "pwm.m4_pwm"])
            .map(str::to_owned)
            .collect();
    let fields: String = names.iter().map(|name| format!("required double {name};")).collect();
    let schema = format!("message rows {{ required int64 timestamp; optional double {optional}; {fields} }}");
    let schema = Arc::new(parse_message_type(&schema).expect("a schema"));
    let properties = WriterProperties::builder().set_compression(compression).build();
    let mut file = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut file, schema, Arc::new(properties)).expect("a writer");
    for group in 0..2_i64 {
        let mut rows = writer.next_row_group().expect("a group");
        let mut column = rows.next_column().expect("a column").expect("times");
        let times: Vec<i64> = (0..30).map(|k| (group * 30 + k) * 50_000).collect();
        column.typed::<Int64Type>().write_batch(&times, None, None).expect("written");
        column.close().expect("closed");
        let mut column = rows.next_column().expect("a column").expect("a voltage");
        let levels: Vec<i16> = (0..30).map(|k| i16::from(k % 3 != 0)).collect();
        column.typed::<DoubleType>().write_batch(&[3.9; 20], Some(&levels), None).expect("written");
        column.close().expect("closed");
        for _ in &names {
            let mut column = rows.next_column().expect("a column").expect("a number");
            let values: Vec<f64> = (0..30).map(|k| f64::from(k % 5)).collect();
            column.typed::<DoubleType>().write_batch(&values, None, None).expect("written");
            column.close().expect("closed");
        }
        rows.close().expect("closed");
    }
    writer.close().expect("closed");
    file
}
