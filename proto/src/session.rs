//! Sessions between a ground station and a craft: what no recording, however it is played, fits.
//!
//! ```text
//! ground -> craft   hello       session N, tag with K                   N: random, new for each try
//! craft -> ground   challenge   session N, C, tag with K                C: random, used once
//! both ways         messages    session N, number, time, echo, tag with HMAC(K, link, N, C)
//! ```
//!
//! Each side brings chance of its own into the key of every tag. What was recorded in an earlier
//! session, before a restart of either side or with another craft, has another key and fits no
//! more, whatever became of any file: **nothing is stored.** (Until version 2 packet numbers had to
//! outlive a restart on a disk. A lost or restored file let recordings in, a full one silenced a
//! flying craft.) Within a session a number is taken once, and a packet that was withheld is refused by
//! its age ([`crate::OLDEST_MS`]).
//!
//! **Order:** numbers only grow, so that commands and answers count in the order in which they were sent. A pose says itself when it was
//! taken: the craft takes one that fewer than 32 packets have overtaken, if its echo says that it is not old. (On a link that delays each
//! packet by another part of a millisecond, half of all poses are overtaken by the commands that are sent right behind them.)
//!
//! - **A challenge admits one session.** The craft draws the next as soon as one is used; else an
//!   earlier session could be played again from its first packet on, once the craft has forgotten
//!   it. So the craft needs no memory of sessions that have ended.
//! - **Hellos cost the craft nothing.** A challenge is made from the craft's secret, a count and the
//!   sender's address, so whoever sends hellos, or repeats recorded ones, fills no table and
//!   disturbs no session; the answer is as long as the question, and there is nothing else for
//!   somebody who has not answered a challenge: not at a forged address either, where it does not
//!   arrive. This holds without a key too: then K is public, and says nothing about who it is.
//! - **Two sessions at most:** one with a ground station, and one with a program that only asks ([`GroundEnd::asking`](crate::GroundEnd::asking));
//!   the first bit of N tells them apart. A new one ends the one of its kind before, wherever that is, so nothing of an earlier start is
//!   taken once the later one has been heard. Asking takes no session away from a pilot.
//! - **Addresses:** with a key, a session is wherever its newest packet came from. Somebody who passes on what he has overheard from an
//!   address of his own can have the session there until the ground's next packet, and no longer. Without a key it stays with the
//!   address that answered the challenge, since everybody can make a newer packet.
//! - **Loss:** a hello is repeated until its challenge comes. A challenge
//!   that was overtaken by another's session opens none; the ground hears nothing, and begins anew.
//! - **Restarts:** a ground station that starts anew has a session after one way and back. One whose
//!   craft has fallen silent for [`crate::SILENT_MS`] says hello again, beside what it goes on saying in the
//!   old session: a craft that was only out of reach still takes that.
//!
//! What is left to chance: N has 64 bits, C and the tag have 128. Ten thousand starts of a ground
//! station share an N with probability 3e-12, and it takes a C that is the same as well for a
//! recording to fit. A source of chance that gives the same bytes at each start (QEMU's board has
//! none) lets recordings of an earlier start in, no older than [`crate::OLDEST_MS`] by the craft's clock.
//!
//! Deliberately absent: secrecy, and a new key for each session by Diffie and Hellman: whoever gets K
//! can fly the craft anyway.

use core::net::SocketAddr;

use crate::age::Age;
use crate::frame::{VERSION, decode_body};
use crate::message::Message;
use crate::packet::{
    HANDSHAKE, HEADER_LEN, Header, KEYED, Key, NEVER_SENT, NONCE_LEN, Refused, Role, SESSION, TAG_LEN,
    Writing, intact,
};

/// Bit of a session's name: whoever made it only asks.
pub(crate) const ASKS: u64 = 1 << 63;

/// What both sides use where there is no key: it hides nothing.
const PUBLIC: Key = Key::new([0; 32]);

/// The parts of a packet.
pub(crate) struct Parts<'a> {
    flags: u8,
    pub(crate) number: u64,
    pub(crate) session: u64,
    pub(crate) time_ms: u32,
    pub(crate) echo_ms: u32,
    /// What the tag is of.
    pub(crate) signed: &'a [u8],
    pub(crate) tag: &'a [u8; TAG_LEN],
    pub(crate) body: &'a [u8],
}

impl Parts<'_> {
    pub(crate) fn is_handshake(&self) -> bool {
        self.flags & HANDSHAKE != 0
    }
}

/// What an end of a link knows from the start.
#[derive(Debug, Clone)]
pub(crate) struct Common {
    role: Role,
    link: u16,
    pub(crate) key: Key,
    keyed: u8,
}

impl Common {
    pub(crate) fn new(role: Role, link: u16, key: Option<Key>) -> Self {
        let keyed = if key.is_some() { KEYED } else { 0 };
        Self { role, link, key: key.unwrap_or(PUBLIC), keyed }
    }

    /// Whether tags say who has made a packet.
    pub(crate) fn is_keyed(&self) -> bool {
        self.keyed == KEYED
    }

    /// The parts of a packet that is intact and meant for us.
    pub(crate) fn read<'a>(&self, packet: &'a [u8]) -> Result<Parts<'a>, Refused> {
        let from = if self.role == Role::Craft { Role::Ground } else { Role::Craft };
        let rest = intact(packet)?;
        let (header, _) = Header::read(rest, from, self.link)?;
        let Header { flags, number, .. } = header;
        if flags & SESSION == 0 {
            return Err(Refused::NoSession);
        }
        match (flags & KEYED, self.keyed) {
            (0, KEYED) => return Err(Refused::NoTag),
            (KEYED, 0) => return Err(Refused::NoKey),
            _ => {}
        }
        let length = Refused::Length(packet.len());
        let (signed, tag) = rest.split_last_chunk::<TAG_LEN>().ok_or(length)?;
        let (head, body) = signed.split_first_chunk::<HEADER_LEN>().ok_or(length)?;
        let [.., n0, n1, n2, n3, n4, n5, n6, n7, t0, t1, t2, t3, e0, e1, e2, e3] = *head;
        Ok(Parts {
            flags,
            number,
            session: u64::from_le_bytes([n0, n1, n2, n3, n4, n5, n6, n7]),
            time_ms: u32::from_le_bytes([t0, t1, t2, t3]),
            echo_ms: u32::from_le_bytes([e0, e1, e2, e3]),
            signed,
            tag,
            body,
        })
    }

    fn begin<'b>(
        &self,
        (flags, number): (u8, u64),
        session: u64,
        [time_ms, echo_ms]: [u32; 2],
        buffer: &'b mut [u8],
    ) -> Result<Writing<'b>, Refused> {
        let flags = flags | SESSION | self.keyed | self.role.flag();
        let mut writing = Writing::begin(Header { flags, link: self.link, number }, buffer)?;
        writing.put(&session.to_le_bytes())?;
        writing.put(&time_ms.to_le_bytes())?;
        writing.put(&echo_ms.to_le_bytes())?;
        Ok(writing)
    }

    /// A hello, or the challenge that answers one: they are of one length.
    pub(crate) fn handshake<'b>(
        &self,
        session: u64,
        times_ms: [u32; 2],
        challenge: [u8; NONCE_LEN],
        buffer: &'b mut [u8],
    ) -> Result<&'b [u8], Refused> {
        let mut writing = self.begin((HANDSHAKE, 0), session, times_ms, buffer)?;
        writing.put(&challenge)?;
        writing.tag(&self.key)?;
        writing.end()
    }

    /// What a genuine hello or challenge holds.
    pub(crate) fn challenge(&self, parts: &Parts<'_>) -> Result<[u8; NONCE_LEN], Refused> {
        let body = parts.body.try_into().map_err(|_| Refused::Length(parts.body.len()))?;
        if self.key.verifies(parts.signed, parts.tag) { Ok(body) } else { Err(Refused::Forged) }
    }

    /// The key of a session.
    pub(crate) fn session_key(&self, session: u64, challenge: [u8; NONCE_LEN]) -> Key {
        self.key.derive(b"session", &[&self.link.to_le_bytes(), &session.to_le_bytes(), &challenge])
    }
}

/// A session, from one side.
#[derive(Debug, Clone)]
pub(crate) struct Session {
    pub(crate) id: u64,
    pub(crate) key: Key,
    pub(crate) peer: Option<SocketAddr>,
    /// Number of the next packet.
    pub(crate) next: u64,
    /// Least number that is accepted in its order; none before the first.
    pub(crate) accepts_from: Option<u64>,
    /// Which of the 32 numbers below that were taken, a bit each; the lowest is that of the greatest.
    pub(crate) taken: u32,
    pub(crate) age: Age,
}

impl Session {
    /// For how long nothing of the other side has been accepted, ms.
    pub(crate) fn silent_ms(&self, now_ms: u32) -> u32 {
        now_ms.wrapping_sub(self.age.heard_ms)
    }

    /// Is the number new? This needs no tag.
    pub(crate) fn check_number(&self, number: u64) -> Result<(), Refused> {
        let is_behind = self.accepts_from.is_some_and(|from| number < from);
        if is_behind || number == NEVER_SENT { Err(Refused::Replayed) } else { Ok(()) }
    }

    /// The bit of a packet that was overtaken and is not taken yet.
    fn overtaken(&self, number: u64) -> Option<u32> {
        let behind = self.accepts_from?.checked_sub(number)?.checked_sub(1)?;
        let bit = 1_u32.checked_shl(u32::try_from(behind).ok()?)?;
        (self.taken & bit == 0).then_some(bit)
    }

    /// Can it be taken, in its order or overtaken? This needs no tag.
    pub(crate) fn may_take(&self, number: u64) -> Result<(), Refused> {
        if self.overtaken(number).is_some() { Ok(()) } else { self.check_number(number) }
    }

    /// A packet that was overtaken: its message, if that is one which says itself when it was; nothing of a packet that comes in its
    /// order. Nothing has changed where it is refused.
    pub(crate) fn open_overtaken(
        &mut self,
        parts: &Parts<'_>,
        now_ms: u32,
    ) -> Result<Option<Message>, Refused> {
        let Some(bit) = self.overtaken(parts.number) else { return Ok(None) };
        if !self.key.verifies(parts.signed, parts.tag) {
            return Err(Refused::Forged);
        }
        // Its sender's clock is behind that of the newest packet: of the two bounds of its age the echo's holds.
        Age::first(now_ms, parts.time_ms, parts.echo_ms)?;
        match decode_body(VERSION, parts.body).map_err(Refused::Message)? {
            message @ Message::Pose(_) => {
                self.taken |= bit;
                Ok(Some(message))
            }
            _ => Err(Refused::Replayed),
        }
    }

    /// The next packet: its message, and how many before it never came. Nothing has changed where it
    /// is refused.
    pub(crate) fn open(&mut self, parts: &Parts<'_>, now_ms: u32) -> Result<(Message, u64), Refused> {
        self.check_number(parts.number)?;
        if !self.key.verifies(parts.signed, parts.tag) {
            return Err(Refused::Forged);
        }
        let age = match self.accepts_from {
            None => Age::first(now_ms, parts.time_ms, parts.echo_ms)?,
            Some(_) => self.age.next(now_ms, parts.time_ms, parts.echo_ms)?,
        };
        let message = decode_body(VERSION, parts.body).map_err(Refused::Message)?;
        let lost = self.accepts_from.map_or(0, |from| parts.number - from);
        self.age = age;
        self.note(parts.number, lost);
        Ok((message, lost))
    }

    /// The newest number that was taken, so many after the one before it.
    fn note(&mut self, number: u64, lost: u64) {
        let passed = u32::try_from(lost).ok().and_then(|lost| self.taken.checked_shl(lost.saturating_add(1)));
        self.taken = passed.unwrap_or(0) | 1;
        self.accepts_from = Some(number.saturating_add(1));
    }

    pub(crate) fn seal<'b>(
        &mut self,
        common: &Common,
        now_ms: u32,
        message: &Message,
        buffer: &'b mut [u8],
    ) -> Result<(u64, &'b [u8]), Refused> {
        let number = self.next;
        let mut writing = common.begin((0, number), self.id, [now_ms, self.age.their_ms], buffer)?;
        writing.message(message)?;
        writing.tag(&self.key)?;
        let packet = writing.end()?;
        self.next = self.next.saturating_add(1);
        Ok((number, packet))
    }
}

/// Every number of a packet with a boundary of 2^64 after every other one, and silences between all times
/// with one of 2^32: against wide integers.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::packet::MAX_PACKET_LEN;
    use crate::residues::{residues, residues_u64};

    const KEY: Key = Key::new([4; 32]);

    fn session(next: u64, accepts_from: Option<u64>, heard_ms: u32) -> Session {
        let age = Age::first(heard_ms, 0, heard_ms).unwrap();
        Session { id: 5, key: KEY, peer: None, next, accepts_from, taken: u32::MAX, age }
    }

    /// A number is taken once, and only by growing; the last one of all never is, and the sender that
    /// has come to it says it again rather than begin anew.
    #[test]
    fn numbers_only_grow() {
        let [ground, craft] = [Role::Ground, Role::Craft].map(|role| Common::new(role, 7, Some(KEY)));
        for next in residues_u64() {
            let (mut from, mut buffer) = (session(next, None, 0), [0; MAX_PACKET_LEN]);
            let (number, packet) = from.seal(&ground, 0, &Message::Who, &mut buffer).unwrap();
            assert_eq!(number, next);
            assert_eq!(i128::from(from.next), (i128::from(next) + 1).min(u64::MAX.into()));
            let parts = craft.read(packet).unwrap();
            for accepts_from in residues_u64().into_iter().map(Some).chain([None]) {
                let mut to = session(0, accepts_from, 0);
                let least = accepts_from.map_or(0, i128::from);
                let want = i128::from(next) >= least && next != u64::MAX;
                assert_eq!(to.check_number(next).is_ok(), want, "{next} after {accepts_from:?}");
                // The tag is the greater part of the time.
                if want && (next.is_power_of_two() || i128::from(next) - least < 3) {
                    let (_, lost) = to.open(&parts, 0).unwrap();
                    assert_eq!(
                        i128::from(lost),
                        accepts_from.map_or(0, |from| i128::from(next) - i128::from(from))
                    );
                    assert_eq!(to.accepts_from, Some(next + 1));
                    assert_eq!(to.open(&parts, 0), Err(Refused::Replayed));
                }
            }
        }
    }

    /// Which were taken: by a list of all numbers, whatever is lost and overtaken about every boundary.
    #[test]
    fn what_was_overtaken_is_taken_once_and_not_for_long() {
        for first in residues_u64().into_iter().filter(|first| (40..u64::MAX - 200).contains(first)) {
            let mut to = Session { taken: 0, ..session(0, None, 0) };
            let mut taken: Vec<u64> = Vec::new();
            for step in [1, 1, 2, 1, 5, 1, 31, 1, 32, 1, 33, 3, 1] {
                let newest = taken.iter().max().map_or(first, |newest| newest + step);
                let lost = to.accepts_from.map_or(0, |from| newest - from);
                to.note(newest, lost);
                taken.push(newest);
                for number in newest - 40..newest {
                    let can = newest - number < 32 && !taken.contains(&number);
                    assert_eq!(to.overtaken(number).is_some(), can, "{number} after {newest} of {taken:?}");
                    if can && number % 3 == 0 {
                        to.taken |= to.overtaken(number).unwrap();
                        taken.push(number);
                    }
                }
            }
        }
    }

    #[test]
    fn a_silence_lasts_as_long_as_it_lasts() {
        for heard_ms in residues() {
            for silent_ms in residues() {
                let now = i128::from(heard_ms) + i128::from(silent_ms);
                assert_eq!(session(0, None, heard_ms).silent_ms(now as u32), silent_ms);
            }
        }
    }
}
