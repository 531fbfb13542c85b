//! Small recordings of ROS 1 and 2: poses, odometry, inertial sensors, batteries, motors, PX4's messages.

use std::io::Write as _;

use rusqlite::Connection;

use super::fuzzing::{Base, joined};
use crate::made_bags::ros1_record;

const PARTS: &str = "================================================================================\nMSG: std_msgs/Header\nSTAMP stamp\nstring frame_id\n\
    ================================================================================\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n\
    ================================================================================\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n\
    ================================================================================\nMSG: geometry_msgs/Pose\ngeometry_msgs/Vector3 position\ngeometry_msgs/Quaternion orientation\n\
    ================================================================================\nMSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n";

/// Topic, type, and fields of the definition.
const TOPICS: [(&str, &str, &str); 6] = [
    ("/cf/pose", "geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    (
        "/cf/imu",
        "sensor_msgs/Imu",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[2] orientation_covariance\n\
         geometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 linear_acceleration\n",
    ),
    ("/cf/twist", "geometry_msgs/TwistStamped", "std_msgs/Header header\ngeometry_msgs/Twist twist\n"),
    ("/cf/motors", "std_msgs/Float32MultiArray", "int8 KIND=3\nfloat32[] data\nstring<=8 name\n"),
    (
        "/cf/battery",
        "sensor_msgs/BatteryState",
        "std_msgs/Header header\nfloat32 voltage\nbool[<=3] flags\nuint8[] raw\n",
    ),
    (
        "/cf/own",
        "own_msgs/Own",
        "geometry_msgs/Vector3[] all\nstring words\nint64[3] numbers\nduration late\n",
    ),
];

/// PX4's attitude over ROS 2.
const PX4: (&str, &str, &str) = (
    "/fmu/out/vehicle_attitude",
    "px4_msgs/msg/VehicleAttitude",
    "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\nfloat32[4] delta_q_reset\nuint8 quat_reset_counter\n",
);

/// Bytes of a message, in the alignment of ROS 2 or without any.
struct Message {
    bytes: Vec<u8>,
    is_ros2: bool,
}

impl Message {
    fn new(is_ros2: bool) -> Self {
        Self { bytes: if is_ros2 { vec![0, 1, 0, 0] } else { Vec::new() }, is_ros2 }
    }

    fn put<const N: usize>(mut self, number: [u8; N]) -> Self {
        while self.is_ros2 && !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        self.bytes.extend(number);
        self
    }

    fn stamp(self, time_ns: u64) -> Self {
        self.put(((time_ns / 1_000_000_000) as u32).to_le_bytes())
            .put(((time_ns % 1_000_000_000) as u32).to_le_bytes())
    }

    fn text(self, text: &str) -> Self {
        let end = if self.is_ros2 { "\0" } else { "" };
        let mut next = self.put(((text.len() + end.len()) as u32).to_le_bytes());
        next.bytes.extend([text, end].concat().bytes());
        next
    }

    fn header(self, time_ns: u64) -> Self {
        self.stamp(time_ns).text("cf")
    }

    fn numbers(self, numbers: &[f64]) -> Self {
        numbers.iter().fold(self, |message, number| message.put(number.to_le_bytes()))
    }

    fn floats(self, numbers: &[f32]) -> Self {
        numbers.iter().fold(self, |message, number| message.put(number.to_le_bytes()))
    }
}

/// The message of a topic.
fn message(topic: usize, is_ros2: bool, time_ns: u64) -> Vec<u8> {
    let new = Message::new(is_ros2);
    let three = 3_u32.to_le_bytes();
    let message = match topic {
        0 => new.header(time_ns).numbers(&[1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8]),
        1 => new.header(time_ns).numbers(&[0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.1, 0.2, 0.3, 0.0, 0.1, 9.8]),
        2 => new.header(time_ns).numbers(&[0.1, 0.2, 0.3, 0.0, 0.0, 0.0]),
        3 => new.put(4_u32.to_le_bytes()).floats(&[0.1, 0.2, 0.3, (time_ns % 7) as f32]).text("x"),
        4 => new
            .header(time_ns)
            .floats(&[12.5])
            .put(three)
            .put([1])
            .put([0])
            .put([1])
            .put(three)
            .put([7])
            .put([8])
            .put([9]),
        5 => new.put(1_u32.to_le_bytes()).numbers(&[1.0; 3]).text("words").numbers(&[2.0; 3]).stamp(5),
        _ => new
            .put((time_ns / 1000).to_le_bytes())
            .put((time_ns / 1000).to_le_bytes())
            .floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
            .put([0]),
    };
    message.bytes
}

/// Times of messages: three seconds at 20 Hz of what moves, seldom of the rest.
fn messages(is_ros2: bool) -> impl Iterator<Item = (usize, u64, Vec<u8>)> {
    let last = if is_ros2 { 6 } else { 5 };
    (0..45_u64).flat_map(move |row| {
        let time_ns = 1_000_000_000 + row * 50_000_000;
        let due = move |topic: &usize| [0, 1, 6].contains(topic) || row % 15 == 0;
        (0..=last).filter(due).map(move |topic| (topic, time_ns, message(topic, is_ros2, time_ns)))
    })
}

/// ROS 1, a connection of the first, then all.
pub(super) fn rosbag1() -> Vec<Base> {
    let text = |name: &str, value: &str| {
        let record = ros1_record(&[(name, value.as_bytes())], &[]);
        record[4..record.len() - 4].to_vec()
    };
    let mut records = Vec::new();
    for (number, (topic, kind, fields)) in TOPICS.into_iter().enumerate() {
        let definition = format!("{fields}{}", PARTS.replace("STAMP", "time"));
        let data = [text("message_definition", &definition), text("type", kind)].concat();
        let fields: [(&str, &[u8]); 3] =
            [("op", &[7]), ("conn", &[number as u8, 0, 0, 0]), ("topic", topic.as_bytes())];
        records.push(ros1_record(&fields, &data));
    }
    for (topic, time_ns, data) in messages(false) {
        let time = Message::new(false).stamp(time_ns).bytes;
        records.push(ros1_record(&[("conn", &[topic as u8, 0, 0, 0]), ("op", &[2]), ("time", &time)], &data));
    }
    let base = |name, seal| Base { name, records: records.clone(), seal };
    vec![
        base("plain.bag", |records| ros1_bag(records, "none")),
        base("lz4.bag", |records| ros1_bag(records, "lz4")),
    ]
}

/// Chunks of 20 records with their real sizes, an index record behind each.
fn ros1_bag(records: &[Vec<u8>], compression: &str) -> Vec<u8> {
    let mut bag = b"#ROSBAG V2.0\n".to_vec();
    bag.extend(ros1_record(&[("op", &[3]), ("index_pos", &[0; 8])], &[b' '; 100]));
    for records in records.chunks(20) {
        let plain = records.concat();
        let size = (plain.len() as u32).to_le_bytes();
        let data = if compression == "lz4" { lz4(&plain) } else { plain };
        bag.extend(ros1_record(
            &[("compression", compression.as_bytes()), ("op", &[5]), ("size", &size)],
            &data,
        ));
        bag.extend(ros1_record(
            &[("op", &[4]), ("ver", &[1, 0, 0, 0]), ("conn", &[0; 4]), ("count", &[0; 4])],
            &[],
        ));
    }
    bag
}

fn lz4(plain: &[u8]) -> Vec<u8> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(plain).expect("memory");
    encoder.finish().expect("memory")
}

/// A record of MCAP: kind, length, content.
fn mcap_record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind][..], &(content.len() as u64).to_le_bytes(), content].concat()
}

fn counted(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// ROS 2: kind and content of each record, without the length.
pub(super) fn mcap() -> Vec<Base> {
    let mut records = Vec::new();
    for (number, (topic, kind, fields)) in TOPICS.into_iter().chain([PX4]).enumerate() {
        let id = [number as u8 + 1, 0];
        let definition = format!("{fields}{}", PARTS.replace("STAMP", "builtin_interfaces/Time"));
        let name = if kind.contains("/msg/") { kind.into() } else { kind.replace('/', "/msg/") };
        records.push([&[3][..], &id, &counted(&name), &counted("ros2msg"), &counted(&definition)].concat());
        records.push([&[4][..], &id, &id, &counted(topic), &counted("cdr"), &[0; 4]].concat());
    }
    for (topic, time_ns, data) in messages(true).filter(|(topic, ..)| *topic != 5) {
        let head = [&[5, topic as u8 + 1, 0, 0, 0, 0, 0][..], &time_ns.to_le_bytes(), &time_ns.to_le_bytes()]
            .concat();
        records.push([head, data].concat());
    }
    // With PX4's messages the way of its logs is taken, and their attitude is all that is there.
    let ros: Vec<_> = records.iter().filter(|record| record[1] != 7).cloned().collect();
    let base = |name, records: &[Vec<u8>], seal| Base { name, records: records.to_vec(), seal };
    vec![
        base("zstd.mcap", &ros, |records| sealed_mcap(records, "zstd")),
        base("lz4.mcap", &ros, |records| sealed_mcap(records, "lz4")),
        base("chunks.mcap", &ros, |records| sealed_mcap(records, "")),
        base("px4.mcap", &records, |records| sealed_mcap(records, "no chunks")),
    ]
}

fn sealed_mcap(records: &[Vec<u8>], compression: &str) -> Vec<u8> {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    file.extend(mcap_record(1, &[counted("ros2"), counted("made")].concat()));
    for records in records.chunks(30) {
        let whole = records.iter().filter(|record| !record.is_empty());
        let plain: Vec<u8> = whole.flat_map(|record| mcap_record(record[0], &record[1..])).collect();
        let packed = match compression {
            "no chunks" => {
                file.extend(plain);
                continue;
            }
            "zstd" => zstd::stream::encode_all(&plain[..], 1).expect("memory"),
            "lz4" => lz4(&plain),
            _ => plain.clone(),
        };
        let head = [[0; 8], [0; 8], (plain.len() as u64).to_le_bytes()].concat();
        let crc = crc32fast::hash(&plain).to_le_bytes();
        let size = (packed.len() as u64).to_le_bytes();
        file.extend(mcap_record(6, &[&head[..], &crc, &counted(compression), &size, &packed].concat()));
    }
    file.extend(mcap_record(0x0f, &[0; 4]));
    file.extend(mcap_record(2, &[0; 20]));
    file.extend(b"\x89MCAP0\r\n");
    file
}

/// Bags whose compressed parts are zeros and headers of messages without an end.
pub(super) fn bombs() -> Vec<(&'static str, Vec<u8>)> {
    const BYTES: usize = 100 << 20;
    let header = |records: &[Vec<u8>]| records[..records.len() - 1].to_vec();
    let [zstd, lz4, ..] = &mcap()[..] else { panic!("kinds of compression") };
    // A message of a battery whose array goes on and on; and one small message again and again.
    let long = [&[5, 5, 0, 0, 0, 0, 0][..], &[0; 16], &vec![0; BYTES]].concat();
    let short = mcap_record(5, &[&[1, 0, 0, 0, 0, 0][..], &[0; 16], &message(0, true, 5)].concat());
    let many =
        [&[5, 1, 0, 0, 0, 0, 0][..], &[0; 16], &message(0, true, 5), &short.repeat(BYTES / short.len())]
            .concat();
    let mut bags = Vec::new();
    for record in [long, many] {
        for base in [zstd, lz4] {
            let records = [header(&base.records), vec![record.clone()]].concat();
            bags.push((base.name, (base.seal)(&records)));
        }
        let plain =
            [&ros1_record(&[("conn", &[4, 0, 0, 0]), ("op", &[2]), ("time", &[0; 8])], &record)[..]].concat();
        bags.push(("bomb.bag", ros1_bag(&[header(&rosbag1()[1].records), vec![plain]].concat(), "lz4")));
    }
    bags
}

/// Small pages, so that there are several in a small file; messages plain and compressed.
pub(super) fn rosbag2() -> Vec<Base> {
    let base = |name, compressed, with_definitions| {
        let records = sqlite(compressed, with_definitions).chunks(512).map(<[u8]>::to_vec).collect();
        Base { name, records, seal: joined }
    };
    vec![base("made.db3", false, true), base("zstd.db3", true, true), base("old.db3", false, false)]
}

fn sqlite(compressed: bool, with_definitions: bool) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bag.db3");
    let database = Connection::open(&path).expect("a database");
    let tables = "PRAGMA page_size=512;
        CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
        CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT, encoded_message_definition TEXT);
        CREATE INDEX timestamp_idx ON messages (timestamp ASC);";
    database.execute_batch(tables).expect("tables");
    let kept = if with_definitions { 6 } else { 1 };
    for (number, (topic, kind, fields)) in TOPICS.into_iter().take(kept).enumerate() {
        let kind = kind.replace('/', "/msg/");
        let row = (number as i64 + 1, topic, &kind);
        database.execute("INSERT INTO topics VALUES (?1, ?2, ?3, 'cdr')", row).expect("a topic");
        if with_definitions {
            let definition = format!("{fields}{}", PARTS.replace("STAMP", "builtin_interfaces/Time"));
            let insert = "INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition) VALUES (?1, 'ros2msg', ?2)";
            database.execute(insert, (&kind, definition)).expect("a definition");
        }
    }
    for (topic, time_ns, data) in messages(true).filter(|(topic, ..)| *topic < kept) {
        let data = if compressed { zstd::stream::encode_all(&data[..], 1).expect("memory") } else { data };
        let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        database.execute(insert, (topic as i64 + 1, time_ns as i64, data)).expect("a message");
    }
    database.close().expect("closed");
    std::fs::read(path).expect("written")
}
