//! The UDP object stream of Vicon Tracker, read and written.
//!
//! One datagram a frame, everything little endian:
//!
//! ```text
//! frame number u32 | items in this block u8 | items
//! item:   id u8 (0: object) | size u16 (72) | name, 24 bytes, zero-filled | x y z f64, mm | angles about x, y, z f64, rad
//! ```
//!
//! The angles are about x, the new y and the newest z (thesis (3.1)). Tracker sends blocks of 256,
//! 512 or 1024 bytes (3, 6 or 13 objects) and fills them up with zeros, so what follows the last
//! item means nothing. An object that the cameras do not see comes with all six numbers zero. Items
//! with another id are left out by their size.
//!
//! Deliberately absent: the DataStream SDK (markers, segments, quality, latency).

/// The port that Tracker sends to unless told otherwise.
pub const PORT: u16 = 51001;

const HEADER: usize = 5;
const ITEM_HEADER: usize = 3;
const NAME: usize = 24;
const OBJECT: usize = NAME + 6 * 8;
const OBJECT_ID: u8 = 0;

/// An object in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Its name in Tracker.
    pub name: String,
    /// Along the tracker's axes, mm.
    pub translation_mm: [f64; 3],
    /// About x, the new y and the newest z, rad.
    pub rotation_rad: [f64; 3],
}

impl Object {
    /// Did the cameras see it?
    pub fn is_seen(&self) -> bool {
        self.translation_mm.iter().chain(&self.rotation_rad).any(|v| *v != 0.0)
    }
}

/// A datagram.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Block {
    /// Number of the frame; a frame with many objects comes in several blocks.
    pub frame: u32,
    /// Its objects.
    pub objects: Vec<Object>,
}

/// Why a datagram is not a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ViconError {
    /// It ends in the middle.
    #[error(
        "a datagram of {length} bytes ends in the middle of item {item}: is it Vicon Tracker's UDP object stream?"
    )]
    CutShort {
        /// Length of the datagram.
        length: usize,
        /// The item, from 1; 0 is the header.
        item: u8,
    },
    /// An object of another size.
    #[error("an object of {size} bytes instead of {OBJECT}: a newer format than this program knows")]
    ObjectSize {
        /// The size found.
        size: u16,
    },
}

/// Cuts bytes off the front of a datagram.
struct Cursor<'a> {
    rest: &'a [u8],
    cut_short: ViconError,
}

impl<'a> Cursor<'a> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], ViconError> {
        let (head, rest) = self.rest.split_first_chunk::<N>().ok_or(self.cut_short)?;
        self.rest = rest;
        Ok(*head)
    }

    fn slice(&mut self, length: usize) -> Result<&'a [u8], ViconError> {
        let (head, rest) = self.rest.split_at_checked(length).ok_or(self.cut_short)?;
        self.rest = rest;
        Ok(head)
    }
}

impl Block {
    /// Reads a datagram.
    ///
    /// # Errors
    /// What is wrong with the bytes; nothing panics.
    pub fn parse(datagram: &[u8]) -> Result<Self, ViconError> {
        let length = datagram.len();
        let mut cursor = Cursor { rest: datagram, cut_short: ViconError::CutShort { length, item: 0 } };
        let frame = u32::from_le_bytes(cursor.take()?);
        let [items] = cursor.take()?;
        let mut objects = Vec::new();
        for item in 1..=items {
            cursor.cut_short = ViconError::CutShort { length, item };
            let [id] = cursor.take()?;
            let size = u16::from_le_bytes(cursor.take()?);
            let content = cursor.slice(usize::from(size))?;
            if id != OBJECT_ID {
                continue;
            }
            objects.push(object(content).ok_or(ViconError::ObjectSize { size })?);
        }
        Ok(Self { frame, objects })
    }

    /// The datagram; objects beyond the 255th and names beyond 24 bytes are cut off.
    pub fn to_bytes(&self) -> Vec<u8> {
        let objects = &self.objects[..self.objects.len().min(usize::from(u8::MAX))];
        let mut bytes = Vec::with_capacity(HEADER + objects.len() * (ITEM_HEADER + OBJECT));
        bytes.extend(self.frame.to_le_bytes());
        bytes.push(objects.len() as u8);
        for object in objects {
            bytes.push(OBJECT_ID);
            bytes.extend((OBJECT as u16).to_le_bytes());
            let mut name = [0; NAME];
            let end = object.name.floor_char_boundary(NAME);
            name[..end].copy_from_slice(&object.name.as_bytes()[..end]);
            bytes.extend(name);
            for value in object.translation_mm.iter().chain(&object.rotation_rad) {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes
    }
}

fn object(content: &[u8]) -> Option<Object> {
    let content: &[u8; OBJECT] = content.try_into().ok()?;
    let (name, numbers) = content.split_at(NAME);
    let end = name.iter().position(|b| *b == 0).unwrap_or(NAME);
    let mut values = [0.0; 6];
    for (value, bytes) in values.iter_mut().zip(numbers.as_chunks::<8>().0) {
        *value = f64::from_le_bytes(*bytes);
    }
    let [x, y, z, a, b, c] = values;
    Some(Object {
        name: String::from_utf8_lossy(&name[..end]).trim().to_owned(),
        translation_mm: [x, y, z],
        rotation_rad: [a, b, c],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A datagram spelt out, with the offsets that receivers in use read at: the name from 8, x y z
    /// from 32, 40, 48, angles from 56, 64, 72 (the public vicon_ros bridge does so), filled up to
    /// a block of 256 bytes.
    #[test]
    fn the_bytes_of_a_block() {
        let mut bytes = vec![0_u8; 256];
        bytes[..4].copy_from_slice(&[0x39, 0x30, 0, 0]);
        bytes[4] = 1;
        bytes[5] = 0;
        bytes[6..8].copy_from_slice(&[72, 0]);
        bytes[8..12].copy_from_slice(b"quad");
        for (at, value) in [(32, 1234.5), (40, -20.0), (48, 1000.0), (56, 0.1), (64, -0.2), (72, 3.0)] {
            bytes[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
        }
        let block = Block::parse(&bytes).unwrap();
        let quad = Object {
            name: "quad".into(),
            translation_mm: [1234.5, -20.0, 1000.0],
            rotation_rad: [0.1, -0.2, 3.0],
        };
        assert_eq!(block, Block { frame: 12345, objects: vec![quad] });
        assert_eq!(block.to_bytes(), bytes[..80]);
    }

    #[test]
    fn an_object_that_is_not_seen_is_all_zeros() {
        let hidden = Object { name: "a".into(), translation_mm: [0.0; 3], rotation_rad: [0.0; 3] };
        assert!(!hidden.is_seen());
        assert!(Object { rotation_rad: [0.0, 0.0, 1e-9], ..hidden }.is_seen());
    }

    #[test]
    fn items_of_another_kind_are_left_out() {
        let one = Object { name: "a".into(), translation_mm: [1.0; 3], rotation_rad: [2.0; 3] };
        let mut bytes = vec![7, 0, 0, 0, 2, 9, 3, 0, 1, 2, 3];
        bytes.extend(&Block { frame: 0, objects: vec![one.clone()] }.to_bytes()[HEADER..]);
        assert_eq!(Block::parse(&bytes).unwrap(), Block { frame: 7, objects: vec![one] });
    }

    #[test]
    fn what_is_cut_short_is_refused_at_each_byte() {
        let object =
            |name: &str| Object { name: name.into(), translation_mm: [1.0; 3], rotation_rad: [2.0; 3] };
        let bytes = Block { frame: 1, objects: vec![object("a"), object("b")] }.to_bytes();
        for length in 0..bytes.len() {
            assert!(matches!(Block::parse(&bytes[..length]), Err(ViconError::CutShort { .. })), "{length}");
        }
        let mut longer = bytes.clone();
        longer[6] = 80;
        longer.extend([0; 16]);
        assert_eq!(Block::parse(&longer), Err(ViconError::ObjectSize { size: 80 }));
    }

    fn objects() -> impl Strategy<Value = Vec<Object>> {
        let numbers = prop::array::uniform3(any::<f64>().prop_filter("equal to itself", |v| !v.is_nan()));
        let object = ("[a-zA-Z0-9_]{0,24}", numbers.clone(), numbers).prop_map(|(name, t, r)| Object {
            name,
            translation_mm: t,
            rotation_rad: r,
        });
        prop::collection::vec(object, 0..14)
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(frame: u32, objects in objects(), fill in 0usize..300) {
            let block = Block { frame, objects };
            let mut bytes = block.to_bytes();
            bytes.extend(vec![0; fill]);
            prop_assert_eq!(Block::parse(&bytes).unwrap(), block);
        }

        /// Any bytes, and a good block with some bytes changed: no panic, and what is read can be
        /// written and read again.
        #[test]
        fn no_bytes_panic(noise in prop::collection::vec(any::<u8>(), 0..600)) {
            if let Ok(block) = Block::parse(&noise) {
                prop_assert_eq!(Block::parse(&block.to_bytes()).unwrap().objects.len(), block.objects.len());
            }
        }

        #[test]
        fn no_damage_panics(objects in objects(), edits in prop::collection::vec((any::<usize>(), any::<u8>()), 1..8), cut: usize) {
            let mut bytes = Block { frame: 3, objects }.to_bytes();
            let length = bytes.len();
            for (at, value) in edits {
                bytes[at % length] = value;
            }
            let _ = Block::parse(&bytes);
            let _ = Block::parse(&bytes[..cut % length]);
        }
    }
}
