//! Bags that are made here: chunks with damage, definitions that are not in the bag, messages of many
//! kinds.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use crate::common::mutations::survives;
use crate::common::recorded;
use logs::{Log, Values, decode};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use rusqlite::Connection;

/// Odometry in CDR: stamp, frames, pose, covariance, twist, covariance; it flies forward with `k` m/s,
/// heading left of the world's x.
fn odometry(k: u32) -> Vec<u8> {
    let mut message = vec![0, 1, 0, 0];
    message.extend(k.to_le_bytes());
    message.extend(500_000_000_u32.to_le_bytes());
    message.extend([4, 0, 0, 0, b'm', b'a', b'p', 0]);
    message.extend([5, 0, 0, 0, b'b', b'a', b's', b'e', 0, 0, 0, 0]);
    // After 32 bytes of the content, numbers stand at multiples of eight.
    message.extend([0; 4].iter().take((8 - (message.len() - 4) % 8) % 8));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let pose = [1.0, f64::from(k * k) / 2.0, 2.0, 0.0, 0.0, half, half];
    let twist = [f64::from(k), 0.0, 0.0, 0.0, 0.0, 0.25];
    let covariance = [0.5; 36];
    for number in pose.iter().chain(&covariance).chain(&twist).chain(&covariance) {
        message.extend(number.to_le_bytes());
    }
    message
}

const BATTERY: &str = "std_msgs/Header header\nfloat32 voltage\nfloat32[] cell_voltage\nuint8[] flags\nstring location\n\
    ================================================================================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";

/// A battery with `cells` cells.
fn battery(cells: u8) -> Vec<u8> {
    let mut message = vec![0, 1, 0, 0];
    message.extend([0; 8]);
    message.extend([1, 0, 0, 0, 0, 9, 9, 9]);
    message.extend(12.5_f32.to_le_bytes());
    message.extend(u32::from(cells).to_le_bytes());
    (0..cells).for_each(|cell| message.extend((4.0 + f32::from(cell)).to_le_bytes()));
    message.extend([2, 0, 0, 0, cells, 7, 9, 9]);
    message.extend([2, 0, 0, 0, b'x', 0]);
    message
}

/// Chunks of about 4 kB; times are `k` s.
fn recording(compression: Option<Compression>) -> Vec<u8> {
    let options = WriteOptions::new().compression(compression).chunk_size(Some(4096)).profile("ros2");
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options).unwrap();
    let no_text = writer.add_schema("nav_msgs/msg/Odometry", "ros2idl", b"module nav_msgs {}").unwrap();
    let text = writer.add_schema("sensor_msgs/msg/BatteryState", "ros2msg", BATTERY.as_bytes()).unwrap();
    let odometry_channel = writer.add_channel(no_text, "/cf/odom", "cdr", &BTreeMap::new()).unwrap();
    let battery_channel = writer.add_channel(text, "/cf/battery", "cdr", &BTreeMap::new()).unwrap();
    for k in 0..60 {
        let mut write = |channel_id, data: &[u8]| {
            let time = u64::from(k) * 1_000_000_000;
            let header = MessageHeader { channel_id, sequence: k, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, data).unwrap();
        };
        write(odometry_channel, &odometry(k));
        write(battery_channel, &battery(k as u8 % 4));
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn read(bytes: &[u8]) -> Log {
    decode(bytes, Path::new("made")).unwrap()
}

/// Odometry is in the axes of the body: forward is left of the world's x, which is west.
#[test]
fn odometry_and_batteries() {
    for compression in [None, Some(Compression::Zstd)] {
        let log = read(&recording(compression));
        assert_eq!(log.losses.damage, Vec::<String>::new());
        let cells = log.table("/cf/battery").unwrap();
        assert_eq!(cells.rows, 60);
        // The third cell is there from the fourth message on, and in every fourth.
        let third = cells.column("cell_voltage[2]").unwrap().to_f64();
        assert!(third.iter().enumerate().all(|(k, volts)| if k % 4 == 3 {
            *volts == 6.0
        } else {
            volts.is_nan()
        }));
        assert!(
            matches!(cells.column("flags[1]"), Some(Values::F32(flags)) if flags.iter().all(|flag| *flag == 7.0))
        );
        let recording = recorded(&log, Path::new("made")).unwrap();
        let velocity = recording.signals.velocity.unwrap();
        assert_eq!(velocity.t[3], 3.5);
        let [north, east, down] = velocity.values.map(|part| part[10]);
        assert!(north.abs() < 1e-12 && (east + 10.0).abs() < 1e-12 && down == 0.0, "{north} {east} {down}");
        assert_eq!(recording.signals.rates.unwrap().values[2][5], -0.25);
        assert_eq!(recording.signals.voltage.unwrap().values[0][5], 12.5);
    }
}

#[test]
fn chunks_behind_a_damaged_one_are_read() {
    for compression in [None, Some(Compression::Zstd)] {
        let whole = recording(compression);
        let rows = |log: &Log| log.tables.iter().map(|table| table.rows).sum::<usize>();
        for at in (300..whole.len() - 2000).step_by(61) {
            let mut bytes = whole.clone();
            bytes[at..at + 4].fill(0xff);
            let log = read(&bytes);
            // A chunk has about ten messages, half of all kinds.
            assert!(
                rows(&log) >= 120 - 28,
                "{} messages with damage at {at}: {:?}",
                rows(&log),
                log.losses.damage
            );
        }
    }
}

/// A bag from before definitions were in it.
fn sqlite(compressed: bool) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.db3");
    let database = Connection::open(&path).unwrap();
    database
        .execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
             offered_qos_profiles TEXT NOT NULL);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
             INSERT INTO topics VALUES (1, '/odom', 'nav_msgs/msg/Odometry', 'cdr', ''), (2, '/own', 'own_msgs/msg/Own', 'cdr', '');",
        )
        .unwrap();
    for k in 0..100_u32 {
        let data =
            if compressed { zstd::stream::encode_all(&odometry(k)[..], 1).unwrap() } else { odometry(k) };
        let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        database.execute(insert, (1 + i64::from(k % 10 == 0), i64::from(k), data)).unwrap();
    }
    database.close().unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn bags_without_definitions_have_common_messages() {
    for compressed in [false, true] {
        let log = read(&sqlite(compressed));
        let odometry = log.table("/odom").unwrap();
        assert_eq!((odometry.rows, log.table("/own").unwrap().rows), (90, 10));
        assert_eq!(odometry.column("pose.pose.position.z").unwrap().to_f64(), vec![2.0; 90]);
        assert_eq!(odometry.column("twist.covariance[35]").unwrap().to_f64(), vec![0.5; 90]);
        assert_eq!(log.losses.damage.len(), 1, "{:?}", log.losses.damage);
        assert!(log.losses.damage[0].contains("own_msgs/msg/Own is not defined"));
    }
}

/// Views and computed columns in place of the tables would be work without an end.
#[test]
fn hostile_databases_are_refused() {
    for messages in [
        "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id+1 FROM n)
            SELECT id, 1 AS topic_id, id AS timestamp, zeroblob(1000000) AS data FROM n",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB AS (zeroblob(1000000000)))",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bag.db3");
        let database = Connection::open(&path).unwrap();
        let topics =
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);";
        database.execute_batch(&format!("{topics} {messages};")).unwrap();
        database.close().unwrap();
        let message = decode(&std::fs::read(&path).unwrap(), &path).unwrap_err().to_string();
        assert!(message.contains("no table messages"), "{message}");
    }
}

/// What is no telemetry of this version is counted, and a recording without telemetry has no flight.
#[test]
fn a_recording_of_ours_in_which_no_craft_was_heard_is_refused() {
    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    for (topic, name) in [("/telemetry", "quadlab.Telemetry"), ("/pose", "quadlab.TimedPose")] {
        let schema = writer.add_schema(name, "jsonschema", b"{}").unwrap();
        let channel_id = writer.add_channel(schema, topic, "json", &BTreeMap::new()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
        writer.write_to_known_channel(&header, b"{}").unwrap();
    }
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let log = read(&bytes);
    assert!(log.losses.damage[0].contains("1 messages of telemetry are damaged"), "{:?}", log.losses);
    let message =
        logs::import_bytes(bytes, Path::new("made"), &flights::ColumnMap::default()).unwrap_err().to_string();
    assert!(message.contains("the craft was never heard"), "{message}");
}

/// A record of a ROS 1 bag.
pub(crate) fn ros1_record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let counted = |bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], bytes].concat();
    let field = |(name, value): &(&str, &[u8])| counted(&[name.as_bytes(), b"=", value].concat());
    let header: Vec<u8> = fields.iter().flat_map(field).collect();
    [counted(&header), counted(data)].concat()
}

/// A ROS 1 bag that was not closed, of chunks with ten messages: `uint16 number`, `time[2] times`, `Pair[] pairs`.
fn ros1(compression: &str) -> Vec<u8> {
    let definition = "uint16 number\ntime[2] times\nPair[] pairs\nduration late\n\
        ================================================================================\nMSG: own_msgs/Pair\nint8 A=3\nint8 a\nfloat32 b\n";
    let mut bag = b"#ROSBAG V2.0\n".to_vec();
    bag.extend(ros1_record(&[("op", &[3]), ("index_pos", &[0; 8])], &[b' '; 100]));
    for chunk in 0..10_u16 {
        let mut records = Vec::new();
        if chunk == 0 {
            let text = |name: &str, value: &str| ros1_record(&[(name, value.as_bytes())], &[]);
            let mut data = Vec::new();
            for (name, value) in [("message_definition", definition), ("type", "own_msgs/Own")] {
                let record = text(name, value);
                data.extend(&record[4..record.len() - 4]);
            }
            let fields: [(&str, &[u8]); 3] = [("op", &[7]), ("conn", &[5, 0, 0, 0]), ("topic", b"/own")];
            records.extend(ros1_record(&fields, &data));
        }
        for number in chunk * 10..chunk * 10 + 10 {
            let mut data = number.to_le_bytes().to_vec();
            data.extend([1, 0, 0, 0, 5, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0]);
            data.extend(u32::from(number % 2).to_le_bytes());
            (0..number % 2).for_each(|_| data.extend([0xfe, 0, 0, 0x80, 0x3f]));
            data.extend([0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0]);
            let time = [u32::from(number).to_le_bytes(), 7_u32.to_le_bytes()].concat();
            records.extend(ros1_record(&[("conn", &[5, 0, 0, 0]), ("op", &[2]), ("time", &time)], &data));
        }
        let size = (records.len() as u32).to_le_bytes();
        let data = if compression == "lz4" {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            std::io::Write::write_all(&mut encoder, &records).unwrap();
            encoder.finish().unwrap()
        } else {
            records
        };
        let fields: [(&str, &[u8]); 3] =
            [("compression", compression.as_bytes()), ("op", &[5]), ("size", &size)];
        bag.extend(ros1_record(&fields, &data));
    }
    bag
}

#[test]
fn ros1_messages_of_many_kinds() {
    for compression in ["none", "lz4"] {
        let log = read(&ros1(compression));
        assert_eq!(log.losses.damage, Vec::<String>::new());
        let own = log.table("/own").unwrap();
        assert_eq!((own.rows, own.times[99]), (100, 99_000_000_007));
        assert!(matches!(own.column("number"), Some(Values::U16(numbers)) if numbers[99] == 99));
        assert!(matches!(own.column("times[0]"), Some(Values::I64(times)) if times[0] == 1_000_000_005));
        assert!(
            matches!(own.column("times[1]"), Some(Values::I64(times)) if times[0] == 4_294_967_295_000_000_000)
        );
        assert!(matches!(own.column("late"), Some(Values::I64(late)) if late[0] == -1_000_000_000));
        let (a, b) = (own.column("pairs[0].a").unwrap().to_f64(), own.column("pairs[0].b").unwrap().to_f64());
        assert!(a[0].is_nan() && a[1] == -2.0 && b[2].is_nan() && b[3] == 1.0);
        assert_eq!(own.columns.len(), 6);
    }
}

#[test]
fn damaged_bags_do_no_harm() {
    survives("made.bag", &ros1("none"), 1500);
    survives("made-lz4.bag", &ros1("lz4"), 1500);
    survives("made.mcap", &recording(None), 1500);
    survives("made-zstd.mcap", &recording(Some(Compression::Zstd)), 1500);
    survives("made.db3", &sqlite(false), 1500);
    survives("made-zstd.db3", &sqlite(true), 500);
}
