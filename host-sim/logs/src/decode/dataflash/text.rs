//! Text logs: a message a line, `FMT` lines that describe the others.

use std::collections::HashMap;

use super::columns::{self, time_unit};
use super::damage::Damage;
use super::format::{FMT, MOST_FORMATS, MessageFormat, is_text};
use super::special::{Row, Special};
use crate::log::{Column, Log, Table, Values};

/// The messages of one type so far.
struct Messages {
    format: MessageFormat,
    time: Option<usize>,
    rows: usize,
    times: Vec<i64>,
    /// A column a field; none for time, text and arrays.
    columns: Vec<Option<Values>>,
}

impl Messages {
    fn new(format: MessageFormat) -> Self {
        let time = format.time_field();
        let column = |(index, field): (usize, &super::format::Field)| {
            // Modes are words, arrays are not written.
            let kept = Some(index) != time && !is_text(field.letter) && !matches!(field.letter, b'M' | b'a');
            kept.then(|| columns::empty(field.letter, 0))
        };
        let columns = format.fields.iter().enumerate().map(column).collect();
        Self { format, time, rows: 0, times: Vec::new(), columns }
    }

    /// Appends the row whose fields begin at a place of a line, if every number of it can be read.
    fn append(&mut self, line: &[u8], start: usize, numbers: &mut Vec<Number>) -> Option<()> {
        numbers.clear();
        let last = self.columns.len().checked_sub(1)?;
        let mut at = start;
        for (index, column) in self.columns.iter().enumerate() {
            let end = if column.is_some() || Some(index) == self.time {
                let (number, end) = Number::next(line, at)?;
                numbers.push(number);
                end
            } else {
                numbers.push(Number::Whole(0));
                // The last field takes what is left, commas and all.
                if index == last { line.len() } else { field_end(line, at) }
            };
            let is_end = if index == last { end == line.len() } else { line.get(end) == Some(&b',') };
            is_end.then_some(())?;
            at = end + 1;
        }
        self.rows += 1;
        for (index, (number, column)) in numbers.iter().zip(&mut self.columns).enumerate() {
            if Some(index) == self.time {
                self.times.push(number.whole());
            } else if let Some(column) = column {
                number.push_to(column);
            }
        }
        Some(())
    }

    fn into_table(mut self) -> Table {
        let time_unit = time_unit(&self.format, self.time);
        self.times.shrink_to_fit();
        let named = self.format.fields.into_iter().zip(self.columns);
        let columns = named
            .filter_map(|(field, values)| {
                let mut values = values?;
                shrink(&mut values);
                Some(Column { name: field.label, values })
            })
            .collect();
        Table {
            name: self.format.name,
            message_type: None,
            time_unit,
            times: self.times,
            rows: self.rows,
            columns,
        }
    }
}

pub(super) fn decode(bytes: &[u8], log: &mut Log) {
    let mut all = vec![Messages::new(MessageFormat::of_formats())];
    let mut by_name = HashMap::from([("FMT".to_owned(), 0)]);
    let mut names: HashMap<usize, String> = HashMap::new();
    let (mut special, mut damage) = (Special::default(), Damage::default());
    let (mut start, mut row, mut numbers) = (0, Vec::new(), Vec::new());
    let comma_space = memchr::memmem::find(&bytes[..bytes.len().min(8192)], b"FMT, ").is_some();
    while start < bytes.len() {
        let end = memchr::memchr(b'\n', &bytes[start..]).map_or(bytes.len(), |length| start + length);
        let line = std::str::from_utf8(&bytes[start..end]).map(str::trim_end);
        let (at, length) = (start, end - start);
        start = end + 1;
        let Ok(line) = line else {
            damage.leave_out(at, length);
            continue;
        };
        let name_end = field_end(line.as_bytes(), 0);
        let (name, Some(rest)) = (&line[..name_end], line.get(name_end + 1..)) else { continue };
        let Some(&known) = by_name.get(name) else { continue };
        let messages = &mut all[known];
        if messages.append(line.as_bytes(), name_end + 1, &mut numbers).is_none() {
            damage.leave_out(at, length);
            continue;
        }
        if known == 0 || Special::wants(name) {
            split(rest, messages.format.fields.len(), comma_space, &mut row);
            special.take(name, &TextRow { format: &messages.format, row: &row }, log);
        }
        if known == 0 {
            describe(&row, &mut all, &mut by_name, &mut names, &mut damage);
        }
    }
    special.finish(log, &|kind| names.get(&kind).cloned());
    log.tables = all.into_iter().filter(|messages| messages.rows > 0).map(Messages::into_table).collect();
    log.losses.damage = damage.sentences();
}

/// Where the field that begins at a place ends.
fn field_end(line: &[u8], at: usize) -> usize {
    let rest = line.get(at..).unwrap_or_default();
    memchr::memchr(b',', rest).map_or(line.len(), |length| at + length)
}

/// Cuts a line into its fields; the last takes what is left, commas and all.
fn split<'log>(rest: &'log str, fields: usize, comma_space: bool, row: &mut Vec<&'log str>) {
    row.clear();
    let mut start = 0;
    let commas = memchr::memchr_iter(b',', rest.as_bytes()).take(fields.saturating_sub(1));
    for end in commas.chain([rest.len()]) {
        let text = &rest[start..end];
        row.push(if comma_space { text.strip_prefix(' ').unwrap_or(text) } else { text });
        start = end + 1;
    }
}

/// Takes in a description.
fn describe(
    row: &[&str],
    all: &mut Vec<Messages>,
    by_name: &mut HashMap<String, usize>,
    names: &mut HashMap<usize, String>,
    damage: &mut Damage,
) {
    let &[kind, _, name, letters, labels] = row else { return };
    let Ok(kind) = kind.trim().parse::<u8>() else { return };
    if kind == FMT || name == "FMT" {
        return;
    }
    // The length is that of the binary message; text has none of its own.
    let format = MessageFormat::new(name.trim(), usize::MAX, letters.trim().as_bytes(), labels);
    let Some(format) = format.filter(|_| all.len() < MOST_FORMATS) else {
        damage.formats += 1;
        return;
    };
    names.insert(kind.into(), format.name.clone());
    let known = all.iter().position(|messages| messages.format == format);
    by_name.insert(
        format.name.clone(),
        known.unwrap_or_else(|| {
            all.push(Messages::new(format));
            all.len() - 1
        }),
    );
}

/// A number of a text log.
#[derive(Debug, Clone, Copy)]
enum Number {
    Whole(i64),
    /// Times and counters past `i64`.
    Large(u64),
    Real(f64),
}

impl Number {
    /// The number of the field that begins at a place, and where the field ends.
    #[inline]
    fn next(line: &[u8], at: usize) -> Option<(Self, usize)> {
        const SURELY_FIT: usize = 18;
        let start = at + usize::from(line.get(at) == Some(&b' '));
        let is_negative = line.get(start) == Some(&b'-');
        let first = start + usize::from(is_negative);
        let (mut end, mut whole) = (first, 0_i64);
        while let Some(digit) = line.get(end).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10)
        {
            whole = whole.wrapping_mul(10).wrapping_add(digit.into());
            end += 1;
        }
        match line.get(end) {
            None | Some(b',') if (1..=SURELY_FIT).contains(&(end - first)) => {
                return Some((Self::Whole(if is_negative { -whole } else { whole }), end));
            }
            Some(b'.') if end > first => {
                if let Some((number, end)) = flights::read_decimal(line, start) {
                    return Some((Self::Real(number), end));
                }
            }
            _ => {}
        }
        let end = field_end(line, at);
        let text = std::str::from_utf8(line.get(at..end)?).ok()?;
        Some((Self::read(text)?, end))
    }

    /// A number in any form.
    fn read(text: &str) -> Option<Self> {
        let text = text.trim_ascii();
        let whole = || text.parse().ok().map(Self::Whole);
        let large = || text.parse().ok().map(Self::Large);
        whole().or_else(large).or_else(|| text.parse().ok().map(Self::Real))
    }

    fn whole(self) -> i64 {
        match self {
            Self::Whole(number) => number,
            Self::Large(number) => i64::try_from(number).unwrap_or(i64::MAX),
            Self::Real(number) => number as i64,
        }
    }

    fn real(self) -> f64 {
        match self {
            Self::Whole(number) => number as f64,
            Self::Large(number) => number as f64,
            Self::Real(number) => number,
        }
    }

    /// Appends to a column; what does not fit becomes the nearest that does.
    fn push_to(self, column: &mut Values) {
        let whole = self.whole();
        match column {
            Values::I8(values) => values.push(whole.clamp(i8::MIN.into(), i8::MAX.into()) as i8),
            Values::U8(values) => values.push(whole.clamp(0, u8::MAX.into()) as u8),
            Values::I16(values) => values.push(whole.clamp(i16::MIN.into(), i16::MAX.into()) as i16),
            Values::U16(values) => values.push(whole.clamp(0, u16::MAX.into()) as u16),
            Values::I32(values) => values.push(whole.clamp(i32::MIN.into(), i32::MAX.into()) as i32),
            Values::U32(values) => values.push(whole.clamp(0, u32::MAX.into()) as u32),
            Values::I64(values) => values.push(whole),
            Values::U64(values) => {
                values.push(if let Self::Large(number) = self { number } else { whole.max(0) as u64 })
            }
            Values::F32(values) => values.push(self.real() as f32),
            Values::F64(values) => values.push(self.real()),
        }
    }
}

/// Gives back memory that growing took.
fn shrink(values: &mut Values) {
    match values {
        Values::I8(values) => values.shrink_to_fit(),
        Values::U8(values) => values.shrink_to_fit(),
        Values::I16(values) => values.shrink_to_fit(),
        Values::U16(values) => values.shrink_to_fit(),
        Values::I32(values) => values.shrink_to_fit(),
        Values::U32(values) => values.shrink_to_fit(),
        Values::I64(values) => values.shrink_to_fit(),
        Values::U64(values) => values.shrink_to_fit(),
        Values::F32(values) => values.shrink_to_fit(),
        Values::F64(values) => values.shrink_to_fit(),
    }
}

/// One line, its fields by name.
struct TextRow<'log> {
    format: &'log MessageFormat,
    row: &'log [&'log str],
}

impl TextRow<'_> {
    fn field(&self, label: &str) -> Option<&str> {
        let at = self.format.fields.iter().position(|field| field.label == label)?;
        self.row.get(at).map(|text| text.trim())
    }
}

impl Row for TextRow<'_> {
    fn text(&self, label: &str) -> Option<String> {
        self.field(label).map(|text| text.chars().filter(|c| !c.is_control()).collect())
    }

    fn number(&self, label: &str) -> Option<f64> {
        let text = self.field(label)?;
        // Letters of units are written as themselves.
        let letter = || {
            text.chars()
                .next()
                .filter(|_| text.chars().count() == 1)
                .map(|letter| f64::from(u32::from(letter)))
        };
        Number::read(text).map(Number::real).or_else(letter)
    }
}
