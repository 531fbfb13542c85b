//! How numbers of frames are written: bytes, nibbles and bits, small numbers in few of them.

/// Reads on through the bytes of a log.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reader<'log> {
    bytes: &'log [u8],
    /// The next byte.
    pub(super) at: usize,
    /// Whether more was asked for than there is.
    pub(super) past_end: bool,
}

/// More bytes than eight numbers take: within it, no number has to look for the end of the log.
const WINDOW: usize = 64;

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

impl<'log> Reader<'log> {
    pub(super) fn new(bytes: &'log [u8]) -> Self {
        Self { bytes, at: 0, past_end: false }
    }

    /// The next byte, if there is one.
    pub(super) fn next(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.at).copied()?;
        self.at += 1;
        Some(byte)
    }

    /// Whether certain bytes come next; goes past them if they do.
    pub(super) fn passes(&mut self, expected: &[u8]) -> bool {
        let passes = self.bytes.get(self.at..).is_some_and(|rest| rest.starts_with(expected));
        if passes {
            self.at += expected.len();
        }
        passes
    }

    #[inline]
    fn byte(&mut self) -> u8 {
        if let Some(&byte) = self.bytes.get(self.at) {
            self.at += 1;
            return byte;
        }
        self.past_end = true;
        0
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

    /// A run of signed numbers. Most take one byte: a run of such is read at once.
    #[inline]
    pub(super) fn signed_run(&mut self, values: &mut [u32]) {
        for values in values.chunks_mut(8) {
            let continued = self.word().swap_bytes() & 0x8080_8080_8080_8080;
            if continued.trailing_zeros() as usize / 8 >= values.len() && self.at + 8 <= self.bytes.len() {
                for (value, &byte) in values.iter_mut().zip(&self.bytes[self.at..]) {
                    *value = u32::from(byte >> 1) ^ u32::from(byte & 1).wrapping_neg();
                }
                self.at += values.len();
            } else if let Some(window) = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk()) {
                self.at += signed_in_window(window, values);
            } else {
                values.iter_mut().for_each(|value| *value = self.signed());
            }
        }
    }

    /// The next eight bytes, the first highest; zeros past the end.
    #[inline]
    fn word(&self) -> u64 {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        if let Some(&bytes) = rest.first_chunk() {
            return u64::from_be_bytes(bytes);
        }
        rest.iter().zip((0..8).rev()).fold(0, |word, (&byte, place)| word | u64::from(byte) << (8 * place))
    }

    /// The negative of a number of 14 bits.
    pub(super) fn negative_14_bit(&mut self) -> u32 {
        extend(self.unsigned() & 0x3fff, 14).wrapping_neg()
    }

    /// A byte whose bits say which of the fields are not zero, then those; no such byte for a single one.
    #[inline]
    pub(super) fn up_to_eight(&mut self, values: &mut [u32]) {
        if let [value] = values {
            *value = self.signed();
            return;
        }
        values.fill(0);
        let mut present = self.byte();
        while present != 0 {
            if let Some(value) = values.get_mut(present.trailing_zeros() as usize) {
                *value = self.signed();
            }
            present &= present - 1;
        }
    }

    /// Three fields whose width stands in the first two bits.
    #[inline]
    pub(super) fn three(&mut self) -> [u32; 3] {
        let first = u32::from(self.byte());
        match first >> 6 {
            0 => [extend(first >> 4, 2), extend(first >> 2, 2), extend(first, 2)],
            1 => {
                let second = u32::from(self.byte());
                [extend(first, 4), extend(second >> 4, 4), extend(second, 4)]
            }
            2 => [extend(first, 6), extend(self.byte().into(), 6), extend(self.byte().into(), 6)],
            _ => self.three_of_whole_bytes(first),
        }
    }

    /// The same with other widths.
    pub(super) fn three_variable(&mut self) -> [u32; 3] {
        let first = u32::from(self.byte());
        match first >> 6 {
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
        }
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

    /// Four fields of 0, 4, 8 or 16 bits without gaps between them, the highest first (data version 2).
    #[inline]
    pub(super) fn four(&mut self) -> [u32; 4] {
        let mut widths = self.byte();
        let mut values = [0; 4];
        if widths == 0 {
            return values;
        }
        let word = self.word();
        let mut read = 0;
        for value in &mut values {
            let bits = [0, 4, 8, 16][usize::from(widths & 3)];
            widths >>= 2;
            // The field in the highest bits, so that its sign goes with it; nothing of it if it has no bits.
            let field = ((word << read) as i64 >> 48) as i32 >> (16 - bits);
            *value = if bits == 0 { 0 } else { field as u32 };
            read += bits;
        }
        let bytes = (read as usize).div_ceil(8);
        self.past_end |= self.at + bytes > self.bytes.len();
        self.at = (self.at + bytes).min(self.bytes.len());
        values
    }

    /// Four fields of 0, 4, 8 or 16 bits (data version 1): those of 4 bits come in pairs, the lower half first.
    pub(super) fn four_version_1(&mut self) -> [u32; 4] {
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
        values
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
        assert_eq!(read(&[0b0001_1011]).three().map(|value| value as i32), [1, -2, -1]);
        assert_eq!(read(&[0x47, 0x8f]).three().map(|value| value as i32), [7, -8, -1]);
        assert_eq!(read(&[0x9f, 0x20, 0x3f]).three().map(|value| value as i32), [31, -32, -1]);
        assert_eq!(
            read(&[0b1110_0100, 0xff, 0x34, 0x12, 0xfe, 0xff, 0xff]).three().map(|value| value as i32),
            [-1, 0x1234, -2]
        );
        // 4 bits, 8 bits across two bytes, nothing, 16 bits across three bytes.
        assert_eq!(
            read(&[0b1100_1001, 0x7f, 0xe1, 0x23, 0x40]).four().map(|value| value as i32),
            [7, -2, 0, 0x1234]
        );
    }

    #[test]
    fn past_the_end_all_is_zero() {
        let mut reader = Reader::new(&[0x80]);
        assert_eq!(reader.unsigned(), 0);
        assert!(reader.past_end);
    }
}
