//! What the records of a log add up to.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use crate::format::Format;
use crate::log::{Log, Losses, ParameterChange, Table, TimeUnit};

use super::columns::{columns, extend};
use super::formats::{Formats, is_definition};
use super::records::{Belief, Kind, Pair, RECORD_HEADER_BYTES, Raw, belief, pair, subscription, text};

/// Columns in all: real logs have some thousands. More is damage, and would take more memory than the file.
const MOST_COLUMNS: usize = 200_000;

/// Stretches of damage that get a sentence of their own.
const DAMAGE_TOLD: usize = 5;

/// A topic and its instance.
struct Topic<'a> {
    name: &'a str,
    instance: u8,
    /// Where the rows start in the file.
    rows: Vec<usize>,
}

/// So many rows before a record tell when it was written. A single one may have waited for a second.
const LAST_ROWS: usize = 64;
/// A row that is later than most before it by more than this has a damaged time, us.
const LATEST_US: i64 = 10_000_000;

/// A row by its topic and its number there: the log's only clock.
#[derive(Clone, Copy)]
struct Moment {
    topic: usize,
    row: usize,
}

/// What rows with a number belong to.
#[derive(Clone, Copy)]
struct Subscription {
    topic: usize,
    /// Least and most bytes of a row.
    row_bytes: (usize, usize),
}

/// What has been read of a log so far.
pub(super) struct Contents<'a> {
    bytes: &'a [u8],
    formats: Formats<'a>,
    topics: Vec<Topic<'a>>,
    topic_numbers: HashMap<(&'a str, u8), usize>,
    /// By the number in the rows.
    subscriptions: Vec<Option<Subscription>>,
    parameters: BTreeMap<String, f64>,
    information: BTreeMap<String, String>,
    texts: String,
    text_count: usize,
    tagged_count: usize,
    /// Parameters that were set after the definitions, each with the rows before.
    changes: Vec<(Vec<Moment>, String, f64)>,
    /// The rows that were taken in last, in a ring.
    last_rows: [Moment; LAST_ROWS],
    rows: usize,
    /// Whether the definitions are over: parameters after them are changes.
    flying: bool,
    losses: Losses,
    /// The rows before each dropout, and how long it was, ms.
    dropouts: Vec<(Vec<Moment>, u16)>,
    /// Stretches without a sentence of their own, and their bytes.
    untold: (usize, usize),
    rows_without_topic: usize,
}

impl<'a> Contents<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            formats: Formats::default(),
            topics: Vec::new(),
            topic_numbers: HashMap::new(),
            subscriptions: Vec::new(),
            parameters: BTreeMap::new(),
            information: BTreeMap::new(),
            texts: String::new(),
            text_count: 0,
            tagged_count: 0,
            changes: Vec::new(),
            last_rows: [Moment { topic: 0, row: 0 }; LAST_ROWS],
            rows: 0,
            flying: false,
            losses: Losses::default(),
            dropouts: Vec::new(),
            untold: (0, 0),
            rows_without_topic: 0,
        }
    }

    /// Takes in the record at a place if it is a row of a known topic, and says where the next record is.
    /// Nearly all records are.
    pub(super) fn take_row(&mut self, bytes: &[u8], at: usize, end: usize) -> Option<usize> {
        let &[low, high, b'D', number_low, number_high] = bytes.get(at..)?.first_chunk::<5>()? else {
            return None;
        };
        let subscription = self.subscription(number_low, number_high)?;
        let size = usize::from(u16::from_le_bytes([low, high]));
        let next = at + RECORD_HEADER_BYTES + size;
        let (least, most) = subscription.row_bytes;
        if next > end || size < least + 2 || size > most + 2 {
            return None;
        }
        let rows = &mut self.topics.get_mut(subscription.topic)?.rows;
        self.last_rows[self.rows % LAST_ROWS] = Moment { topic: subscription.topic, row: rows.len() };
        self.rows += 1;
        rows.push(at + RECORD_HEADER_BYTES + 2);
        Some(next)
    }

    fn subscription(&self, low: u8, high: u8) -> Option<Subscription> {
        self.subscriptions.get(usize::from(u16::from_le_bytes([low, high]))).copied().flatten()
    }

    /// How far a record can be believed, by all that is known of the log.
    pub(super) fn belief(&self, record: Raw<'_>) -> Belief {
        let certain_if = |certain| if certain { Belief::Certain } else { Belief::No };
        match (record.kind, record.body) {
            (b'D', &[low, high, ref row @ ..]) => match self.subscription(low, high) {
                Some(Subscription { row_bytes: (least, most), .. }) => {
                    certain_if((least..=most).contains(&row.len()))
                }
                None => Belief::Unknown,
            },
            (b'D', _) => Belief::No,
            (b'F', body) => certain_if(is_definition(body)),
            (b'A', body) => match subscription(body) {
                Some((_, _, name)) if self.formats.has(name) => Belief::Certain,
                Some(_) => Belief::Possible,
                None => Belief::No,
            },
            _ => belief(record),
        }
    }

    /// Takes in a record.
    pub(super) fn take(&mut self, record: Raw<'a>) {
        let body = record.body;
        self.flying |= b"ALC".contains(&record.kind);
        match record.kind {
            b'F' => self.formats.define(body),
            b'A' => self.subscribe(body),
            // Rows of known topics do not come here.
            b'D' => self.rows_without_topic += 1,
            b'I' => {
                if let Some(pair) = pair(body) {
                    self.information.insert(pair.name.into(), shown(&pair));
                }
            }
            b'M' => self.inform_further(body),
            b'P' => self.set_parameter(body),
            b'L' => {
                self.text_count += 1;
                self.add_text(body.get(1..9), text(body, 9));
            }
            b'C' => {
                self.tagged_count += 1;
                self.add_text(body.get(3..11), text(body, 11));
            }
            b'O' => {
                let lasted_ms = body.first_chunk().map_or(0, |ms| u16::from_le_bytes(*ms));
                self.dropouts.push((self.rows_before(), lasted_ms));
            }
            _ => {}
        }
    }

    fn subscribe(&mut self, body: &'a [u8]) {
        let Some((instance, number, name)) = subscription(body) else { return };
        let number = usize::from(number);
        if self.subscriptions.len() <= number {
            self.subscriptions.resize(number + 1, None);
        }
        let extent = self.formats.extent(name).filter(|extent| extent.used_bytes > 0);
        self.subscriptions[number] = extent.map(|extent| {
            let topics = &mut self.topics;
            let topic = *self.topic_numbers.entry((name, instance)).or_insert_with(|| {
                topics.push(Topic { name, instance, rows: Vec::new() });
                topics.len() - 1
            });
            Subscription { topic, row_bytes: (extent.used_bytes, extent.bytes) }
        });
    }

    /// The rows that were taken in last.
    fn rows_before(&self) -> Vec<Moment> {
        self.last_rows[..self.rows.min(LAST_ROWS)].to_vec()
    }

    fn set_parameter(&mut self, body: &[u8]) {
        let Some(Pair { kind, name, value, .. }) = pair(body) else { return };
        let Some(&value) = value.first_chunk::<4>() else { return };
        let value = match kind {
            Kind::I32 => f64::from(i32::from_le_bytes(value)),
            _ => f64::from(f32::from_le_bytes(value)),
        };
        if self.flying {
            self.changes.push((self.rows_before(), name.into(), value));
        } else {
            self.parameters.insert(name.into(), value);
        }
    }

    /// A part of a text that goes on, or a further line.
    fn inform_further(&mut self, body: &[u8]) {
        let Some((&continued, Some(pair))) = body.split_first().map(|(flag, rest)| (flag, pair(rest))) else {
            return;
        };
        let known = self.information.entry(pair.name.into()).or_default();
        if continued == 0 && !known.is_empty() {
            known.push('\n');
        }
        known.push_str(&shown(&pair));
    }

    fn add_text(&mut self, time: Option<&[u8]>, text: Option<&[u8]>) {
        let (Some(time), Some(text)) = (time.and_then(|time| time.first_chunk()), text) else { return };
        let time_s = u64::from_le_bytes(*time) as f64 * 1e-6;
        self.texts.push_str(&format!("{time_s:.3} s {}\n", printable(text).trim_end()));
    }

    /// Notes bytes that are no records.
    pub(super) fn leave_out(&mut self, place: Range<usize>, last: bool) {
        if self.losses.damage.len() >= DAMAGE_TOLD {
            self.untold.0 += 1;
            self.untold.1 += place.len();
            return;
        }
        let (start, bytes) = (place.start, place.len());
        self.losses.damage.push(if last {
            format!("the file ends within a record: its last {bytes} bytes, from byte {start}, are left out")
        } else {
            format!("{bytes} bytes from byte {start} are no records and are left out")
        });
    }

    /// The log that all this is.
    pub(super) fn into_log(mut self, start_us: u64, appended: usize) -> Log {
        let mut log = Log::new(Format::Ulog);
        let table_of;
        (log.tables, table_of) = self.tables();
        let tables = &log.tables;
        let time_s = |before: &[Moment]| {
            let time = |moment: &Moment| {
                let table: &Table = tables.get((*table_of.get(moment.topic)?)?)?;
                table.times.get(moment.row).copied()
            };
            let mut times: Vec<i64> = before.iter().filter_map(time).collect();
            times.sort_unstable();
            let latest = times.get(times.len() / 2)?.saturating_add(LATEST_US);
            times.iter().rfind(|time| **time <= latest).map(|time| *time as f64 * 1e-6)
        };
        log.losses = std::mem::take(&mut self.losses);
        log.losses.dropouts = self.dropouts.len();
        for (before, lasted_ms) in &self.dropouts {
            let lasted_s = f64::from(*lasted_ms) * 1e-3;
            log.losses.dropouts_s += lasted_s;
            // The record stands before the first row that could be written again.
            log.losses.dropout_spans_s.extend(time_s(before).map(|start_s| [start_s, start_s + lasted_s]));
        }
        let changed_parameters = self.changes.len();
        let changes = std::mem::take(&mut self.changes).into_iter();
        log.changes = changes
            .map(|(before, name, value)| {
                let time_s = time_s(&before).unwrap_or(f64::NEG_INFINITY);
                ParameterChange { time_s, name, value }
            })
            .collect();
        if self.untold.0 > 0 {
            let (stretches, bytes) = self.untold;
            log.losses
                .damage
                .push(format!("{bytes} bytes in {stretches} further places are no records and are left out"));
        }
        if self.rows_without_topic > 0 {
            let rows = self.rows_without_topic;
            log.losses
                .damage
                .push(format!("{rows} rows belong to no topic that the log defines and are left out"));
        }
        let mut tell = |name: &str, value: String| self.information.insert(name.into(), value);
        tell("start_us", start_us.to_string());
        tell("appended_parts", appended.to_string());
        tell("changed_parameters", changed_parameters.to_string());
        tell("logged_messages", self.text_count.to_string());
        tell("logged_messages_tagged", self.tagged_count.to_string());
        if !self.texts.is_empty() {
            tell("logged_text", std::mem::take(&mut self.texts));
        }
        log.firmware = firmware(&self.information);
        log.parameters = self.parameters;
        log.information = self.information;
        log
    }

    /// A table of each topic that has rows, and which table that is of each topic.
    fn tables(&mut self) -> (Vec<Table>, Vec<Option<usize>>) {
        let mut room = MOST_COLUMNS;
        let (mut tables, mut table_of) = (Vec::new(), Vec::new());
        for topic in std::mem::take(&mut self.topics) {
            table_of.push((!topic.rows.is_empty()).then_some(tables.len()));
            if topic.rows.is_empty() {
                continue;
            }
            let mut places = self.formats.places(topic.name);
            if places.len() > room {
                self.losses.damage.push(
                    "the log has more columns than memory is spent on: some topics are left out".into(),
                );
                break;
            }
            room -= places.len();
            let mut times: Vec<i64> = Vec::new();
            if let Some(time) =
                places.iter().position(|place| place.name == "timestamp" && place.kind == Kind::U64)
            {
                let offset = places.remove(time).offset;
                times.reserve_exact(topic.rows.len());
                extend(self.bytes, &topic.rows, offset, &mut times, |time| {
                    i64::try_from(u64::from_le_bytes(time)).unwrap_or(i64::MAX)
                });
            }
            tables.push(Table {
                name: format!("{}[{}]", topic.name, topic.instance),
                message_type: Some(topic.name.into()),
                time_unit: TimeUnit::Microseconds,
                times,
                rows: topic.rows.len(),
                columns: columns(self.bytes, &topic.rows, places),
            });
        }
        (tables, table_of)
    }
}

/// A value of an information as text; of arrays other than texts only the size.
fn shown(pair: &Pair<'_>) -> String {
    let value = pair.value;
    let mut wide = [0; 8];
    match wide.get_mut(..value.len()) {
        Some(low) if pair.count == 1 && pair.kind.bytes() == Some(value.len()) => low.copy_from_slice(value),
        _ if pair.kind == Kind::Char => return printable(value),
        _ => return format!("{} bytes", value.len()),
    }
    let [byte, ..] = wide;
    let [b0, b1, b2, b3, ..] = wide;
    match pair.kind {
        Kind::I8 => i8::from_le_bytes([byte]).to_string(),
        Kind::I16 => i16::from_le_bytes([b0, b1]).to_string(),
        Kind::I32 => i32::from_le_bytes([b0, b1, b2, b3]).to_string(),
        Kind::I64 => i64::from_le_bytes(wide).to_string(),
        Kind::F32 => f32::from_le_bytes([b0, b1, b2, b3]).to_string(),
        Kind::F64 => f64::from_le_bytes(wide).to_string(),
        Kind::Char => printable(value),
        Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 | Kind::Bool | Kind::Named => {
            u64::from_le_bytes(wide).to_string()
        }
    }
}

/// Text without what would move a terminal's cursor.
fn printable(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    text.chars().map(|letter| if letter.is_control() && letter != '\n' { ' ' } else { letter }).collect()
}

/// `PX4 v1.16.1-rc (94cb2012)`.
fn firmware(information: &BTreeMap<String, String>) -> Option<String> {
    let system = information.get("sys_name").or_else(|| information.get("ver_sw"))?;
    let mut firmware = system.clone();
    if let Some(release) = information.get("ver_sw_release").and_then(|release| release.parse::<u32>().ok()) {
        let [major, minor, patch, kind] = release.to_be_bytes();
        let kind = match kind {
            0..64 => "-dev",
            64..128 => "-alpha",
            128..192 => "-beta",
            192..255 => "-rc",
            255 => "",
        };
        firmware.push_str(&format!(" v{major}.{minor}.{patch}{kind}"));
    }
    if let Some(commit) = information.get("ver_sw").and_then(|commit| commit.get(..8)) {
        firmware.push_str(&format!(" ({commit})"));
    }
    Some(firmware)
}
