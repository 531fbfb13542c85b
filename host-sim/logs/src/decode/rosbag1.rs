//! ROS 1 bags, version 2.0 (<http://wiki.ros.org/Bags/Format/2.0>).
//!
//! Records: u32 length of a header of `name=value` fields, then u32 length of the data. Messages stand
//! in chunks, each with the definitions of its connections before them. Chunks are read one after
//! another, without the index at the end: so a bag that was not closed is read too. After damage, the
//! next record is looked for by its `op` field.

use std::collections::HashMap;
use std::path::Path;

use super::common::budget::Budget;
use super::common::bytes::Cursor;
use super::common::decompress::{Compression, decompress};
use super::common::faults::Faults;
use super::ros_messages::{Dialect, Encoding, Topics};
use crate::error::LogError;
use crate::format::Format;
use crate::log::Log;
use crate::progress::Decoding;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// How far before its `op` field a record may begin.
const LONGEST_HEAD: usize = 160;

pub(crate) fn decode(bytes: &[u8], path: &Path, progress: &mut Decoding<'_>) -> Result<Log, LogError> {
    if !bytes.starts_with(MAGIC) {
        return Err(LogError::Format {
            path: path.into(),
            what: "is a ROS bag of another version than 2.0".into(),
            mend: "convert it with `rosbag fix`, or `rosbags-convert` to ROS 2".into(),
        });
    }
    let mut bag = Bag {
        topics: Topics::new(bytes.len()),
        connections: HashMap::new(),
        budget: Budget::for_decompression(bytes.len()),
        faults: Faults::default(),
        lost_messages: 0,
    };
    // The index at the end repeats the connections: for chunks whose own are lost.
    bag.walk(bytes, MAGIC.len(), 0, Depth::Connections, &mut |_| {});
    bag.faults = Faults::default();
    bag.walk(bytes, MAGIC.len(), 0, Depth::Chunks, &mut |byte| progress.at(byte));
    if bag.lost_messages > 0 {
        bag.faults.say(format!("{} messages are of topics whose definition is lost", bag.lost_messages));
    }
    let mut log = Log::new(Format::Rosbag1);
    log.tables = bag.topics.into_tables(&mut bag.faults);
    log.losses.damage = bag.faults.into_sentences();
    Ok(log)
}

struct Bag {
    topics: Topics,
    /// Topic by number of the connection.
    connections: HashMap<u32, usize>,
    budget: Budget,
    faults: Faults,
    lost_messages: usize,
}

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Depth {
    /// Only connections outside of chunks.
    Connections,
    /// Chunks and what is in them.
    Chunks,
    /// The inside of a chunk.
    Inside,
}

/// A record: its fields, where its data is, and whether all of it is there.
struct Record<'a> {
    op: u8,
    header: &'a [u8],
    data: &'a [u8],
    /// Bytes that the data are said to have.
    length: usize,
    end: usize,
    whole: bool,
}

impl Record<'_> {
    /// Whether it is a chunk that goes on behind the end of the file: both its lengths say the same.
    fn is_cut_chunk(&self) -> bool {
        let plain = field(self.header, "compression") == Some(b"none");
        self.op == 5
            && !self.whole
            && plain
            && field_u32(self.header, "size").is_some_and(|size| size as usize == self.length)
    }
}

/// The value of a field of a header.
fn field<'a>(header: &'a [u8], name: &str) -> Option<&'a [u8]> {
    let mut cursor = Cursor::new(header);
    while cursor.left() > 0 {
        let both = cursor.counted_u32()?;
        let equals = memchr::memchr(b'=', both)?;
        if &both[..equals] == name.as_bytes() {
            return Some(&both[equals + 1..]);
        }
    }
    None
}

fn field_u32(header: &[u8], name: &str) -> Option<u32> {
    Some(u32::from_le_bytes(field(header, name)?.try_into().ok()?))
}

/// The record at a place; one with data that go on behind the end has what is there.
fn record(bytes: &[u8], at: usize) -> Option<Record<'_>> {
    let mut cursor = Cursor::at(bytes, at);
    let header = cursor.counted_u32()?;
    let &[op] = field(header, "op")? else { return None };
    if !(2..=7).contains(&op) {
        return None;
    }
    let length = cursor.u32()? as usize;
    let whole = length <= cursor.left();
    let data = cursor.take(length.min(cursor.left()))?;
    Some(Record { op, header, data, length, end: cursor.position(), whole })
}

/// The next place at which a record begins that is whole.
fn next_record(bytes: &[u8], from: usize) -> Option<usize> {
    memchr::memmem::find_iter(bytes.get(from..)?, b"\x04\0\0\0op=").find_map(|found| {
        let op_at = from + found;
        // The header's length stands four bytes before its first field.
        (op_at.saturating_sub(LONGEST_HEAD).max(from)..op_at.saturating_sub(3))
            .find(|&place| leads_to(bytes, place, op_at) && record(bytes, place).is_some_and(|r| r.whole))
    })
}

/// Whether the fields of a header that begins here come to this place.
fn leads_to(bytes: &[u8], header: usize, place: usize) -> bool {
    let mut cursor = Cursor::at(bytes, header + 4);
    while cursor.position() < place && cursor.counted_u32().is_some() {}
    cursor.position() == place
}

impl Bag {
    /// Reads records one after another; `offset` is where the bytes stand in the file, for messages.
    fn walk(
        &mut self,
        bytes: &[u8],
        from: usize,
        offset: usize,
        depth: Depth,
        at_byte: &mut dyn FnMut(usize),
    ) {
        let mut at = from;
        while at < bytes.len() {
            at_byte(at);
            let Some(mut record) = record(bytes, at) else {
                let next = next_record(bytes, at + 1);
                let end = next.unwrap_or(bytes.len());
                self.faults.say(format!(
                    "{} bytes at byte {} are damaged and left out",
                    end - at,
                    offset + at
                ));
                at = end;
                continue;
            };
            let mut end = record.end;
            if !record.whole {
                // The end is missing, or the length is wrong: then there are records within.
                let next = if record.is_cut_chunk() { None } else { next_record(bytes, at + 1) };
                end = next.unwrap_or(bytes.len());
                let missing = record.end.saturating_sub(end);
                record.data = &record.data[..record.data.len().saturating_sub(missing)];
                self.faults.say(match next {
                    Some(next) => {
                        format!("the record at byte {} is damaged, {} bytes", offset + at, next - at)
                    }
                    None => format!("the log is cut off in the record at byte {}", offset + at),
                });
            }
            self.record(&record, offset + at, depth);
            at = end;
        }
    }

    fn record(&mut self, record: &Record<'_>, at: usize, depth: Depth) {
        match (record.op, depth) {
            (2, Depth::Chunks | Depth::Inside) if record.whole => self.message(record),
            (5, Depth::Chunks) => self.chunk(record, at),
            (7, _) if record.whole && self.connection(record).is_none() => {
                self.faults.say(format!("the definition of a topic at byte {at} is damaged"));
            }
            _ => {}
        }
    }

    fn chunk(&mut self, record: &Record<'_>, at: usize) {
        let size = field_u32(record.header, "size").unwrap_or(0) as usize;
        let compression = match field(record.header, "compression") {
            Some(b"none") => return self.walk_chunk(record.data, at, record.whole),
            Some(b"bz2") => Compression::Bzip2,
            Some(b"lz4") => Compression::Lz4,
            _ => {
                return self
                    .faults
                    .say(format!("the chunk at byte {at} is compressed in a way that is not known"));
            }
        };
        let plain = decompress(record.data, compression, size, &mut self.budget);
        if record.whole && !(plain.whole && plain.bytes.len() == size) {
            self.faults.say(format!(
                "the chunk at byte {at} is damaged: {} of {size} bytes could be decompressed",
                plain.bytes.len()
            ));
        }
        self.walk_chunk(&plain.bytes, at, plain.whole && record.whole);
    }

    /// Reads a chunk; that the last record of one that is cut is not whole was said already.
    fn walk_chunk(&mut self, bytes: &[u8], at: usize, whole: bool) {
        if whole {
            return self.walk(bytes, 0, at, Depth::Inside, &mut |_| {});
        }
        let faults = std::mem::take(&mut self.faults);
        self.walk(bytes, 0, at, Depth::Inside, &mut |_| {});
        self.faults = faults;
    }

    fn connection(&mut self, record: &Record<'_>) -> Option<()> {
        let number = field_u32(record.header, "conn")?;
        let topic = String::from_utf8_lossy(field(record.header, "topic")?);
        let message_type = String::from_utf8_lossy(field(record.data, "type")?);
        let definition = String::from_utf8_lossy(field(record.data, "message_definition")?);
        let encoding = Encoding::Ros(Dialect::Ros1);
        self.connections.insert(number, self.topics.add(&topic, &message_type, encoding, Some(&definition)));
        Some(())
    }

    fn message(&mut self, record: &Record<'_>) {
        let topic = field_u32(record.header, "conn").and_then(|number| self.connections.get(&number));
        let time = field(record.header, "time").and_then(|time| {
            let mut cursor = Cursor::new(time);
            Some(i64::from(cursor.u32()?) * 1_000_000_000 + i64::from(cursor.u32()?))
        });
        match (topic, time) {
            (Some(&topic), Some(time_ns)) => self.topics.read(topic, time_ns, record.data),
            _ => self.lost_messages += 1,
        }
    }
}
