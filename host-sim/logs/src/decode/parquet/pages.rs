//! The headers of pages, looked at before they are decompressed: a few damaged bytes must not reserve
//! gigabytes.
//!
//! Thrift's compact protocol
//! (<https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>), and
//! `PageHeader` of parquet.thrift: 2 bytes uncompressed, 3 bytes compressed, 7 header of a dictionary,
//! whose 1 is the number of values.

use super::super::common::budget::Budget;
use super::super::common::bytes::Cursor;

/// Structs in structs.
const DEEPEST: usize = 16;

/// Checks that all pages of a column are within its bytes and the budget; nothing if not.
pub(super) fn check(chunk: &[u8], budget: &mut Budget) -> Option<()> {
    let mut cursor = Cursor::new(chunk);
    while cursor.left() > 0 {
        let mut header = PageHeader::default();
        read_struct(&mut cursor, &mut Vec::new(), &mut |path, number| match path {
            [2] => header.uncompressed = number,
            [3] => header.compressed = number,
            [7, 1] => header.dictionary_values = number,
            _ => {}
        })?;
        let uncompressed = usize::try_from(header.uncompressed).ok()?;
        let dictionary_values = usize::try_from(header.dictionary_values).ok()?;
        // No value of a dictionary is shorter than a byte.
        if dictionary_values > uncompressed || !budget.take(uncompressed) {
            return None;
        }
        cursor.take(usize::try_from(header.compressed).ok()?)?;
    }
    Some(())
}

#[derive(Default)]
struct PageHeader {
    uncompressed: i64,
    compressed: i64,
    dictionary_values: i64,
}

/// Reads a struct; every integer goes to `found` with the numbers of the fields that lead to it.
fn read_struct(
    cursor: &mut Cursor<'_>,
    path: &mut Vec<i16>,
    found: &mut impl FnMut(&[i16], i64),
) -> Option<()> {
    if path.len() >= DEEPEST {
        return None;
    }
    let mut field = 0_i16;
    loop {
        let head = cursor.u8()?;
        if head == 0 {
            return Some(());
        }
        let step = i16::from(head >> 4);
        field = if step == 0 { i16::try_from(zigzag(cursor)?).ok()? } else { field.checked_add(step)? };
        path.push(field);
        read_value(cursor, head & 0x0f, false, path, found)?;
        path.pop();
    }
}

fn read_value(
    cursor: &mut Cursor<'_>,
    kind: u8,
    in_list: bool,
    path: &mut Vec<i16>,
    found: &mut impl FnMut(&[i16], i64),
) -> Option<()> {
    match kind {
        // The value of a truth value that is a field is in its type.
        1 | 2 => cursor.take(usize::from(in_list)).map(|_| ()),
        3 => cursor.take(1).map(|_| ()),
        4..=6 => {
            let number = zigzag(cursor)?;
            found(path, number);
            Some(())
        }
        7 => cursor.take(8).map(|_| ()),
        8 => {
            let length = usize::try_from(varint(cursor)?).ok()?;
            cursor.take(length).map(|_| ())
        }
        9 | 10 => {
            let head = cursor.u8()?;
            let count = if head >> 4 == 15 { varint(cursor)? } else { u64::from(head >> 4) };
            // Each element takes a byte at least, so this ends with the bytes.
            path.push(-1);
            (0..count).try_for_each(|_| read_value(cursor, head & 0x0f, true, path, found))?;
            path.pop();
            Some(())
        }
        12 => read_struct(cursor, path, found),
        _ => None,
    }
}

fn varint(cursor: &mut Cursor<'_>) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let byte = cursor.u8()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

fn zigzag(cursor: &mut Cursor<'_>) -> Option<i64> {
    let value = varint(cursor)?;
    Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the specification of zigzag and variable-length integers.
    #[test]
    fn numbers_of_the_compact_protocol() {
        let zigzag_of = |bytes: &[u8]| zigzag(&mut Cursor::new(bytes));
        assert_eq!(zigzag_of(&[0]), Some(0));
        assert_eq!(zigzag_of(&[1]), Some(-1));
        assert_eq!(zigzag_of(&[2]), Some(1));
        assert_eq!(varint(&mut Cursor::new(&[0xac, 0x02])), Some(300));
        assert_eq!(varint(&mut Cursor::new(&[0xff; 11])), None);
    }

    #[test]
    fn pages_larger_than_the_budget_are_refused() {
        // type 0, uncompressed 1 << 30, compressed 1, end; a byte of data.
        let page = |size: [u8; 5]| [&[0x15, 0, 0x15][..], &size, &[0x15, 2, 0, 9]].concat();
        let mut budget = Budget::for_decompression(0);
        assert_eq!(check(&page([0x80, 0x80, 0x80, 0x80, 0x08]), &mut budget), None);
        assert_eq!(check(&page([0x82, 0x80, 0x80, 0x80, 0x00]), &mut budget), Some(()));
    }
}
