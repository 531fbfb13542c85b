//! Packets: what goes over a network or a wire.
//!
//! ```text
//! plain       version u8 | flags u8 | link u16 | number u64 | message | CRC-32
//! session     version u8 | flags u8 | link u16 | number u64 | session u64 | time u32 | echo u32 | message | tag, 16 bytes | CRC-32
//! ```
//!
//! All integers are little endian. `link` tells crafts with one key apart. Plain packets join a
//! simulator and a law on one machine, and their numbers only tell order; between a craft and its
//! ground station there are sessions (see [`crate::CraftEnd`]). Flags: bit 0 the tag is made with a
//! secret key, bit 1 the craft sent it, bit 2 it makes a session, bit 3 it is of a session; the
//! others are 0.
//!
//! The tag is HMAC-SHA-256 (RFC 2104) of everything before it, cut to its first 16 bytes: RFC 2104
//! asks for half the hash at least, and guessing one right takes 2^128 tries over the radio. The CRC
//! (CRC-32/ISO-HDLC, of everything before it) tells damage from forgery and finds every single and
//! double bit error by itself, on plain packets too.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::frame::{Error, MAX_FRAME_LEN, VERSION, decode_body};
use crate::message::Message;

/// Length of a plain packet's header.
const PLAIN_LEN: usize = 12;
/// Length of the header in a session.
pub(crate) const HEADER_LEN: usize = PLAIN_LEN + 16;
const CRC_LEN: usize = 4;
/// Length of a tag in bytes.
pub const TAG_LEN: usize = 16;
/// Length of a challenge in bytes.
pub(crate) const NONCE_LEN: usize = 16;
/// No packet is longer, in bytes.
pub const MAX_PACKET_LEN: usize = HEADER_LEN + MAX_FRAME_LEN + TAG_LEN + CRC_LEN;

/// The last number there is: no number is above it, so what has it could come again and again.
pub(crate) const NEVER_SENT: u64 = u64::MAX;

/// Bits of the flags.
pub(crate) const KEYED: u8 = 1;
pub(crate) const FROM_CRAFT: u8 = 2;
pub(crate) const HANDSHAKE: u8 = 4;
pub(crate) const SESSION: u8 = 8;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A secret of 32 bytes that ground and craft share. It is not shown by `Debug`.
#[derive(Clone)]
pub struct Key([u8; 32]);

impl Key {
    /// The key with these bytes.
    pub const fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    fn mac(&self, parts: &[&[u8]]) -> Option<Hmac<Sha256>> {
        // A key of any length is a key for HMAC; this never fails.
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.0).ok()?;
        parts.iter().for_each(|part| mac.update(part));
        Some(mac)
    }

    /// The tag of these bytes.
    pub(crate) fn tag(&self, bytes: &[u8]) -> Option<[u8; TAG_LEN]> {
        let hash: [u8; 32] = self.mac(&[bytes])?.finalize().into_bytes().into();
        hash.first_chunk().copied()
    }

    /// Compares in constant time.
    pub(crate) fn verifies(&self, bytes: &[u8], tag: &[u8; TAG_LEN]) -> bool {
        self.mac(&[bytes]).is_some_and(|mac| mac.verify_truncated_left(tag).is_ok())
    }

    /// A key made from this one and what it is for. No packet begins with a letter, so no tag is a
    /// key.
    pub(crate) fn derive(&self, purpose: &[u8], parts: &[&[u8]]) -> Self {
        let hash = self.mac(&[purpose]).map(|mut mac| {
            parts.iter().for_each(|part| mac.update(part));
            mac.finalize().into_bytes().into()
        });
        // There always is a hash; without one nothing would fit.
        Self(hash.unwrap_or([0xff; 32]))
    }

    /// Its first half, as bytes that nobody can guess.
    pub(crate) fn nonce(&self) -> [u8; NONCE_LEN] {
        self.0.first_chunk().copied().unwrap_or_default()
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
    pub(crate) fn flag(self) -> u8 {
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
    /// A key is set and the packet was made without one.
    NoTag,
    /// The packet was made with a key and none is set.
    NoKey,
    /// The tag is wrong: another key, or forged.
    Forged,
    /// The number was received before, or a later one was.
    Replayed,
    /// It is older than [`OLDEST_MS`](crate::OLDEST_MS), or may be.
    Old {
        /// How old it may be.
        age_ms: u32,
    },
    /// It belongs to no session that there is: an earlier one, or one of an earlier start.
    NoSession,
    /// It belongs to a session with somebody at another address.
    Elsewhere,
    /// The message in it cannot be read.
    Message(Error),
    /// The message does not fit into the buffer: [`MAX_PACKET_LEN`] suffices.
    BufferTooShort,
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
                "a packet made without a key, and this side has one: give the other side the same key file",
            ),
            Self::NoKey => f.write_str(
                "a packet made with a key, and this side has none: give it the other side's key file",
            ),
            Self::Forged => f.write_str("a packet with a wrong tag: the keys differ, or it was forged"),
            Self::Replayed => f.write_str("a packet that was received before, or came too late"),
            Self::Old { age_ms } => write!(f, "a packet that may be {age_ms} ms old"),
            Self::NoSession => {
                f.write_str("a packet of no session that there is: of an earlier start, or forged")
            }
            Self::Elsewhere => f.write_str("a packet of a session with another address"),
            Self::Message(error) => write!(f, "in a packet: {error}"),
            Self::BufferTooShort => {
                write!(f, "the buffer is too short for a packet; {MAX_PACKET_LEN} bytes are enough")
            }
        }
    }
}

impl core::error::Error for Refused {}

/// The bytes of a packet before its CRC, if they came undamaged and are of this version.
pub(crate) fn intact(packet: &[u8]) -> Result<&[u8], Refused> {
    let length = Refused::Length(packet.len());
    if packet.len() > MAX_PACKET_LEN {
        return Err(length);
    }
    let (rest, crc) = packet.split_last_chunk::<CRC_LEN>().ok_or(length)?;
    let [version, ..] = rest else { return Err(length) };
    if CRC.checksum(rest) != u32::from_le_bytes(*crc) {
        return Err(Refused::Damaged);
    }
    if *version != VERSION {
        return Err(Refused::Version { found: *version });
    }
    Ok(rest)
}

/// What every packet begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) flags: u8,
    pub(crate) link: u16,
    pub(crate) number: u64,
}

impl Header {
    /// The header, if it is from that side and for that link, and what comes behind it.
    pub(crate) fn read(bytes: &[u8], from: Role, link: u16) -> Result<(Self, &[u8]), Refused> {
        let length = Refused::Length(bytes.len());
        let ([_, flags, l0, l1, n @ ..], rest) = bytes.split_first_chunk::<PLAIN_LEN>().ok_or(length)?;
        let (flags, found, number) = (*flags, u16::from_le_bytes([*l0, *l1]), u64::from_le_bytes(*n));
        if flags & !(KEYED | FROM_CRAFT | HANDSHAKE | SESSION) != 0 {
            return Err(Refused::Flags(flags));
        }
        if flags & FROM_CRAFT != from.flag() {
            return Err(Refused::Direction);
        }
        if found != link {
            return Err(Refused::Link { found, expected: link });
        }
        Ok((Self { flags, link, number }, rest))
    }

    fn bytes(self) -> [u8; PLAIN_LEN] {
        let ([l0, l1], [a, b, c, d, e, f, g, h]) = (self.link.to_le_bytes(), self.number.to_le_bytes());
        [VERSION, self.flags, l0, l1, a, b, c, d, e, f, g, h]
    }
}

/// A packet that is being written.
pub(crate) struct Writing<'b> {
    buffer: &'b mut [u8],
    length: usize,
}

impl<'b> Writing<'b> {
    pub(crate) fn begin(header: Header, buffer: &'b mut [u8]) -> Result<Self, Refused> {
        let mut writing = Self { buffer, length: 0 };
        writing.put(&header.bytes())?;
        Ok(writing)
    }

    pub(crate) fn put(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        let free = self.buffer.get_mut(self.length..).unwrap_or_default();
        free.get_mut(..bytes.len()).ok_or(Refused::BufferTooShort)?.copy_from_slice(bytes);
        self.length += bytes.len();
        Ok(())
    }

    pub(crate) fn message(&mut self, message: &Message) -> Result<(), Refused> {
        let free = self.buffer.get_mut(self.length..).unwrap_or_default();
        self.length += postcard::to_slice(message, free).map_err(|_| Refused::BufferTooShort)?.len();
        Ok(())
    }

    pub(crate) fn tag(&mut self, key: &Key) -> Result<(), Refused> {
        let tag = key.tag(self.written()).ok_or(Refused::Forged)?;
        self.put(&tag)
    }

    fn written(&self) -> &[u8] {
        self.buffer.get(..self.length).unwrap_or_default()
    }

    pub(crate) fn end(mut self) -> Result<&'b [u8], Refused> {
        let crc = CRC.checksum(self.written()).to_le_bytes();
        self.put(&crc)?;
        let Self { buffer, length } = self;
        buffer.get(..length).ok_or(Refused::BufferTooShort)
    }
}

/// Makes plain packets.
#[derive(Debug, Clone)]
pub struct Sealer {
    role: Role,
    link: u16,
    next: u64,
}

impl Sealer {
    /// Numbers begin at 0.
    pub fn new(role: Role, link: u16) -> Self {
        Self { role, link, next: 0 }
    }

    /// Writes a message as a packet into `buffer`; gives its number and its bytes.
    ///
    /// # Errors
    /// A buffer that is too short; [`MAX_PACKET_LEN`] suffices.
    pub fn seal<'b>(&mut self, message: &Message, buffer: &'b mut [u8]) -> Result<(u64, &'b [u8]), Refused> {
        let header = Header { flags: self.role.flag(), link: self.link, number: self.next };
        let mut writing = Writing::begin(header, buffer)?;
        writing.message(message)?;
        let packet = writing.end()?;
        self.next = self.next.saturating_add(1);
        Ok((header.number, packet))
    }
}

/// What has come over a link. Counts stay at the greatest number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Packets accepted.
    pub accepted: u32,
    /// Packets refused, for whatever reason.
    pub refused: u32,
    /// Packets that never came, by the gaps in the numbers.
    pub lost: u32,
}

impl Statistics {
    pub(crate) fn refuse(&mut self) {
        self.refused = self.refused.saturating_add(1);
    }

    /// One that was counted as lost has come.
    pub(crate) fn accept_overtaken(&mut self) {
        self.accepted = self.accepted.saturating_add(1);
        self.lost = self.lost.saturating_sub(1);
    }

    pub(crate) fn accept(&mut self, lost: u64) {
        self.accepted = self.accepted.saturating_add(1);
        self.lost = self.lost.saturating_add(u32::try_from(lost).unwrap_or(u32::MAX));
    }
}

/// Opens plain packets, in the order of their numbers. Number 0 begins anew.
#[derive(Debug, Clone)]
pub struct Opener {
    from: Role,
    link: u16,
    accepts_from: u64,
    /// Counts of what has come.
    pub statistics: Statistics,
}

impl Opener {
    /// For packets `from` that side.
    pub fn new(from: Role, link: u16) -> Self {
        Self { from, link, accepts_from: 0, statistics: Statistics::default() }
    }

    /// The number and message of a packet that is intact and new.
    ///
    /// # Errors
    /// Why the packet was refused.
    pub fn unseal(&mut self, packet: &[u8]) -> Result<(u64, Message), Refused> {
        let opened = self.read(packet);
        match &opened {
            Ok((number, _)) => {
                let lost = number.checked_sub(self.accepts_from).filter(|_| self.accepts_from > 0);
                self.statistics.accept(lost.unwrap_or(0));
                self.accepts_from = number.saturating_add(1);
            }
            Err(_) => self.statistics.refuse(),
        }
        opened
    }

    fn read(&self, packet: &[u8]) -> Result<(u64, Message), Refused> {
        let (header, body) = Header::read(intact(packet)?, self.from, self.link)?;
        if header.flags & !FROM_CRAFT != 0 {
            return Err(Refused::Flags(header.flags));
        }
        let message = decode_body(VERSION, body).map_err(Refused::Message)?;
        let is_behind = header.number < self.accepts_from && (header.number > 0 || self.accepts_from == 1);
        if is_behind || header.number == NEVER_SENT {
            return Err(Refused::Replayed);
        }
        Ok((header.number, message))
    }
}

/// Every packet number with a boundary of 2^64 after every other one, and every count with one of 2^32:
/// against wide integers.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::residues::{residues, residues_u64};

    /// Of numbers that only grow, the last one of all is never taken; number 0 begins anew, but not at
    /// once again.
    #[test]
    fn plain_packets_are_taken_in_their_order() {
        let mut packets = Vec::new();
        for next in residues_u64() {
            let mut sealer = Sealer { role: Role::Craft, link: 7, next };
            let mut buffer = [0; MAX_PACKET_LEN];
            let (number, packet) = sealer.seal(&Message::Who, &mut buffer).unwrap();
            assert_eq!(number, next);
            assert_eq!(sealer.next, if next == u64::MAX { next } else { next + 1 });
            packets.push((number, packet.to_vec()));
        }
        for accepts_from in residues_u64() {
            for (number, packet) in &packets {
                let mut opener = Opener { accepts_from, ..Opener::new(Role::Craft, 7) };
                let (from, wide) = (i128::from(accepts_from), i128::from(*number));
                let begins = wide == 0 && from != 1;
                let want = (wide >= from || begins) && *number != u64::MAX;
                let taken = opener.unseal(packet).is_ok();
                assert_eq!(taken, want, "{number} after {accepts_from}");
                if taken {
                    let lost = if from == 0 || begins { 0 } else { wide - from };
                    assert_eq!(opener.statistics.lost, u32::try_from(lost).unwrap_or(u32::MAX));
                    assert_eq!(i128::from(opener.accepts_from), wide + 1);
                    assert!(begins && from == 0 || opener.unseal(packet).is_err(), "{number} twice");
                }
            }
        }
    }

    #[test]
    fn counts_stay_at_the_greatest_number() {
        for count in residues() {
            for lost in residues_u64() {
                let mut statistics = Statistics { accepted: count, refused: count, lost: count };
                statistics.refuse();
                statistics.accept(lost);
                let least = |wide: i128| i128::from(u32::MAX).min(wide);
                let Statistics { accepted, refused, lost: counted } = statistics;
                assert_eq!([accepted, refused].map(i128::from), [least(i128::from(count) + 1); 2]);
                assert_eq!(i128::from(counted), least(i128::from(count) + i128::from(lost)));
            }
        }
    }
}
