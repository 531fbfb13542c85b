//! The records of a recording in progress one after another, whatever has happened to its file.
//!
//! A power cut leaves zeroed pages and a record without its end, a bad disk flipped bits: a length may be anything. Therefore no
//! record is longer than [`LONGEST_RECORD`] (the recorder writes none that is), and one counts only where all of it is there and
//! its content is what its kind has; a message is a whole JSON document of a known channel. After damage the search goes on byte by
//! byte. Nothing inside a message can pass for a record: that holds zeros in its length, and JSON holds none.
//!
//! The file is read through a window of a few records, so that a recording of hours takes no more memory than one of seconds.

use std::collections::HashMap;
use std::io::{self, Read};

use mcap::MAGIC;
use mcap::records::op::{CHANNEL, DATA_END, HEADER, MESSAGE, SCHEMA};
use serde::Serialize;
use serde::de::IgnoredAny;

/// Longest record that is written or read, bytes without its kind and length.
pub(super) const LONGEST_RECORD: usize = 1 << 18;

/// Bytes of a record before its content: kind and length.
const RECORD_HEAD: usize = 9;
/// Bytes of a message before its data.
const MESSAGE_HEAD: usize = 22;
/// The shortest message there can be, with `{}` in it.
const SHORTEST_MESSAGE: u64 = (RECORD_HEAD + MESSAGE_HEAD + 2) as u64;

/// What stands in a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Found<'a> {
    /// The head of the file; says nothing more.
    Head,
    Schema {
        id: u16,
        name: &'a str,
        encoding: &'a str,
        text: &'a [u8],
    },
    Channel {
        id: u16,
        schema: u16,
        topic: &'a str,
        encoding: &'a str,
    },
    Message {
        channel: u16,
        sequence: u32,
        log_time: u64,
        publish_time: u64,
        data: &'a [u8],
    },
    /// The recorder has closed the file.
    End,
}

/// How much of a recording is left.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Completeness {
    /// Messages that were read.
    pub messages: u64,
    /// Messages that are missing where the file is damaged, by the numbers of others.
    pub lost_messages: u64,
    /// Messages that were never written, by the numbers of others: the disk took none in time.
    pub left_out_messages: u64,
    /// Places in the file that are damaged.
    pub damaged_places: u64,
    /// Bytes that could not be read there.
    pub damaged_bytes: u64,
    /// Where the first of them is.
    pub first_damage: Option<u64>,
    /// Bytes behind the last record that could be read.
    pub tail_bytes: u64,
    /// Whether the recorder closed the file: else what it was about to write is missing.
    pub closed: bool,
}

impl Completeness {
    /// Whether nothing is missing.
    pub fn is_complete(&self) -> bool {
        self.closed && self.damaged_places == 0 && self.lost_messages == 0 && self.left_out_messages == 0
    }

    /// What is missing, for people; nothing where nothing is.
    pub fn missing(&self) -> Option<String> {
        let mut said = Vec::new();
        if let Some(first) = self.first_damage {
            let places = match self.damaged_places {
                1 => format!("from byte {first} on"),
                places => format!("in {places} places, the first at byte {first}"),
            };
            let (bytes, lost) = (self.damaged_bytes, self.lost_messages);
            said.push(format!("{bytes} bytes are damaged {places}; messages lost there: {lost}"));
        }
        if self.left_out_messages > 0 {
            let count = self.left_out_messages;
            said.push(format!("the disk was full or too slow: messages that were not written: {count}"));
        }
        if !self.closed {
            let cut = match self.tail_bytes {
                0 => String::new(),
                bytes => format!(", and the last {bytes} bytes hold no whole message"),
            };
            said.push(format!("it was not closed: what came after its last message is missing{cut}"));
        }
        (!said.is_empty()).then(|| said.join("; "))
    }

    fn add_damage(&mut self, from: u64, to: u64) {
        self.first_damage.get_or_insert(from);
        self.damaged_places += 1;
        self.damaged_bytes += to - from;
    }
}

/// Walks over the records of `file`, each handed to `each`. `channels` are those that are known although their definition may be
/// lost. Nothing where neither the file's head nor any message says that it is a recording.
pub(super) fn walk<E: From<io::Error>>(
    file: impl Read,
    channels: &[u16],
    mut each: impl FnMut(Found<'_>) -> Result<(), E>,
) -> Result<Option<Completeness>, E> {
    let mut window = Window { file, bytes: Vec::new(), start: 0, offset: 0, ended: false };
    let mut known: HashMap<u16, Numbers> = channels.iter().map(|&id| (id, Numbers::default())).collect();
    let mut complete = Completeness::default();
    window.fill()?;
    let has_magic = window.ahead().starts_with(MAGIC);
    let mut broken_at = (!has_magic).then_some(0);
    window.skip(if has_magic { MAGIC.len() } else { 0 });
    loop {
        window.fill()?;
        let bytes = window.ahead();
        if bytes.is_empty() {
            break;
        }
        let Some((found, length)) = record(bytes, &known) else {
            broken_at.get_or_insert(window.offset);
            window.skip(1);
            continue;
        };
        if let Some(from) = broken_at.take() {
            complete.add_damage(from, window.offset);
        }
        match found {
            Found::Channel { id, .. } => _ = known.entry(id).or_default(),
            Found::Message { channel, sequence, .. } => {
                let numbers = known.entry(channel).or_default();
                let missing = numbers.missing_before(sequence, complete.damaged_bytes);
                complete.lost_messages += missing.damaged;
                complete.left_out_messages += missing.left_out;
                complete.messages += 1;
            }
            _ => {}
        }
        each(found)?;
        if found == Found::End {
            complete.closed = true;
            break;
        }
        window.skip(length);
    }
    complete.tail_bytes = broken_at.map_or(0, |from| window.offset - from);
    Ok((has_magic || complete.messages > 0).then_some(complete))
}

/// The numbers of a channel's messages, which rise by one.
#[derive(Debug, Clone, Copy, Default)]
struct Numbers {
    next: u32,
    /// Bytes that were damaged before the last message.
    damaged_bytes: u64,
    /// A gap before the last message that no damage explains: a number that is damaged itself, unless the next one goes on from it.
    gap: u32,
}

/// Messages that are missing before another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Missing {
    /// In a damaged part of the file.
    damaged: u64,
    /// Never written.
    left_out: u64,
}

impl Numbers {
    /// How many messages are missing before this one and the one before it. Of those in damaged parts no more than there is room for.
    fn missing_before(&mut self, sequence: u32, damaged_bytes: u64) -> Missing {
        let left_out = if sequence == self.next { u64::from(self.gap) } else { 0 };
        let room = (damaged_bytes - self.damaged_bytes) / SHORTEST_MESSAGE;
        let missing = sequence.saturating_sub(self.next);
        let gap = if room == 0 { missing } else { 0 };
        *self = Self { next: sequence.wrapping_add(1), damaged_bytes, gap };
        Missing { damaged: u64::from(missing).min(room), left_out }
    }
}

/// The record at the beginning of these bytes and its length, if there is one without doubt.
fn record<'a>(bytes: &'a [u8], known: &HashMap<u16, Numbers>) -> Option<(Found<'a>, usize)> {
    let mut rest = bytes;
    let [kind] = take(&mut rest)?;
    if !matches!(kind, HEADER | SCHEMA | CHANNEL | MESSAGE | DATA_END) {
        return None;
    }
    let length = usize::try_from(u64::from_le_bytes(take(&mut rest)?)).ok()?;
    if length > LONGEST_RECORD {
        return None;
    }
    let mut content = rest.get(..length)?;
    let behind = &rest[length..];
    let found = match kind {
        MESSAGE => message(content, known)?,
        HEADER => {
            counted(&mut content)?;
            counted(&mut content)?;
            content.is_empty().then_some(Found::Head)?
        }
        SCHEMA => schema(content)?,
        CHANNEL => channel(content)?,
        // A checksum; behind it what sums the file up.
        _ => (length == 4 && behind.first().is_none_or(|kind| *kind != 0)).then_some(Found::End)?,
    };
    Some((found, RECORD_HEAD + length))
}

fn message<'a>(mut content: &'a [u8], known: &HashMap<u16, Numbers>) -> Option<Found<'a>> {
    let channel = u16::from_le_bytes(take(&mut content)?);
    let sequence = u32::from_le_bytes(take(&mut content)?);
    let log_time = u64::from_le_bytes(take(&mut content)?);
    let publish_time = u64::from_le_bytes(take(&mut content)?);
    let is_whole = known.contains_key(&channel)
        && content.starts_with(b"{")
        && serde_json::from_slice::<IgnoredAny>(content).is_ok();
    is_whole.then_some(Found::Message { channel, sequence, log_time, publish_time, data: content })
}

fn schema(mut content: &[u8]) -> Option<Found<'_>> {
    let id = u16::from_le_bytes(take(&mut content)?);
    let name = std::str::from_utf8(counted(&mut content)?).ok()?;
    let encoding = std::str::from_utf8(counted(&mut content)?).ok()?;
    let text = counted(&mut content)?;
    (id != 0 && content.is_empty()).then_some(Found::Schema { id, name, encoding, text })
}

fn channel(mut content: &[u8]) -> Option<Found<'_>> {
    let id = u16::from_le_bytes(take(&mut content)?);
    let schema = u16::from_le_bytes(take(&mut content)?);
    let topic = std::str::from_utf8(counted(&mut content)?).ok()?;
    let encoding = std::str::from_utf8(counted(&mut content)?).ok()?;
    counted(&mut content)?;
    content.is_empty().then_some(Found::Channel { id, schema, topic, encoding })
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (taken, behind) = rest.split_first_chunk()?;
    *rest = behind;
    Some(*taken)
}

/// Bytes with their count before them.
fn counted<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let count = usize::try_from(u32::from_le_bytes(take(rest)?)).ok()?;
    let (taken, behind) = rest.split_at_checked(count)?;
    *rest = behind;
    Some(taken)
}

/// Room for the longest record and the kind of the next.
const AHEAD: usize = LONGEST_RECORD + RECORD_HEAD + 1;

/// A part of a file.
struct Window<R> {
    file: R,
    bytes: Vec<u8>,
    /// Of the first byte that was not skipped, in `bytes` and in the file.
    start: usize,
    offset: u64,
    ended: bool,
}

impl<R: Read> Window<R> {
    /// Reads on, so that at least one whole record is ahead, or all that is left.
    fn fill(&mut self) -> io::Result<()> {
        if !self.ended && self.bytes.len() - self.start < AHEAD {
            self.bytes.drain(..self.start);
            self.start = 0;
            let wanted = (4 * AHEAD - self.bytes.len()) as u64;
            self.ended = (&mut self.file).take(wanted).read_to_end(&mut self.bytes)? < wanted as usize;
        }
        Ok(())
    }

    fn ahead(&self) -> &[u8] {
        &self.bytes[self.start..]
    }

    fn skip(&mut self, count: usize) {
        self.start += count;
        self.offset += count as u64;
    }
}
