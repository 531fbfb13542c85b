//! Packets: what goes over a network or a wire.
//!
//! ```text
//! version u8 | flags u8 | link u16 | number u64 | message (postcard) | tag, 16 bytes, with a key | CRC-32
//! ```
//!
//! All integers are little endian. Flags: bit 0 a tag is there, bit 1 the craft sent it; the others
//! are 0. `link` tells crafts with one key apart. The tag is HMAC-SHA-256 (RFC 2104) of everything
//! before it, cut to its first 16 bytes: RFC 2104 asks for half the hash at least, and guessing one
//! right takes 2^128 tries over the radio. The CRC (CRC-32/ISO-HDLC, of everything before it) tells
//! damage from forgery and finds every single and double bit error by itself, on links without a
//! key too.
//!
//! Direction, link and number are under the tag: a packet cannot be sent back, to another craft, or
//! again.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::counter::{ReplayGuard, SendCounter, Verdict};
use crate::frame::{Error, MAX_FRAME_LEN, VERSION, decode_body};
use crate::message::Message;

const HEADER_LEN: usize = 12;
const CRC_LEN: usize = 4;
/// Length of a tag in bytes.
pub const TAG_LEN: usize = 16;
/// No packet is longer, in bytes.
pub const MAX_PACKET_LEN: usize = HEADER_LEN + MAX_FRAME_LEN + TAG_LEN + CRC_LEN;

const TAGGED: u8 = 1;
const FROM_CRAFT: u8 = 2;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A secret of 32 bytes that ground and craft share. It is not shown by `Debug`.
#[derive(Clone)]
pub struct Key([u8; 32]);

impl Key {
    /// The key with these bytes.
    pub const fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    fn mac(&self, bytes: &[u8]) -> Option<Hmac<Sha256>> {
        // A key of any length is a key for HMAC; this never fails.
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.0).ok()?;
        mac.update(bytes);
        Some(mac)
    }

    /// Compares in constant time.
    fn verifies(&self, bytes: &[u8], tag: &[u8]) -> bool {
        tag.len() == TAG_LEN && self.mac(bytes).is_some_and(|mac| mac.verify_truncated_left(tag).is_ok())
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(..)")
    }
}

/// Who sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The ground station.
    Ground,
    /// The craft.
    Craft,
}

impl Role {
    fn flag(self) -> u8 {
        match self {
            Self::Ground => 0,
            Self::Craft => FROM_CRAFT,
        }
    }
}

/// Why a packet was refused, or not made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// Too short for a packet, or too long.
    Length(usize),
    /// The CRC does not fit: damaged on the way.
    Damaged,
    /// Another version.
    Version {
        /// The version found.
        found: u8,
    },
    /// Flags that have no meaning.
    Flags(u8),
    /// It comes from the wrong side: a packet of ours, sent back.
    Direction,
    /// It is for another craft.
    Link {
        /// The link found.
        found: u16,
        /// The link it should be.
        expected: u16,
    },
    /// A key is set and the packet has no tag.
    NoTag,
    /// The packet has a tag and no key is set.
    NoKey,
    /// The tag is wrong: another key, or forged.
    Forged,
    /// The number was received before, or could have been.
    Replayed {
        /// Least number that is accepted.
        accepts_from: u64,
    },
    /// Genuine, but its number is not reserved yet: store what the guard asks for.
    NotReserved,
    /// The message in it cannot be read.
    Message(Error),
    /// The sender has no numbers left: store what the counter asks for.
    OutOfNumbers,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Length(length) => write!(f, "{length} bytes are not a packet"),
            Self::Damaged => f.write_str("a packet was damaged on the way (CRC)"),
            Self::Version { found } => write!(
                f,
                "the other side speaks packet version {found}, this one speaks {VERSION}: build both from the same source"
            ),
            Self::Flags(flags) => write!(f, "unknown packet flags {flags:#04x}"),
            Self::Direction => f.write_str("one of our own packets came back"),
            Self::Link { found, expected } => {
                write!(f, "a packet for link {found}; this is link {expected}")
            }
            Self::NoTag => f.write_str(
                "a packet without a tag, and this side has a key: give the other side the same key file",
            ),
            Self::NoKey => f.write_str(
                "a packet with a tag, and this side has no key: give it the other side's key file",
            ),
            Self::Forged => f.write_str("a packet with a wrong tag: the keys differ, or it was forged"),
            Self::Replayed { accepts_from } => {
                write!(f, "a packet that was received before; numbers from {accepts_from} on are accepted")
            }
            Self::NotReserved => f.write_str("a packet number that is not reserved yet"),
            Self::Message(error) => write!(f, "in a packet: {error}"),
            Self::OutOfNumbers => f.write_str("no packet numbers are reserved: can the counter be stored?"),
        }
    }
}

impl core::error::Error for Refused {}

/// Makes packets.
#[derive(Debug, Clone)]
pub struct Sealer {
    role: Role,
    link: u16,
    key: Option<Key>,
    /// The numbers.
    pub counter: SendCounter,
}

impl Sealer {
    /// With a key: `stored` is what the counter's store holds.
    pub fn authenticated(role: Role, link: u16, key: Key, stored: u64) -> Self {
        Self { role, link, key: Some(key), counter: SendCounter::resume(stored) }
    }

    /// Without a key.
    pub fn open(role: Role, link: u16) -> Self {
        Self { role, link, key: None, counter: SendCounter::volatile() }
    }

    /// To be called when a packet has been opened: if the other side has started anew, goes on
    /// where it accepts.
    pub fn follow(&mut self, opener: &mut Opener) {
        if opener.guard.take_leap() {
            self.counter.follow();
        }
    }

    /// Writes a message as a packet into `buffer`; gives its number and its bytes.
    ///
    /// # Errors
    /// [`Refused::OutOfNumbers`], or a buffer shorter than [`MAX_PACKET_LEN`] that does not
    /// suffice.
    pub fn seal<'a>(&mut self, message: &Message, buffer: &'a mut [u8]) -> Result<(u64, &'a [u8]), Refused> {
        const SHORT: Refused = Refused::Message(Error::BufferTooShort);
        let (header, rest) = buffer.split_at_mut_checked(HEADER_LEN).ok_or(SHORT)?;
        let body = postcard::to_slice(message, rest).map_err(|_| SHORT)?.len();
        let number = self.counter.take().ok_or(Refused::OutOfNumbers)?;
        let flags = self.role.flag() | if self.key.is_some() { TAGGED } else { 0 };
        header.copy_from_slice(&header_bytes(flags, self.link, number));
        let mut length = HEADER_LEN + body;
        if let Some(mac) =
            self.key.as_ref().zip(buffer.get(..length)).and_then(|(key, signed)| key.mac(signed))
        {
            let tag = mac.finalize().into_bytes();
            put(&tag[..TAG_LEN], buffer, &mut length).ok_or(SHORT)?;
        }
        let crc = CRC.checksum(buffer.get(..length).ok_or(SHORT)?).to_le_bytes();
        put(&crc, buffer, &mut length).ok_or(SHORT)?;
        Ok((number, buffer.get(..length).ok_or(SHORT)?))
    }
}

/// Puts bytes behind the first `length` of the buffer, if there is room.
fn put(bytes: &[u8], buffer: &mut [u8], length: &mut usize) -> Option<()> {
    let place = buffer.get_mut(*length..)?.get_mut(..bytes.len())?;
    place.copy_from_slice(bytes);
    *length += bytes.len();
    Some(())
}

fn header_bytes(flags: u8, link: u16, number: u64) -> [u8; HEADER_LEN] {
    let ([l0, l1], [a, b, c, d, e, f, g, h]) = (link.to_le_bytes(), number.to_le_bytes());
    [VERSION, flags, l0, l1, a, b, c, d, e, f, g, h]
}

/// What has come over a link. Counts stay at the greatest number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Packets accepted.
    pub accepted: u32,
    /// Packets refused, for whatever reason but a number that is not reserved yet.
    pub refused: u32,
    /// Packets that never came, or came before their numbers were reserved: by the gaps in the
    /// numbers.
    pub lost: u32,
}

/// Opens packets.
#[derive(Debug, Clone)]
pub struct Opener {
    from: Role,
    link: u16,
    key: Option<Key>,
    /// The numbers.
    pub guard: ReplayGuard,
    /// Counts of what has come.
    pub statistics: Statistics,
}

impl Opener {
    /// With a key, for packets `from` that side: `stored` is what the guard's store holds.
    pub fn authenticated(from: Role, link: u16, key: Key, stored: u64) -> Self {
        let guard = ReplayGuard::resume(stored);
        Self { from, link, key: Some(key), guard, statistics: Statistics::default() }
    }

    /// Without a key.
    pub fn open(from: Role, link: u16) -> Self {
        let guard = ReplayGuard::volatile();
        Self { from, link, key: None, guard, statistics: Statistics::default() }
    }

    /// The number and message of a packet that is intact, genuine and new.
    ///
    /// # Errors
    /// Why the packet was refused.
    pub fn unseal(&mut self, packet: &[u8]) -> Result<(u64, Message), Refused> {
        let outcome = self.judge(packet);
        let statistics = &mut self.statistics;
        match outcome {
            Ok((lost, number, message)) => {
                statistics.accepted = statistics.accepted.saturating_add(1);
                let lost = u32::try_from(lost).unwrap_or(u32::MAX);
                statistics.lost = statistics.lost.saturating_add(lost);
                Ok((number, message))
            }
            Err(Refused::NotReserved) => Err(Refused::NotReserved),
            Err(refused) => {
                statistics.refused = statistics.refused.saturating_add(1);
                Err(refused)
            }
        }
    }

    /// What can be said of a packet without its tag and its message, which take time: length, CRC
    /// and header. Refused packets are counted.
    ///
    /// # Errors
    /// Why the packet would be refused.
    pub fn glance(&mut self, packet: &[u8]) -> Result<(), Refused> {
        let outcome = self.read(packet).map(|_| ());
        if outcome.is_err() {
            self.statistics.refused = self.statistics.refused.saturating_add(1);
        }
        outcome
    }

    /// The parts of a packet that is intact and meant for us.
    fn read<'a>(&self, packet: &'a [u8]) -> Result<Parts<'a>, Refused> {
        let length = Refused::Length(packet.len());
        if packet.len() > MAX_PACKET_LEN {
            return Err(length);
        }
        let (rest, crc) = packet.split_last_chunk::<CRC_LEN>().ok_or(length)?;
        let (header, _) = rest.split_first_chunk::<HEADER_LEN>().ok_or(length)?;
        if CRC.checksum(rest) != u32::from_le_bytes(*crc) {
            return Err(Refused::Damaged);
        }
        let [version, flags, l0, l1, n @ ..] = *header;
        let (link, number) = (u16::from_le_bytes([l0, l1]), u64::from_le_bytes(n));
        if version != VERSION {
            return Err(Refused::Version { found: version });
        }
        if flags & !(TAGGED | FROM_CRAFT) != 0 {
            return Err(Refused::Flags(flags));
        }
        if flags & FROM_CRAFT != self.from.flag() {
            return Err(Refused::Direction);
        }
        if link != self.link {
            return Err(Refused::Link { found: link, expected: self.link });
        }
        let (signed, tag) = match (&self.key, flags & TAGGED != 0) {
            (None, false) => (rest, None),
            (None, true) => return Err(Refused::NoKey),
            (Some(_), false) => return Err(Refused::NoTag),
            (Some(_), true) => {
                let (signed, tag) = rest.split_last_chunk::<TAG_LEN>().ok_or(length)?;
                (signed, Some(tag))
            }
        };
        let body = signed.get(HEADER_LEN..).ok_or(length)?;
        Ok(Parts { number, signed, tag, body })
    }

    fn judge(&mut self, packet: &[u8]) -> Result<(u64, u64, Message), Refused> {
        let Parts { number, signed, tag, body } = self.read(packet)?;
        if let (Some(key), Some(tag)) = (&self.key, tag)
            && !key.verifies(signed, tag)
        {
            return Err(Refused::Forged);
        }
        let message = decode_body(VERSION, body).map_err(Refused::Message)?;
        match self.guard.judge(number) {
            Verdict::Fresh { lost } => Ok((lost, number, message)),
            Verdict::Replayed { accepts_from } => Err(Refused::Replayed { accepts_from }),
            Verdict::NotYet => Err(Refused::NotReserved),
        }
    }
}

/// The parts of a packet.
struct Parts<'a> {
    number: u64,
    /// What the tag is of.
    signed: &'a [u8],
    tag: Option<&'a [u8; TAG_LEN]>,
    body: &'a [u8],
}
