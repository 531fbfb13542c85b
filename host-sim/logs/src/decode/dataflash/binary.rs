//! Binary logs: first where each message stands, then a column after the other.

use super::columns;
use super::damage::Damage;
use super::format::{FMT, Field, HEADER, HEADER_LENGTH, MOST_FORMATS, MessageFormat, is_text, plain_text};
use super::messages::Messages;
use super::special::{Row, Special};
use crate::log::Log;
use crate::progress::Decoding;

/// Blocks of flash memory are this long at most: what is left of the last one is no damage.
const PADDING: usize = 528;

/// Where the messages of a log stand.
struct Index<'log> {
    bytes: &'log [u8],
    all: Vec<Messages>,
    /// Which of `all` each type is now.
    by_type: [Option<usize>; 256],
    damage: Damage,
}

pub(super) fn decode(bytes: &[u8], log: &mut Log, progress: &mut Decoding<'_>) {
    let mut index = Index { bytes, all: Vec::new(), by_type: [None; 256], damage: Damage::default() };
    index.all.push(Messages { format: MessageFormat::of_formats(), starts: Vec::new() });
    index.by_type[usize::from(FMT)] = Some(0);
    index.fill(progress);
    let mut special = Special::default();
    for messages in &mut index.all {
        messages.starts.shrink_to_fit();
        for &start in
            messages.starts.iter().take(if Special::wants(&messages.format.name) { usize::MAX } else { 0 })
        {
            special.take(
                &messages.format.name,
                &BinaryRow { bytes, start: start as usize, format: &messages.format },
                log,
            );
        }
    }
    let names = index.by_type.map(|all| all.map(|at| index.all[at].format.name.clone()));
    special.finish(log, &|kind| names.get(kind).cloned().flatten());
    log.tables = index
        .all
        .iter()
        .filter(|messages| !messages.starts.is_empty())
        .map(|messages| columns::table(messages, bytes))
        .collect();
    log.losses.damage = index.damage.sentences();
}

impl Index<'_> {
    /// Walks through the file.
    fn fill(&mut self, progress: &mut Decoding<'_>) {
        let mut at = 0;
        while at < self.bytes.len() {
            progress.at(at);
            at = match self.length_at(at) {
                Some(length) => self.message(at, length),
                None => self.skip(at),
            };
        }
    }

    /// The length of the message at a place, if one of a known type begins there.
    fn length_at(&self, at: usize) -> Option<usize> {
        let &[first, second, kind] = self.bytes.get(at..at + HEADER_LENGTH)? else { return None };
        let known = self.by_type[usize::from(kind)].filter(|_| [first, second] == HEADER)?;
        Some(self.all[known].format.length)
    }

    /// Whether a message may begin at a place, or the file ends there.
    fn may_begin(&self, at: usize) -> bool {
        self.bytes.get(at..).is_some_and(|rest| HEADER.starts_with(&rest[..rest.len().min(HEADER.len())]))
    }

    /// Takes the message at `at`; answers where to go on.
    fn message(&mut self, at: usize, length: usize) -> usize {
        let end = at + length;
        if end > self.bytes.len() {
            // Unless whole messages stand within it, the log ends here.
            let next = self.next_whole(at + HEADER_LENGTH, self.bytes.len());
            match next {
                Some(next) => self.damage.leave_out(at, next - at),
                None => self.damage.cut = true,
            }
            return next.unwrap_or(self.bytes.len());
        }
        if !self.may_begin(end)
            && let Some(next) = self.next_whole(at + HEADER_LENGTH, end)
        {
            // Bytes of it are missing.
            self.damage.leave_out(at, next - at);
            return next;
        }
        self.take(at);
        end
    }

    /// Goes past bytes that are no message; answers where the next one stands.
    fn skip(&mut self, at: usize) -> usize {
        let next = self.next_whole(at, self.bytes.len()).unwrap_or(self.bytes.len());
        let skipped = &self.bytes[at..next];
        let is_padding = next == self.bytes.len()
            && (skipped.len() < PADDING
                || skipped.iter().all(|&byte| byte == 0)
                || skipped.iter().all(|&byte| byte == 0xff));
        if !is_padding {
            self.damage.leave_out(at, skipped.len());
        }
        next
    }

    /// Where, from one place to before another, a message begins that another one follows.
    fn next_whole(&self, from: usize, to: usize) -> Option<usize> {
        let within = self.bytes.get(from..to)?;
        memchr::memchr_iter(HEADER[0], within).map(|offset| from + offset).find(|&at| {
            self.length_at(at)
                .is_some_and(|length| at + length <= self.bytes.len() && self.may_begin(at + length))
        })
    }

    /// Notes a whole message, and what it describes if it is a description.
    fn take(&mut self, at: usize) {
        let kind = self.bytes[at + 2];
        if let (Some(known), Ok(start)) = (self.by_type[usize::from(kind)], u32::try_from(at)) {
            self.all[known].starts.push(start);
        }
        if kind == FMT {
            self.describe(at);
        }
    }

    /// Takes in a description.
    fn describe(&mut self, at: usize) {
        let Some(body) = self.bytes.get(at + HEADER_LENGTH..at + 89) else { return };
        let (kind, length) = (usize::from(body[0]), usize::from(body[1]));
        if kind == usize::from(FMT) {
            return;
        }
        let letters = body[6..22].split(|&byte| byte == 0).next().unwrap_or_default();
        let format =
            MessageFormat::new(&plain_text(&body[2..6]), length, letters, &plain_text(&body[22..86]));
        let Some(format) = format else {
            self.damage.formats += 1;
            return;
        };
        let known = self.all.iter().position(|messages| messages.format == format);
        if known.is_none() && self.all.len() >= MOST_FORMATS {
            self.damage.formats += 1;
            return;
        }
        self.by_type[kind] = Some(known.unwrap_or_else(|| {
            self.all.push(Messages { format, starts: Vec::new() });
            self.all.len() - 1
        }));
    }
}

/// One message, its fields by name.
struct BinaryRow<'log> {
    bytes: &'log [u8],
    start: usize,
    format: &'log MessageFormat,
}

impl BinaryRow<'_> {
    fn bytes_of(&self, field: &Field) -> Option<&[u8]> {
        let at = self.start + field.offset;
        self.bytes.get(at..at + super::format::width(field.letter)?)
    }
}

impl Row for BinaryRow<'_> {
    fn text(&self, label: &str) -> Option<String> {
        let field = self.format.field(label).filter(|field| is_text(field.letter))?;
        self.bytes_of(field).map(plain_text)
    }

    fn number(&self, label: &str) -> Option<f64> {
        let field = self.format.field(label)?;
        columns::number(self.bytes_of(field)?, field.letter)
    }
}
