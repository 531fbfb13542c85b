//! Formats of topics, and where each of their fields lies in a row.

use std::collections::HashMap;

use super::records::{Kind, is_name, typed_name};

/// A row is at most what a record holds beside the topic's number.
const LONGEST_ROW: usize = u16::MAX as usize - 2;

/// Formats within formats: real logs have two.
const DEEPEST: usize = 16;

/// A field of a format: one value or an array of them.
#[derive(Debug, Clone, Copy)]
struct Field<'a> {
    kind: Kind,
    /// The type's name, which a format within a format is found by.
    type_name: &'a str,
    count: usize,
    name: &'a str,
}

/// The extent of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Extent {
    /// With padding at its end.
    pub(super) bytes: usize,
    /// Up to the end of the last field that is not padding: writers may leave out what follows.
    pub(super) used_bytes: usize,
}

/// A column of a topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    /// `esc[1].esc_rpm`.
    pub(super) name: String,
    pub(super) kind: Kind,
    /// From the start of the row.
    pub(super) offset: usize,
}

/// All formats that a log defines.
#[derive(Debug, Default)]
pub(super) struct Formats<'a> {
    fields: HashMap<&'a str, Vec<Field<'a>>>,
    /// What has been worked out; none for a format that cannot be read, or is just being worked out.
    extents: HashMap<&'a str, Option<Extent>>,
}

/// Whether a body is a definition: `name:type field;type field;`.
pub(super) fn is_definition(body: &[u8]) -> bool {
    definition(body)
        .is_some_and(|(_, fields)| fields.split_terminator(';').all(|field| typed_name(field).is_some()))
}

/// Name and fields of a definition. A name is short: a long one is not looked through at every
/// place of a file.
fn definition(body: &[u8]) -> Option<(&str, &str)> {
    let colon = memchr::memchr(b':', &body[..body.len().min(256)])?;
    let (name, fields) = body.split_at_checked(colon)?;
    let name = std::str::from_utf8(name).ok().filter(|name| is_name(name))?;
    Some((name, std::str::from_utf8(fields.get(1..)?).ok()?))
}

impl<'a> Formats<'a> {
    /// Takes a definition in. The first one of a name stays.
    pub(super) fn define(&mut self, body: &'a [u8]) {
        let Some((name, fields)) = definition(body) else { return };
        self.fields.entry(name).or_insert_with(|| {
            let fields = fields.split_terminator(';').filter_map(typed_name);
            fields
                .map(|(type_name, count, name)| Field { kind: Kind::of(type_name), type_name, count, name })
                .collect()
        });
    }

    /// Whether there is such a format.
    pub(super) fn has(&self, name: &str) -> bool {
        self.fields.contains_key(name)
    }

    /// The extent of a format's row; none where a part is not defined, is within itself or is too large.
    pub(super) fn extent(&mut self, name: &str) -> Option<Extent> {
        self.extent_within(name, 0)
    }

    fn extent_within(&mut self, name: &str, depth: usize) -> Option<Extent> {
        let name = *self.fields.get_key_value(name)?.0;
        if let Some(known) = self.extents.get(name) {
            return *known;
        }
        self.extents.insert(name, None);
        // Taken out while it is worked out, not to be copied; a format within itself is found by `extents`.
        let fields = self.fields.get_mut(name).map(std::mem::take).unwrap_or_default();
        let extent = if depth < DEEPEST { self.extent_of(&fields, depth) } else { None };
        self.fields.insert(name, fields);
        self.extents.insert(name, extent);
        extent
    }

    fn extent_of(&mut self, fields: &[Field<'a>], depth: usize) -> Option<Extent> {
        let mut extent = Extent { bytes: 0, used_bytes: 0 };
        for field in fields {
            let one = match field.kind.bytes() {
                Some(bytes) => Extent { bytes, used_bytes: bytes },
                None => self.extent_within(field.type_name, depth + 1)?,
            };
            let all = one.bytes.checked_mul(field.count).filter(|&all| all <= LONGEST_ROW)?;
            if !field.is_padding() && one.used_bytes > 0 && field.count > 0 {
                extent.used_bytes = extent.bytes + all - one.bytes + one.used_bytes;
            }
            extent.bytes += all;
            if extent.bytes > LONGEST_ROW {
                return None;
            }
        }
        Some(extent)
    }

    /// The columns of a format whose extent is known, padding left out.
    pub(super) fn places(&self, name: &str) -> Vec<Place> {
        let mut places = Vec::new();
        self.add_places(name, "", 0, &mut places);
        places
    }

    fn add_places(&self, name: &str, prefix: &str, start: usize, places: &mut Vec<Place>) {
        let mut offset = start;
        for field in self.fields.get(name).into_iter().flatten() {
            let known = || self.extents.get(field.type_name).copied().flatten();
            let Some(bytes) = field.kind.bytes().or_else(|| known().map(|extent| extent.bytes)) else {
                return;
            };
            // What takes no room has no values, however many there are said to be.
            if bytes > 0 && !field.is_padding() {
                for index in 0..field.count {
                    let own = match field.count {
                        1 => format!("{prefix}{}", field.name),
                        _ => format!("{prefix}{}[{index}]", field.name),
                    };
                    let offset = offset + index * bytes;
                    match field.kind {
                        Kind::Named => self.add_places(field.type_name, &format!("{own}."), offset, places),
                        kind => places.push(Place { name: own, kind, offset }),
                    }
                }
            }
            offset += bytes * field.count;
        }
    }
}

impl Field<'_> {
    fn is_padding(&self) -> bool {
        self.name.starts_with("_padding")
    }
}
