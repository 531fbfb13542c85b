//! How numbers of frames are written: bytes, nibbles and bits, small numbers in few of them.

use std::ops::Range;

/// Reads on through the bytes of a log.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reader<'log> {
    /// What is not read yet.
    rest: &'log [u8],
    /// Whether more was asked for than there is.
    pub(super) past_end: bool,
}

/// Up to eight signed numbers in a row, of which some in a row are kept.
#[derive(Debug)]
pub(super) struct Numbers {
    count: usize,
    /// The bits that none of them has set if each takes one byte.
    continued: u64,
    /// The first one that is kept.
    first: usize,
    /// Where those that are kept go in a frame.
    pub(super) places: Range<usize>,
}

/// Numbers of a `Numbers` at most.
const MOST_NUMBERS: usize = 8;
/// More bytes than those take: within it, no number has to look for the end of the log.
const WINDOW: usize = 64;
/// The highest bit of each of eight bytes: a number goes on behind it.
const CONTINUED: u64 = 0x8080_8080_8080_8080;

/// Bytes of four fields (data version 2) behind the byte of their widths, by that one.
const FOUR_LENGTHS: [u8; 256] = {
    let mut lengths = [0; 256];
    let mut widths = 0;
    while widths < 256 {
        let nibbles: u8 = (1 << (widths & 3) >> 1)
            + (1 << (widths >> 2 & 3) >> 1)
            + (1 << (widths >> 4 & 3) >> 1)
            + (1 << (widths >> 6) >> 1);
        lengths[widths] = nibbles.div_ceil(2);
        widths += 1;
    }
    lengths
};

/// Adds a number to another one.
#[inline]
pub(super) fn add(value: &mut u32, number: u32) {
    *value = value.wrapping_add(number);
}

/// Adds numbers to as many others as there are.
#[inline]
fn add_all(values: &mut [u32], numbers: &[u32]) {
    values.iter_mut().zip(numbers).for_each(|(value, &number)| add(value, number));
}

/// Adds signed numbers of one byte each, the first lowest.
#[inline]
fn add_bytes(values: &mut [u32], bytes: u64) {
    const LOWEST: u64 = 0x0101_0101_0101_0101;
    // All ones where the sign is set: no byte takes from the next.
    let mut numbers = (bytes >> 1 & !CONTINUED) ^ ((bytes & LOWEST) * 0xff);
    for value in values {
        add(value, numbers as i8 as u32);
        numbers >>= 8;
    }
}

/// Reads up to eight signed numbers; answers how many bytes they took.
#[inline]
fn signed_in_window(window: &[u8; WINDOW], values: &mut [u32]) -> usize {
    let byte = |at: usize| u32::from(window[at % WINDOW]);
    let mut at = 0;
    for value in values {
        // One byte or two, without a branch: which of them it is, no processor foresees.
        let (first, second) = (byte(at), byte(at + 1));
        let continued = first >> 7;
        let mut raw = (first & 0x7f) | ((second << 7) & continued.wrapping_neg());
        at += 1 + continued as usize;
        if second >= 0x80 && continued != 0 {
            // Seldom: three to five bytes; more are no number.
            let mut shift = 14;
            while byte(at - 1) >= 0x80 {
                if shift > 28 {
                    raw = 0;
                    break;
                }
                raw = (raw & ((1 << shift) - 1)) | byte(at) << shift;
                at += 1;
                shift += 7;
            }
        }
        *value = (raw >> 1) ^ (raw & 1).wrapping_neg();
    }
    at
}

impl Numbers {
    /// A single one, and its place if it is kept.
    pub(super) fn new(place: Option<usize>) -> Self {
        Self { count: 1, continued: 0x80, first: 0, places: place.map_or(0..0, |place| place..place + 1) }
    }

    /// Takes in another one; answers whether it can.
    pub(super) fn take(&mut self, place: Option<usize>) -> bool {
        let goes_on = self.count == self.first + self.places.len();
        match place {
            _ if self.count == MOST_NUMBERS => return false,
            None => {}
            Some(place) if self.places.is_empty() => {
                (self.first, self.places) = (self.count, place..place + 1);
            }
            Some(_) if goes_on => self.places.end += 1,
            Some(_) => return false,
        }
        self.count += 1;
        self.continued |= self.continued << 8;
        true
    }
}

impl<'log> Reader<'log> {
    pub(super) fn new(bytes: &'log [u8]) -> Self {
        Self { rest: bytes, past_end: false }
    }

    /// Bytes that are not read yet.
    pub(super) fn left(&self) -> usize {
        self.rest.len()
    }

    /// The next byte, if there is one.
    #[inline]
    pub(super) fn next(&mut self) -> Option<u8> {
        let (&byte, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(byte)
    }

    /// Whether certain bytes come next; goes past them if they do.
    pub(super) fn passes(&mut self, expected: &[u8]) -> bool {
        let rest = self.rest.strip_prefix(expected);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    #[inline]
    fn byte(&mut self) -> u8 {
        self.next().unwrap_or_else(|| {
            self.past_end = true;
            0
        })
    }

    /// Goes past some bytes.
    #[inline]
    fn pass(&mut self, count: usize) {
        self.past_end |= count > self.rest.len();
        self.rest = self.rest.get(count..).unwrap_or_default();
    }

    /// Seven bits a byte, the lowest first. More than five bytes are no number.
    #[inline]
    pub(super) fn unsigned(&mut self) -> u32 {
        let first = self.byte();
        if first < 0x80 {
            return first.into();
        }
        let mut value = u32::from(first & 0x7f);
        for shift in [7, 14, 21, 28] {
            let byte = self.byte();
            if self.past_end {
                return 0;
            }
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return value;
            }
        }
        0
    }

    /// The same with the sign in the lowest bit.
    #[inline]
    pub(super) fn signed(&mut self) -> u32 {
        let value = self.unsigned();
        (value >> 1) ^ (value & 1).wrapping_neg()
    }

    /// Adds those of some numbers that are kept. Most take one byte: all are looked at at once.
    #[inline]
    pub(super) fn numbers(&mut self, numbers: &Numbers, values: &mut [u32]) {
        match self.rest.first_chunk().map(|&bytes| u64::from_le_bytes(bytes)) {
            Some(bytes) if bytes & numbers.continued == 0 => {
                add_bytes(values, bytes >> (8 * numbers.first % 64));
                self.rest = self.rest.get(numbers.count..).unwrap_or_default();
            }
            _ => self.long_numbers(numbers, values),
        }
    }

    /// The same, some of more bytes than one.
    fn long_numbers(&mut self, numbers: &Numbers, values: &mut [u32]) {
        let mut read = [0; MOST_NUMBERS];
        let all = &mut read[..numbers.count.min(MOST_NUMBERS)];
        match self.rest.first_chunk() {
            Some(window) => {
                let length = signed_in_window(window, all);
                self.pass(length);
            }
            None => all.iter_mut().for_each(|number| *number = self.signed()),
        }
        add_all(values, all.get(numbers.first..).unwrap_or_default());
    }

    /// The next eight bytes, the first highest; zeros past the end.
    #[inline]
    fn word(&self) -> u64 {
        if let Some(&bytes) = self.rest.first_chunk() {
            return u64::from_be_bytes(bytes);
        }
        self.rest
            .iter()
            .zip((0..8).rev())
            .fold(0, |word, (&byte, place)| word | u64::from(byte) << (8 * place))
    }

    /// The negative of a number of 14 bits.
    pub(super) fn negative_14_bit(&mut self) -> u32 {
        extend(self.unsigned() & 0x3fff, 14).wrapping_neg()
    }

    /// Goes past a group of three fields.
    #[inline]
    pub(super) fn pass_three(&mut self) {
        let first = self.byte();
        self.pass(match first >> 6 {
            3 => (0..3).map(|field| usize::from(first >> (2 * field) & 3) + 1).sum(),
            few => few.into(),
        });
    }

    /// Goes past a group of four fields (data version 2).
    #[inline]
    pub(super) fn pass_four(&mut self) {
        let widths = self.byte();
        self.pass(FOUR_LENGTHS[usize::from(widths)].into());
    }

    /// Adds the numbers behind a byte whose bits say which of the fields are not zero; no such byte for a single one.
    #[inline]
    pub(super) fn up_to_eight(&mut self, values: &mut [u32]) {
        if let [value] = values {
            return add(value, self.signed());
        }
        let mut present = self.byte();
        while present != 0 {
            if let Some(value) = values.get_mut(present.trailing_zeros() as usize) {
                add(value, self.signed());
            }
            present &= present - 1;
        }
    }

    /// Adds three fields whose width stands in the first two bits.
    #[inline]
    pub(super) fn three(&mut self, values: &mut [u32]) {
        let first = u32::from(self.byte());
        add_all(
            values,
            &match first >> 6 {
                0 => [extend(first >> 4, 2), extend(first >> 2, 2), extend(first, 2)],
                1 => {
                    let second = u32::from(self.byte());
                    [extend(first, 4), extend(second >> 4, 4), extend(second, 4)]
                }
                2 => [extend(first, 6), extend(self.byte().into(), 6), extend(self.byte().into(), 6)],
                _ => self.three_of_whole_bytes(first),
            },
        );
    }

    /// The same with other widths.
    pub(super) fn three_variable(&mut self, values: &mut [u32]) {
        let first = u32::from(self.byte());
        add_all(
            values,
            &match first >> 6 {
                0 => [extend(first >> 4, 2), extend(first >> 2, 2), extend(first, 2)],
                1 => {
                    let both = first << 8 | u32::from(self.byte());
                    [extend(both >> 9, 5), extend(both >> 4, 5), extend(both, 4)]
                }
                2 => {
                    let all = first << 16 | u32::from(self.byte()) << 8 | u32::from(self.byte());
                    [extend(all >> 14, 8), extend(all >> 7, 7), extend(all, 7)]
                }
                _ => self.three_of_whole_bytes(first),
            },
        );
    }

    /// Two bits a field say its width: one to four bytes, the lowest first.
    fn three_of_whole_bytes(&mut self, mut widths: u32) -> [u32; 3] {
        let mut values = [0; 3];
        for value in &mut values {
            let bytes = (widths & 3) + 1;
            widths >>= 2;
            let raw = (0..bytes).fold(0, |raw, byte| raw | u32::from(self.byte()) << (8 * byte));
            *value = extend(raw, 8 * bytes);
        }
        values
    }

    /// Adds four fields of 0, 4, 8 or 16 bits without gaps between them, the highest first (data version 2).
    #[inline]
    pub(super) fn four(&mut self, values: &mut [u32]) {
        let all = self.byte();
        if all == 0 {
            return;
        }
        let mut widths = all;
        let word = self.word();
        let mut read = 0;
        let mut numbers = [0; 4];
        for number in &mut numbers {
            let width = widths & 3;
            let bits = (1 << width >> 1) * 4;
            widths >>= 2;
            // The field in the highest bits, so that its sign goes with it; nothing of it if it has no bits.
            let field = ((word << read) as i64 >> 48) as i32 >> (16 - bits);
            *number = field as u32 & u32::from((width + 3) >> 2).wrapping_neg();
            read += bits;
        }
        self.pass(FOUR_LENGTHS[usize::from(all)].into());
        add_all(values, &numbers);
    }

    /// Adds four fields of 0, 4, 8 or 16 bits (data version 1): those of 4 bits come in pairs, the lower half first.
    pub(super) fn four_version_1(&mut self, sums: &mut [u32]) {
        let mut widths = self.byte();
        let mut values = [0; 4];
        let mut index = 0;
        while index < values.len() {
            match widths & 3 {
                0 => {}
                1 => {
                    let both = u32::from(self.byte());
                    values[index] = extend(both, 4);
                    index += 1;
                    widths >>= 2;
                    if let Some(value) = values.get_mut(index) {
                        *value = extend(both >> 4, 4);
                    }
                }
                2 => values[index] = extend(self.byte().into(), 8),
                _ => values[index] = extend(u32::from(self.byte()) | u32::from(self.byte()) << 8, 16),
            }
            widths >>= 2;
            index += 1;
        }
        add_all(sums, &values);
    }
}

/// The lowest bits of a number as a signed one.
#[inline]
fn extend(value: u32, bits: u32) -> u32 {
    let unused = 32 - bits;
    (((value << unused) as i32) >> unused) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of Betaflight's "Blackbox Internals" and of the encodings' descriptions.
    #[test]
    fn numbers_as_the_format_describes_them() {
        let read = |bytes: &'static [u8]| Reader::new(bytes);
        assert_eq!(read(&[0x7f]).unsigned(), 127);
        assert_eq!(read(&[0x80, 0x01]).unsigned(), 128);
        assert_eq!(read(&[0xff, 0xff, 0xff, 0xff, 0x0f]).unsigned(), u32::MAX);
        assert_eq!([0, 1, 2, 3, 4].map(|byte| Reader::new(&[byte]).signed() as i32), [0, -1, 1, -2, 2]);
        assert_eq!(read(&[0xff, 0x3f]).negative_14_bit() as i32, -0x1fff);
        assert_eq!(read(&[0xff, 0x7f]).negative_14_bit() as i32, 1);
        let mut eight = [0; 3];
        read(&[0b101, 2, 1]).up_to_eight(&mut eight);
        assert_eq!(eight.map(|value| value as i32), [1, 0, -1]);
        let three = |bytes| {
            let mut three = [0; 3];
            read(bytes).three(&mut three);
            three.map(|value| value as i32)
        };
        assert_eq!(three(&[0b0001_1011]), [1, -2, -1]);
        assert_eq!(three(&[0x47, 0x8f]), [7, -8, -1]);
        assert_eq!(three(&[0x9f, 0x20, 0x3f]), [31, -32, -1]);
        assert_eq!(three(&[0b1110_0100, 0xff, 0x34, 0x12, 0xfe, 0xff, 0xff]), [-1, 0x1234, -2]);
        // 4 bits, 8 bits across two bytes, nothing, 16 bits across three bytes.
        let mut four = [0; 4];
        read(&[0b1100_1001, 0x7f, 0xe1, 0x23, 0x40]).four(&mut four);
        assert_eq!(four.map(|value| value as i32), [7, -2, 0, 0x1234]);
    }

    /// Of four numbers the two in the middle: one byte each, one of two bytes, and too near the end to be read at once.
    #[test]
    fn numbers_that_are_kept_among_others() {
        let mut numbers = Numbers::new(None);
        assert!(numbers.take(Some(3)) && numbers.take(Some(4)) && numbers.take(None));
        assert!(!numbers.take(Some(5)), "what is kept goes on without a gap");
        let logs: [(&[u8], [u32; 2]); 4] = [
            (&[2, 4, 6, 8], [2, 3]),
            (&[2, 3, 6, 0x80, 1], [-2_i32 as u32, 3]),
            (&[2, 0x80, 2, 6, 8], [128, 3]),
            (&[0x80, 0x80, 1, 1, 6, 8], [u32::MAX, 3]),
        ];
        for (log, expected) in logs {
            for behind in [0, 8, WINDOW] {
                let bytes = [log, &vec![0; behind]].concat();
                let (mut reader, mut values) = (Reader::new(&bytes), [0; 2]);
                reader.numbers(&numbers, &mut values);
                assert_eq!((values, reader.left(), reader.past_end), (expected, behind, false), "{log:?}");
            }
        }
    }

    #[test]
    fn past_the_end_all_is_zero() {
        let mut reader = Reader::new(&[0x80]);
        assert_eq!(reader.unsigned(), 0);
        assert!(reader.past_end);
    }
}
