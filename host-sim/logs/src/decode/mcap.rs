//! ROS messages and quadlab recordings in MCAP (<https://mcap.dev/spec>).
//!
//! Records: u8 kind, u64 length, content. Messages stand in chunks or by themselves. All records are
//! read one after another, without the index at the end: so a file that was not closed is read too.
//! After damage, the next record is the first place at which the content fits its length.

use std::collections::HashMap;
use std::path::Path;

use proto::Telemetry;

use super::common::budget::Budget;
use super::common::bytes::Cursor;
use super::common::decompress::{Compression, decompress};
use super::common::faults::Faults;
use super::ros_messages::{Dialect, Encoding, Topics};
use super::telemetry::telemetry_from_json;
use crate::error::LogError;
use crate::format::Format;
use crate::log::{Column, Log, Table, Values};
use crate::progress::Decoding;

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const HEADER: u8 = 1;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const DATA_END: u8 = 0x0f;
/// The schema of telemetry in quadlab's own recordings.
const TELEMETRY: &str = "quadlab.Telemetry";
/// Bytes of a message before its data.
const MESSAGE_HEAD: usize = 22;

pub(crate) fn decode(bytes: &[u8], path: &Path, progress: &mut Decoding<'_>) -> Result<Log, LogError> {
    let mut log = Log::new(Format::Mcap);
    let mut file = File {
        topics: Topics::new(bytes.len()),
        schemas: HashMap::new(),
        channels: HashMap::new(),
        library: None,
        telemetry: Vec::new(),
        unread: 0,
        budget: Budget::for_decompression(bytes.len()),
        faults: Faults::default(),
        lost_messages: 0,
    };
    let end = bytes.len() - if bytes[MAGIC.len()..].ends_with(MAGIC) { MAGIC.len() } else { 0 };
    let records = &bytes[..end];
    // The summary at the end repeats schemas and channels: for chunks whose own are lost.
    file.walk(records, MAGIC.len(), 0, Depth::Definitions, &mut |_| {});
    file.faults = Faults::default();
    let data_end = file.walk(records, MAGIC.len(), 0, Depth::Chunks, &mut |byte| progress.at(byte));
    if !data_end {
        file.faults.say("the file was not closed: what came last may be missing");
    }
    if file.lost_messages > 0 {
        file.faults.say(format!("{} messages are of channels whose definition is lost", file.lost_messages));
    }
    if file.unread > 0 {
        let mend = "import it with the version that recorded it";
        file.faults
            .say(format!("{} messages of telemetry are damaged or of another version: {mend}", file.unread));
    }
    log.tables = file.topics.into_tables(&mut file.faults);
    log.firmware = file.library.filter(|library| !library.is_empty());
    log.losses.damage = file.faults.into_sentences();
    add_clocks(&mut log.tables, &file.telemetry);
    log.telemetry = file.telemetry;
    if log.tables.is_empty() && log.losses.damage.is_empty() {
        return Err(LogError::Refused { path: path.into(), reason: "the recording holds no message".into() });
    }
    Ok(log)
}

/// The clocks of telemetry beside the time at which it was written.
fn add_clocks(tables: &mut [Table], telemetry: &[Telemetry]) {
    let own = tables.iter_mut().find(|table| table.message_type.as_deref() == Some(TELEMETRY));
    let Some(table) = own.filter(|table| table.rows == telemetry.len()) else { return };
    let column = |name: &str, of: fn(&Telemetry) -> u32| Column {
        name: name.into(),
        values: Values::U32(telemetry.iter().map(of).collect()),
    };
    table.columns = vec![column("craft_us", |row| row.craft_us), column("ground_us", |row| row.ground_us)];
}

struct File {
    topics: Topics,
    schemas: HashMap<u16, Schema>,
    /// Topic by channel, and whether its messages are telemetry of quadlab's own.
    channels: HashMap<u16, (usize, bool)>,
    library: Option<String>,
    /// Telemetry of quadlab's own recording, and how many messages of it cannot be read.
    telemetry: Vec<Telemetry>,
    unread: usize,
    budget: Budget,
    faults: Faults,
    lost_messages: usize,
}

struct Schema {
    name: String,
    encoding: String,
    text: String,
}

/// What is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Depth {
    /// Only schemas and channels outside of chunks.
    Definitions,
    /// Chunks and what is in them.
    Chunks,
    /// The inside of a chunk.
    Inside,
}

/// A record: its kind, its content as far as it is there, where it ends.
struct Record<'a> {
    kind: u8,
    /// Bytes that the content is said to have.
    length: usize,
    content: &'a [u8],
    end: usize,
    whole: bool,
}

fn record(bytes: &[u8], at: usize) -> Option<Record<'_>> {
    let mut cursor = Cursor::at(bytes, at);
    let kind = cursor.u8()?;
    // What is of a later version is left out, but 0 is no kind.
    if kind == 0 {
        return None;
    }
    let length = usize::try_from(cursor.u64()?).ok()?;
    let whole = length <= cursor.left();
    let content = cursor.take(length.min(cursor.left()))?;
    Some(Record { kind, length, content, end: cursor.position(), whole })
}

/// A chunk before its messages.
struct Chunk<'a> {
    uncompressed_bytes: u64,
    crc: u32,
    compression: &'a [u8],
    records: &'a [u8],
    /// Bytes that the records are said to have.
    records_bytes: u64,
}

fn chunk(content: &[u8]) -> Option<Chunk<'_>> {
    let mut cursor = Cursor::new(content);
    let (start, end) = (cursor.u64()?, cursor.u64()?);
    let (uncompressed_bytes, crc) = (cursor.u64()?, cursor.u32()?);
    let compression = cursor.counted_u32()?;
    let records_bytes = cursor.u64()?;
    let records = cursor.take(cursor.left())?;
    let known = matches!(compression, b"" | b"lz4" | b"zstd");
    (known && start <= end).then_some(Chunk { uncompressed_bytes, crc, compression, records, records_bytes })
}

impl File {
    /// Reads records one after another, each told to `at_byte`; whether the end of the data was there.
    fn walk(
        &mut self,
        bytes: &[u8],
        from: usize,
        offset: usize,
        depth: Depth,
        at_byte: &mut dyn FnMut(usize),
    ) -> bool {
        let mut at = from;
        while at < bytes.len() {
            at_byte(at);
            let found = record(bytes, at);
            let fits = found.as_ref().is_some_and(|record| record.whole && self.fits(record, depth));
            let mut end = found.as_ref().map_or(bytes.len(), |record| record.end);
            if !fits {
                let is_cut = found.as_ref().is_some_and(|record| Self::is_cut_chunk(record, depth));
                let next = if is_cut { None } else { self.next_record(bytes, at + 1, depth) };
                end = next.unwrap_or(bytes.len());
                self.faults.say(match next {
                    Some(next) => format!("{} bytes at byte {} are damaged", next - at, offset + at),
                    None => format!("the log is damaged or cut off at byte {}", offset + at),
                });
            }
            if let Some(mut record) = found {
                // With a wrong length, it is not as long as it says: the next record is not part of it.
                let content_bytes =
                    record.content.len() - record.end.saturating_sub(end).min(record.content.len());
                record.content = &record.content[..content_bytes];
                if record.kind == DATA_END && depth == Depth::Chunks {
                    return true;
                }
                self.record(&record, offset + at, depth);
            }
            at = end;
        }
        false
    }

    /// Whether the content of a record is what its kind has.
    fn fits(&self, record: &Record<'_>, depth: Depth) -> bool {
        match record.kind {
            CHUNK => {
                depth != Depth::Inside
                    && chunk(record.content).is_some_and(|c| c.records_bytes == c.records.len() as u64)
            }
            MESSAGE => record.content.len() >= MESSAGE_HEAD,
            SCHEMA => read_schema(record.content).is_some(),
            CHANNEL => read_channel(record.content).is_some(),
            kind => depth != Depth::Inside || kind > DATA_END,
        }
    }

    /// Whether a record is a chunk that goes on behind the end of the file: both its lengths say the same.
    fn is_cut_chunk(record: &Record<'_>, depth: Depth) -> bool {
        let head = |chunk: Chunk<'_>| (record.content.len() - chunk.records.len(), chunk.records_bytes);
        record.kind == CHUNK
            && depth == Depth::Chunks
            && !record.whole
            && chunk(record.content).map(head).is_some_and(|(head, records)| {
                usize::try_from(records).is_ok_and(|records| head.checked_add(records) == Some(record.length))
            })
    }

    /// The next place at which a record begins without doubt, and is followed by another one or by nothing.
    fn next_record(&self, bytes: &[u8], from: usize, depth: Depth) -> Option<usize> {
        let certain = |record: &Record<'_>| {
            let known = match record.kind {
                MESSAGE => Cursor::new(record.content)
                    .u16()
                    .is_some_and(|channel| self.channels.contains_key(&channel)),
                SCHEMA | CHANNEL | CHUNK => true,
                kind => depth != Depth::Inside && (HEADER..=DATA_END).contains(&kind),
            };
            record.whole && known && self.fits(record, depth)
        };
        (from..bytes.len()).find(|&place| {
            record(bytes, place).is_some_and(|first| {
                certain(&first)
                    && (first.end == bytes.len() || record(bytes, first.end).is_some_and(|r| certain(&r)))
            })
        })
    }

    fn record(&mut self, record: &Record<'_>, at: usize, depth: Depth) {
        match (record.kind, depth) {
            (HEADER, Depth::Chunks) => {
                let mut cursor = Cursor::new(record.content);
                self.library = cursor.text().and_then(|_| cursor.text());
            }
            (SCHEMA, _) => {
                if let Some((id, parts)) = read_schema(record.content) {
                    let [name, encoding, text] = parts.map(|part| String::from_utf8_lossy(part).into_owned());
                    self.schemas.insert(id, Schema { name, encoding, text });
                }
            }
            (CHANNEL, _) => self.channel(record.content),
            (MESSAGE, Depth::Chunks | Depth::Inside) if record.whole => self.message(record.content),
            (CHUNK, Depth::Chunks) => self.chunk(record, at),
            _ => {}
        }
    }

    fn channel(&mut self, content: &[u8]) {
        let Some((id, schema, topic, message_encoding)) = read_channel(content) else { return };
        let known = self.schemas.get(&schema);
        let (name, text) = known.map_or(("", None), |schema| {
            // The built-in definition stands in for one in another language.
            let readable = matches!(schema.encoding.as_str(), "ros1msg" | "ros2msg");
            (schema.name.as_str(), readable.then_some(schema.text.as_str()))
        });
        let encoding = match message_encoding {
            b"ros1" => Encoding::Ros(Dialect::Ros1),
            b"cdr" => Encoding::Ros(Dialect::Ros2),
            _ => Encoding::Other,
        };
        let topic = String::from_utf8_lossy(topic);
        let is_telemetry = name == TELEMETRY && message_encoding == b"json";
        self.channels.insert(id, (self.topics.add(&topic, name, encoding, text), is_telemetry));
    }

    fn message(&mut self, content: &[u8]) {
        let mut cursor = Cursor::new(content);
        let channel = cursor.u16().and_then(|channel| self.channels.get(&channel));
        let time = cursor.u32().and_then(|_| cursor.u64()).zip(cursor.u64());
        match (channel, time, content.get(MESSAGE_HEAD..)) {
            (Some(&(topic, is_telemetry)), Some((log_time, _)), Some(data)) => {
                if is_telemetry {
                    let Some(telemetry) = telemetry_from_json(data) else {
                        self.unread += 1;
                        return;
                    };
                    self.telemetry.push(telemetry);
                }
                self.topics.read(topic, i64::try_from(log_time).unwrap_or(i64::MAX), data);
            }
            _ => self.lost_messages += 1,
        }
    }

    fn chunk(&mut self, record: &Record<'_>, at: usize) {
        let Some(chunk) = chunk(record.content) else { return };
        let compression = match chunk.compression {
            b"" => {
                let whole = chunk.crc == 0 || crc32fast::hash(chunk.records) == chunk.crc;
                if record.whole && !whole {
                    self.faults
                        .say(format!("the chunk at byte {at} is damaged: its checksum does not match"));
                }
                return self.walk_chunk(chunk.records, at, record.whole);
            }
            b"lz4" => Compression::Lz4,
            _ => Compression::Zstandard,
        };
        let size = usize::try_from(chunk.uncompressed_bytes).unwrap_or(usize::MAX);
        let plain = decompress(chunk.records, compression, size, &mut self.budget);
        let whole = plain.whole
            && plain.bytes.len() == size
            && (chunk.crc == 0 || crc32fast::hash(&plain.bytes) == chunk.crc);
        if record.whole && !whole {
            self.faults.say(format!(
                "the chunk at byte {at} is damaged: {} of {size} bytes are left",
                plain.bytes.len()
            ));
        }
        self.walk_chunk(&plain.bytes, at, whole && record.whole);
    }

    /// Reads a chunk; that one that is cut ends within a record was said already.
    fn walk_chunk(&mut self, bytes: &[u8], at: usize, whole: bool) {
        if whole {
            self.walk(bytes, 0, at, Depth::Inside, &mut |_| {});
        } else {
            let faults = std::mem::take(&mut self.faults);
            self.walk(bytes, 0, at, Depth::Inside, &mut |_| {});
            self.faults = faults;
        }
    }
}

/// Number, name, encoding and text of a schema.
fn read_schema(content: &[u8]) -> Option<(u16, [&[u8]; 3])> {
    let mut cursor = Cursor::new(content);
    let id = cursor.u16()?;
    Some((id, [cursor.counted_u32()?, cursor.counted_u32()?, cursor.counted_u32()?]))
}

/// Number, schema, topic and encoding of the messages of a channel.
fn read_channel(content: &[u8]) -> Option<(u16, u16, &[u8], &[u8])> {
    let mut cursor = Cursor::new(content);
    Some((cursor.u16()?, cursor.u16()?, cursor.counted_u32()?, cursor.counted_u32()?))
}
