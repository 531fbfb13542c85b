//! How messages are serialised: ROS 1 packs them little endian; ROS 2 as CDR, aligned to the width of
//! each number.
//!
//! CDR: OMG DDS-XTypes 1.3, 7.4. Four bytes say which kind; alignment counts from behind them, to 8
//! bytes, in version 2 to 4.

use super::super::common::bytes::Cursor;

/// A message that is being read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Serialised<'a> {
    cursor: Cursor<'a>,
    big_endian: bool,
    /// Numbers stand at multiples of their width, at most this; 1 without alignment.
    most_alignment: usize,
}

macro_rules! number {
    ($name:ident, $type:ty) => {
        #[doc = concat!("A `", stringify!($type), "`.")]
        pub(super) fn $name(&mut self) -> Option<$type> {
            self.align(size_of::<$type>())?;
            let bytes = self.cursor.array()?;
            Some(if self.big_endian { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
        }
    };
}

impl<'a> Serialised<'a> {
    /// A message of ROS 1.
    pub(super) fn ros1(bytes: &'a [u8]) -> Self {
        Self { cursor: Cursor::new(bytes), big_endian: false, most_alignment: 1 }
    }

    /// A message of ROS 2; nothing if it is of a kind of CDR that ROS 2 does not write.
    pub(super) fn cdr(bytes: &'a [u8]) -> Option<Self> {
        let (head, body) = bytes.split_at_checked(4)?;
        let (big_endian, most_alignment) = match head[1] {
            0 => (true, 8),
            1 => (false, 8),
            6 => (true, 4),
            7 => (false, 4),
            _ => return None,
        };
        (head[0] == 0).then_some(Self { cursor: Cursor::new(body), big_endian, most_alignment })
    }

    /// Whether numbers are aligned as in CDR.
    pub(super) fn is_cdr(&self) -> bool {
        self.most_alignment > 1
    }

    fn align(&mut self, width: usize) -> Option<()> {
        let alignment = width.min(self.most_alignment);
        let over = self.cursor.position() % alignment;
        if over > 0 {
            self.cursor.take(alignment - over)?;
        }
        Some(())
    }

    /// Leaves out so many numbers.
    pub(super) fn skip(&mut self, width: usize, count: usize) -> Option<()> {
        if count > 0 {
            self.align(width)?;
            self.cursor.take(width.checked_mul(count)?)?;
        }
        Some(())
    }

    /// How many elements or bytes follow.
    pub(super) fn length(&mut self) -> Option<usize> {
        self.u32().map(|count| count as usize)
    }

    /// Leaves out a text.
    pub(super) fn skip_text(&mut self) -> Option<()> {
        let length = self.length()?;
        self.cursor.take(length).map(|_| ())
    }

    number!(i8, i8);
    number!(u8, u8);
    number!(i16, i16);
    number!(u16, u16);
    number!(i32, i32);
    number!(u32, u32);
    number!(i64, i64);
    number!(u64, u64);
    number!(f32, f32);
    number!(f64, f64);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_cdr_are_aligned() {
        // u8 1, 7 bytes to fill up, f64 1.0; then in version 2, which fills up 3.
        let mut bytes = vec![0, 1, 0, 0, 1, 9, 9, 9, 9, 9, 9, 9];
        bytes.extend(1.0_f64.to_le_bytes());
        let mut message = Serialised::cdr(&bytes).unwrap();
        assert_eq!((message.u8(), message.f64(), message.u8()), (Some(1), Some(1.0), None));
        let mut bytes = vec![0, 6, 0, 0, 1, 9, 9, 9];
        bytes.extend(1.0_f64.to_be_bytes());
        let mut message = Serialised::cdr(&bytes).unwrap();
        assert_eq!((message.u8(), message.f64()), (Some(1), Some(1.0)));
        let mut message = Serialised::ros1(&bytes[4..]);
        assert_eq!((message.u8(), message.skip(8, 2), message.skip(8, usize::MAX)), (Some(1), None, None));
        assert!(Serialised::cdr(&[0, 3, 0, 0]).is_none());
    }
}
