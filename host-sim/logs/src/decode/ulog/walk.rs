//! From record to record, and past what is none.

use std::ops::Range;

use crate::progress::Decoding;

use super::contents::Contents;
use super::records::{Belief, RECORD_HEADER_BYTES, Raw};

const LONGEST_RECORD: usize = RECORD_HEADER_BYTES + u16::MAX as usize;

/// Takes in all records of a section.
pub(super) fn walk<'a>(
    bytes: &'a [u8],
    section: Range<usize>,
    contents: &mut Contents<'a>,
    progress: &mut Decoding<'_>,
) {
    let Range { start: mut at, end } = section;
    while at < end {
        progress.at(at);
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
        belief @ (Belief::Possible | Belief::Unknown) => {
            // Its length may be damaged: then it ends anywhere, and others lie within it.
            leads_on(bytes, record.next(), end, belief, contents) && !covers_others(bytes, record, contents)
        }
    }
}

/// Whether records go on after one that is not certain by itself.
fn leads_on(bytes: &[u8], mut at: usize, end: usize, belief: Belief, contents: &Contents<'_>) -> bool {
    const FURTHEST: usize = 8;
    for _ in 0..FURTHEST {
        if at == end {
            return true;
        }
        let Some(next) = Raw::at(bytes, at, end) else {
            // The last record of a log is often cut.
            let kind = bytes[..end].get(at + RECORD_HEADER_BYTES - 1);
            return belief == Belief::Possible && kind.is_none_or(|kind| b"ABCDFILMOPQRS".contains(kind));
        };
        match contents.belief(next) {
            Belief::Certain => return true,
            Belief::Possible if belief == Belief::Possible => return true,
            Belief::Possible | Belief::Unknown => at = next.next(),
            Belief::No => return false,
        }
    }
    false
}

/// Whether two records that are certain follow each other within the body of one that is not.
fn covers_others(bytes: &[u8], record: Raw<'_>, contents: &Contents<'_>) -> bool {
    let end = record.next();
    let certain =
        |at: usize| Raw::at(bytes, at, end).filter(|record| contents.belief(*record) == Belief::Certain);
    (record.body_at..end).any(|at| certain(at).is_some_and(|first| certain(first.next()).is_some()))
}

/// Whether records start again at a place within damage.
fn resumes(bytes: &[u8], place: usize, end: usize, contents: &Contents<'_>) -> bool {
    Raw::at(bytes, place, end).is_some_and(|record| contents.belief(record) == Belief::Certain)
}
