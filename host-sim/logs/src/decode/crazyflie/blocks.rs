//! The format before the magic number (firmware until about 2020).
//!
//! u8 number of variables, each `name(t),`, then the inverted CRC-32 of all before. Then blocks: u8
//! number of rows, the rows, packed, and the inverted CRC-32 of the block. The first variable is the
//! time: us, or ms in the oldest firmware.

use super::super::common::bytes::Cursor;
use super::super::common::faults::Faults;
use super::variables::{self, Kind, Variable};
use crate::format::Format;
use crate::log::{Log, TimeUnit, Values};

/// Rows that are closer than this in ticks are logged in ms: nobody logs with 2 kHz and more, or slower
/// than 2 Hz.
const FEWEST_TICKS_US: i64 = 500;
/// Rows that follow each other are no further apart than a minute.
const NEAR_TICKS: u32 = 60_000_000;

pub(super) fn decode(bytes: &[u8]) -> Log {
    let mut faults = Faults::default();
    let mut cursor = Cursor::at(bytes, 1);
    let count = bytes.first().copied().unwrap_or(0);
    let names = (0..count).map_while(|_| Variable::parse(cursor.until(b',')?));
    let variables: Vec<Variable> = names.collect();
    let header_end = cursor.position();
    if cursor.u32() != Some(!crc32fast::hash(&bytes[..header_end])) || variables.len() < usize::from(count) {
        faults.say("the checksum of the header does not match: names or types of variables may be wrong");
    }
    let row_bytes: usize = variables.iter().map(|variable| variable.kind.bytes()).sum();
    let has_ticks = variables.first().is_some_and(|variable| variable.kind == Kind::U32);
    let blocks = Blocks { bytes, row_bytes, has_ticks };
    let rows_at = blocks.read(cursor.position(), &mut faults);
    let mut log = Log::new(Format::Crazyflie);
    log.information.insert("version".into(), "0".into());
    let mut table =
        variables::table("(only)", &variables, bytes, &rows_at, Vec::new(), TimeUnit::Microseconds);
    if let Some(Values::U32(ticks)) = table.columns.first().map(|column| &column.values) {
        table.times = ticks.iter().map(|&tick| i64::from(tick)).collect();
        table.time_unit = unit(&table.times);
    }
    log.tables.push(table);
    log.losses.damage = faults.into_sentences();
    log
}

/// Unit of the ticks.
fn unit(times: &[i64]) -> TimeUnit {
    let mut steps: Vec<i64> = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    let middle = steps.len() / 2;
    let in_ms = !steps.is_empty() && *steps.select_nth_unstable(middle).1 < FEWEST_TICKS_US;
    if in_ms { TimeUnit::Milliseconds } else { TimeUnit::Microseconds }
}

/// The blocks of a file.
#[derive(Debug, Clone, Copy)]
struct Blocks<'a> {
    bytes: &'a [u8],
    row_bytes: usize,
    /// Whether rows begin with their time.
    has_ticks: bool,
}

enum Block {
    Whole { rows: usize, end: usize },
    Wrong { end: usize },
    Cut,
}

impl Blocks<'_> {
    /// Where the rows of all blocks with a right checksum are.
    fn read(&self, at: usize, faults: &mut Faults) -> Vec<usize> {
        // Looking for the next block means a checksum at many bytes: a hostile file must not make that
        // quadratic.
        let mut effort = self.bytes.len().saturating_mul(64).saturating_add(1 << 20);
        let mut rows_at = Vec::new();
        let mut at = at;
        while at < self.bytes.len() {
            if let Block::Whole { rows, end } = self.block(at) {
                rows_at.extend((0..rows).map(|row| at + 1 + row * self.row_bytes));
                at = end;
                continue;
            }
            let last_tick = rows_at.last().and_then(|&row| Cursor::at(self.bytes, row).u32());
            let next = self.next_block(at, last_tick, &mut effort);
            let rest = if next.is_some() { "" } else { ", all that follows" };
            let end = next.unwrap_or(self.bytes.len());
            faults.say(format!("{} bytes at byte {at} are damaged and left out{rest}", end - at));
            at = end;
        }
        rows_at
    }

    fn block(&self, at: usize) -> Block {
        let rows = usize::from(self.bytes.get(at).copied().unwrap_or(0));
        let data_end = at + 1 + rows * self.row_bytes;
        let Some(data) = self.bytes.get(at..data_end) else { return Block::Cut };
        match Cursor::at(self.bytes, data_end).u32() {
            Some(crc) if crc == !crc32fast::hash(data) => Block::Whole { rows, end: data_end + 4 },
            Some(_) => Block::Wrong { end: data_end + 4 },
            None => Block::Cut,
        }
    }

    /// The next block behind a damaged one: where its own length says, else the first place with a
    /// right checksum.
    fn next_block(&self, at: usize, last_tick: Option<u32>, effort: &mut usize) -> Option<usize> {
        if let Block::Wrong { end } = self.block(at)
            && matches!(self.block(end), Block::Whole { .. })
        {
            return Some(end);
        }
        for place in at + 1..self.bytes.len() {
            let rows = usize::from(self.bytes[place]);
            // Zeros without rows are no block.
            if rows > 0 && self.times_fit(place, rows, last_tick) {
                *effort = effort.checked_sub(8 + rows * self.row_bytes)?;
                if matches!(self.block(place), Block::Whole { .. }) {
                    return Some(place);
                }
            }
        }
        None
    }

    /// Whether the first and the last row of a block here would be near each other, and near the last
    /// row that was read.
    fn times_fit(&self, at: usize, rows: usize, last_tick: Option<u32>) -> bool {
        let tick = |row: usize| Cursor::at(self.bytes, at + 1 + row * self.row_bytes).u32();
        let near = |a: u32, b: u32| b.wrapping_sub(a) < NEAR_TICKS;
        match (tick(0), tick(rows - 1)) {
            (Some(first), Some(last)) if self.has_ticks => {
                near(first, last) && last_tick.is_none_or(|before| near(before, first))
            }
            (Some(_), Some(_)) => true,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of two rows, 10 ms apart.
    fn log(blocks: u32) -> Vec<u8> {
        let mut bytes = b"\x02tick(I),acc.z(f),".to_vec();
        bytes.extend((!crc32fast::hash(&bytes)).to_le_bytes());
        for block in 0..blocks {
            let begin = bytes.len();
            bytes.push(2);
            for row in 2 * block..2 * block + 2 {
                bytes.extend((row * 10_000).to_le_bytes());
                bytes.extend((row as f32).to_le_bytes());
            }
            bytes.extend((!crc32fast::hash(&bytes[begin..])).to_le_bytes());
        }
        bytes
    }

    #[test]
    fn blocks_are_one_table() {
        assert_eq!(Format::of(&log(1)), Some(Format::Crazyflie));
        let log = decode(&log(50));
        assert_eq!(log.losses.damage, Vec::<String>::new());
        let table = log.table("(only)").unwrap();
        assert_eq!((table.rows, table.times[99], table.time_unit), (100, 990_000, TimeUnit::Microseconds));
        assert_eq!(table.column("acc.z").unwrap().to_f64()[7], 7.0);
    }

    #[test]
    fn a_damaged_block_is_left_out() {
        let mut changed = log(50);
        changed[200] ^= 1;
        assert_eq!(decode(&changed).tables[0].rows, 98);
        let mut missing = log(50);
        missing.drain(200..203);
        let log = decode(&missing);
        assert_eq!((log.tables[0].rows, log.losses.damage.len()), (98, 1));
    }
}
