//! From record to record, and past what is none.

use std::ops::Range;

use super::contents::Contents;
use super::records::{Belief, RECORD_HEADER_BYTES, Raw};

const LONGEST_RECORD: usize = RECORD_HEADER_BYTES + u16::MAX as usize;

/// Takes in all records of a section.
pub(super) fn walk<'a>(bytes: &'a [u8], section: Range<usize>, contents: &mut Contents<'a>) {
    let Range { start: mut at, end } = section;
    while at < end {
        if let Some(next) = contents.take_row(bytes, at, end) {
            at = next;
            continue;
        }
        match Raw::at(bytes, at, end) {
            Some(record) if stands(bytes, record, end, contents) => {
                contents.take(record);
                at = record.next();
            }
            _ => {
                let next = (at + 1..end).find(|&place| resumes(bytes, place, end, contents));
                // The part before appended data may end within a record: that is what appending is for.
                if next.is_some() || end == bytes.len() || end - at > LONGEST_RECORD {
                    contents.leave_out(at..next.unwrap_or(end), next.is_none());
                }
                at = next.unwrap_or(end);
            }
        }
    }
}

/// Whether a record is taken for one where one is expected.
fn stands(bytes: &[u8], record: Raw<'_>, end: usize, contents: &Contents<'_>) -> bool {
    match contents.belief(record) {
        Belief::Certain => true,
        Belief::No => false,
        // Its length may be damaged: then it does not end where another one starts or the file is cut.
        Belief::Possible if record.next() == end => true,
        Belief::Possible => match Raw::at(bytes, record.next(), end) {
            Some(next) => contents.belief(next) != Belief::No,
            None => bytes
                .get(record.next() + RECORD_HEADER_BYTES - 1)
                .is_none_or(|kind| b"ABCDFILMOPQRS".contains(kind)),
        },
    }
}

/// Whether records start again at a place within damage: one that is certain, or leads to such a one.
fn resumes(bytes: &[u8], place: usize, end: usize, contents: &Contents<'_>) -> bool {
    let mut at = place;
    for _ in 0..3 {
        let Some(record) = Raw::at(bytes, at, end) else { return false };
        match contents.belief(record) {
            Belief::Certain => return true,
            Belief::No => return false,
            Belief::Possible => at = record.next(),
        }
    }
    false
}
