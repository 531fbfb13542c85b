//! Crazyflie SD card (cfusdlog): before the magic number, versions 1 and 2.
//!
//! Version 1 and 2 (`tools/usdlog/cfusdlog.py` of the firmware): magic 0xBC, u16 version, u16 number of
//! events; of each event u16 id, its name up to a zero, u16 number of variables, each `name(t)` up to a
//! zero, `t` a type letter of Python's `struct`. Then rows: u16 id, time (u32 ms or u64 us), the
//! variables, packed. The last four bytes are the CRC-32 of all before. There are no sync bytes: after
//! damage, the next place is taken at which several rows with known ids and near times follow each
//! other.

mod blocks;
mod variables;

use std::collections::HashMap;
use std::path::Path;

use super::common::bytes::Cursor;
use super::common::faults::Faults;
use crate::error::LogError;
use crate::format::Format;
use crate::log::{Log, TimeUnit};
use variables::Variable;

/// Rows that have to follow each other for a place to be taken for the beginning of a row.
const CHAIN: usize = 4;
/// Rows that follow each other are no further apart than ten minutes.
const NEAR_MS: u64 = 600_000;
/// Later than this, no craft flies: ten years after it was switched on.
const LATEST_MS: u64 = 10 * 366 * 86_400_000;

pub(crate) fn decode(bytes: &[u8], path: &Path) -> Result<Log, LogError> {
    if crate::format::crazyflie_before_magic(bytes) {
        return Ok(blocks::decode(bytes));
    }
    let refuse = |what: String| LogError::Format {
        path: path.into(),
        what,
        mend: "copy it from the card again".into(),
    };
    let (header, rows_at) = Header::read(bytes).map_err(refuse)?;
    let mut faults = Faults::default();
    let checked = bytes.len().saturating_sub(4);
    let whole =
        bytes.len() >= rows_at + 4 && bytes[checked..] == crc32fast::hash(&bytes[..checked]).to_le_bytes();
    let end = if whole { checked } else { bytes.len() };
    let events = read_rows(&header, &bytes[..end], rows_at, &mut faults);
    if !whole {
        faults.say("the checksum at the end does not match: bytes were changed or the end is missing");
    }
    let mut log = Log::new(Format::Crazyflie);
    log.information.insert("version".into(), header.version.to_string());
    for (event, found) in header.events.iter().zip(events) {
        let times = found.iter().map(|&at| header.time(bytes, at)).collect();
        let data_at: Vec<usize> = found.iter().map(|at| at + header.head_bytes()).collect();
        log.tables.push(variables::table(
            &event.name,
            &event.variables,
            bytes,
            &data_at,
            times,
            header.unit(),
        ));
    }
    log.losses.damage = faults.into_sentences();
    Ok(log)
}

#[derive(Debug)]
struct Header {
    version: u16,
    events: Vec<Event>,
    /// Event by id.
    by_id: HashMap<u16, usize>,
}

#[derive(Debug)]
struct Event {
    name: String,
    variables: Vec<Variable>,
    row_bytes: usize,
}

impl Header {
    /// The header and where the rows begin.
    fn read(bytes: &[u8]) -> Result<(Self, usize), String> {
        let cut = || "the header of the Crazyflie log is cut off".to_owned();
        let mut cursor = Cursor::at(bytes, 1);
        let version = cursor.u16().ok_or_else(cut)?;
        if !(1..=2).contains(&version) {
            return Err(format!("is a Crazyflie log of version {version}, and 0, 1 and 2 are read"));
        }
        let count = cursor.u16().ok_or_else(cut)?;
        let mut header = Self { version, events: Vec::new(), by_id: HashMap::new() };
        for _ in 0..count {
            let id = cursor.u16().ok_or_else(cut)?;
            let name = String::from_utf8_lossy(cursor.until(0).ok_or_else(cut)?).into_owned();
            let mut variables = Vec::new();
            for _ in 0..cursor.u16().ok_or_else(cut)? {
                let text = cursor.until(0).ok_or_else(cut)?;
                variables.push(Variable::parse(text).ok_or_else(|| {
                    let text: String = String::from_utf8_lossy(text).escape_default().take(60).collect();
                    format!("the header of the Crazyflie log names a variable of no known type, {text}")
                })?);
            }
            let row_bytes = variables.iter().map(|variable| variable.kind.bytes()).sum();
            header.by_id.entry(id).or_insert(header.events.len());
            header.events.push(Event { name, variables, row_bytes });
        }
        Ok((header, cursor.position()))
    }

    fn unit(&self) -> TimeUnit {
        if self.version == 1 { TimeUnit::Milliseconds } else { TimeUnit::Microseconds }
    }

    /// Id and time before the variables.
    fn head_bytes(&self) -> usize {
        if self.version == 1 { 6 } else { 10 }
    }

    /// Time of the row at a place at which there is one.
    fn time(&self, bytes: &[u8], at: usize) -> i64 {
        let mut cursor = Cursor::at(bytes, at + 2);
        let ticks = if self.version == 1 { cursor.u32().map(u64::from) } else { cursor.u64() };
        i64::try_from(ticks.unwrap_or(0)).unwrap_or(i64::MAX)
    }

    /// The event of the row at a place, and where the row ends; nothing if there is no whole row.
    fn row(&self, bytes: &[u8], at: usize) -> Option<(usize, usize)> {
        let event = *self.by_id.get(&Cursor::at(bytes, at).u16()?)?;
        let end = at + self.head_bytes() + self.events[event].row_bytes;
        (end <= bytes.len()).then_some((event, end))
    }

    /// Whether rows that belong together begin here.
    fn begins(&self, bytes: &[u8], at: usize) -> bool {
        let per_ms = if self.version == 1 { 1 } else { 1000 };
        let (mut at, mut before) = (at, None::<i64>);
        for rows in 0..CHAIN {
            let Some((_, end)) = self.row(bytes, at) else {
                // The last rows of a file have fewer behind them.
                return rows >= 2 && at + self.head_bytes() > bytes.len();
            };
            let time = self.time(bytes, at);
            if time.unsigned_abs() > LATEST_MS * per_ms
                || before.is_some_and(|before| before.abs_diff(time) > NEAR_MS * per_ms)
            {
                return false;
            }
            (at, before) = (end, Some(time));
        }
        true
    }
}

/// Where the rows of each event are.
fn read_rows(header: &Header, bytes: &[u8], rows_at: usize, faults: &mut Faults) -> Vec<Vec<usize>> {
    let mut found: Vec<Vec<usize>> = vec![Vec::new(); header.events.len()];
    let (mut at, mut before) = (rows_at, None);
    while at < bytes.len() {
        if let Some((event, end)) = header.row(bytes, at) {
            found[event].push(at);
            (at, before) = (end, Some(event));
            continue;
        }
        // The checksum of a log that was changed.
        if bytes.len() - at == 4 {
            break;
        }
        let next = (at + 1..bytes.len()).find(|&place| header.begins(bytes, place));
        if next.is_none() && bytes.len() - at < longest_row(header) && known_or_cut(header, bytes, at) {
            faults.say(format!("the last row is cut off, {} bytes", bytes.len() - at));
            break;
        }
        // The row before may hold bytes of two rows: where bytes are missing, its id still was right.
        if let Some(event) = before.take() {
            found[event].pop();
        }
        let end = next.unwrap_or(bytes.len());
        let rest = if next.is_some() { "" } else { ", all that follows" };
        faults.say(format!("{} bytes at byte {at} are damaged and left out{rest}", end - at));
        at = end;
    }
    found
}

fn longest_row(header: &Header) -> usize {
    header.events.iter().map(|event| event.row_bytes).max().unwrap_or(0) + header.head_bytes()
}

/// Whether what is left is the beginning of a row.
fn known_or_cut(header: &Header, bytes: &[u8], at: usize) -> bool {
    Cursor::at(bytes, at).u16().is_none_or(|id| header.by_id.contains_key(&id))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A version 2 log of two events; rows of the first are 20 ms apart, of the second 50 ms.
    fn log(rows: u16) -> Vec<u8> {
        let mut bytes =
            b"\xbc\x02\x00\x02\x00\xff\xfffixed\0\x02\x00a.x(h)\0a.y(f)\0\x07\x00seldom\0\x01\x00b.z(B)\0"
                .to_vec();
        for k in 0..rows {
            bytes.extend(0xffff_u16.to_le_bytes());
            bytes.extend((u64::from(k) * 20_000).to_le_bytes());
            bytes.extend((k as i16).to_le_bytes());
            bytes.extend((f32::from(k) / 2.0).to_le_bytes());
            if k % 5 == 0 {
                bytes.extend(7_u16.to_le_bytes());
                bytes.extend((u64::from(k) * 20_000 + 5).to_le_bytes());
                bytes.push(k as u8);
            }
        }
        let crc = crc32fast::hash(&bytes);
        bytes.extend(crc.to_le_bytes());
        bytes
    }

    #[test]
    fn two_events_are_two_tables() {
        let log = decode(&log(10), Path::new("log")).unwrap();
        assert_eq!(log.losses.damage, Vec::<String>::new());
        assert_eq!((log.tables[0].rows, log.tables[1].rows), (10, 2));
        assert_eq!(log.tables[0].times[3], 60_000);
        assert_eq!(log.table("fixed").unwrap().column("a.y").unwrap().to_f64()[3], 1.5);
        assert_eq!(log.table("seldom").unwrap().column("b.z").unwrap().to_f64(), [0.0, 5.0]);
    }

    /// Version 1 has milliseconds in four bytes.
    #[test]
    fn version_1() {
        let mut bytes = b"\xbc\x01\x00\x01\x00\xff\xfffixed\0\x01\x00a.x(h)\0".to_vec();
        for k in 0..60_i16 {
            bytes.extend(0xffff_u16.to_le_bytes());
            bytes.extend((i32::from(k) * 10).to_le_bytes());
            bytes.extend((-k).to_le_bytes());
        }
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        let log = decode(&bytes, Path::new("log")).unwrap();
        let fixed = log.table("fixed").unwrap();
        assert_eq!((fixed.rows, fixed.times[59], fixed.time_unit), (60, 590, TimeUnit::Milliseconds));
        assert_eq!(fixed.column("a.x").unwrap().to_f64()[59], -59.0);
        assert_eq!(log.losses.damage, Vec::<String>::new());
    }

    #[test]
    fn rows_behind_damage_are_found() {
        let mut bytes = log(100);
        let middle = bytes.len() / 2;
        bytes.drain(middle..middle + 5);
        let log = decode(&bytes, Path::new("log")).unwrap();
        let fixed = log.table("fixed").unwrap();
        assert!(fixed.rows >= 96, "{}", fixed.rows);
        let halves = fixed.column("a.y").unwrap().to_f64();
        assert!(
            fixed.times.iter().zip(&halves).all(|(t, half)| *t as f64 == half * 40_000.0),
            "no mixed rows"
        );
        assert_eq!(log.losses.damage.len(), 2, "{:?}", log.losses.damage);
    }

    /// Rows of 16 bytes, every fifth with one of 11 bytes behind it.
    #[test]
    fn a_cut_log_keeps_its_rows() {
        let bytes = log(100);
        let (_, rows_at) = Header::read(&bytes).unwrap();
        for end in rows_at..bytes.len() - 4 {
            let log = decode(&bytes[..end], Path::new("log")).unwrap();
            let rows_bytes = log.tables[0].rows * 16 + log.tables[1].rows * 11;
            assert!(end - rows_at - rows_bytes < 16, "{rows_bytes} of {}", end - rows_at);
            assert!(!log.losses.damage.is_empty());
        }
    }
}
