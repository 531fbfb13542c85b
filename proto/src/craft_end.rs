//! The craft's end of a link: sessions with whoever has answered a challenge.

use core::net::{IpAddr, SocketAddr};

use crate::age::Age;
use crate::message::Message;
use crate::packet::{Key, NONCE_LEN, Refused, Role, Statistics};
use crate::session::{ASKS, Common, Parts, Session};

/// A session ends when the ground has been silent for so long, ms; nothing is sent to it any more.
pub const LISTENING_MS: u32 = 3000;

/// A message of a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opened {
    /// The session, for [`CraftEnd::seal`].
    pub session: u64,
    /// This is its first packet.
    pub is_first: bool,
    /// Later ones were taken before it: a pose, which may be older than another.
    pub is_overtaken: bool,
    /// The packet's number.
    pub number: u64,
    /// The message.
    pub message: Message,
}

impl Opened {
    /// Is it a ground station's, not that of a program that only asks?
    pub fn is_of_station(&self) -> bool {
        self.session & ASKS == 0
    }
}

/// What a craft makes of a packet.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "it is used up at once, and a craft has no heap")]
pub enum Heard<'b> {
    /// Somebody wants to talk: this is to be sent to where it came from.
    Hello(&'b [u8]),
    /// A message.
    Message(Opened),
}

/// A packet that looks right: whether it is genuine, its tag says.
pub struct Promising<'a> {
    parts: Parts<'a>,
    from: Option<SocketAddr>,
}

/// The craft's end of a link.
#[derive(Debug, Clone)]
pub struct CraftEnd {
    common: Common,
    /// What challenges are made from.
    secret: Key,
    /// Sessions so far: each has used up a challenge.
    opened: u64,
    /// With a ground station, and with a program that asks.
    sessions: [Option<Session>; 2],
    /// Counts of what has come.
    pub statistics: Statistics,
}

impl CraftEnd {
    /// With or without a key; `random` has to be new at each start.
    pub fn new(link: u16, key: Option<Key>, random: [u8; 32]) -> Self {
        let common = Common::new(Role::Craft, link, key);
        let (secret, statistics) = (Key::new(random), Statistics::default());
        Self { common, secret, opened: 0, sessions: [const { None }; 2], statistics }
    }

    /// What can be said of a packet without a tag, which takes time: length, CRC, header, and of
    /// sessions that there are address and number. Refused packets are counted.
    ///
    /// # Errors
    /// Why the packet is refused.
    pub fn glance<'a>(
        &mut self,
        from: Option<SocketAddr>,
        packet: &'a [u8],
    ) -> Result<Promising<'a>, Refused> {
        let looked = self.common.read(packet).and_then(|parts| {
            let session = self.sessions.iter().flatten().find(|session| session.id == parts.session);
            match session.filter(|_| !parts.is_handshake()) {
                Some(session) if session.peer != from && !self.common.is_keyed() => Err(Refused::Elsewhere),
                Some(session) => session.may_take(parts.number).map(|()| parts),
                None => Ok(parts),
            }
        });
        self.counted(looked).map(|parts| Promising { parts, from })
    }

    /// What a packet says that looks right, if it is genuine and new; an answer that is due at once is
    /// written into `reply`.
    ///
    /// # Errors
    /// Why the packet was refused; it is counted.
    pub fn open<'b>(
        &mut self,
        now_ms: u32,
        Promising { parts, from }: Promising<'_>,
        reply: &'b mut [u8],
    ) -> Result<Heard<'b>, Refused> {
        let heard = match parts.is_handshake() {
            true => self.answer(now_ms, from, &parts, reply).map(Heard::Hello),
            false => self.message(now_ms, from, &parts).map(Heard::Message),
        };
        self.counted(heard)
    }

    /// The same of a packet as it came.
    ///
    /// # Errors
    /// Why the packet was refused; it is counted.
    pub fn hear<'b>(
        &mut self,
        now_ms: u32,
        from: Option<SocketAddr>,
        packet: &[u8],
        reply: &'b mut [u8],
    ) -> Result<Heard<'b>, Refused> {
        let promising = self.glance(from, packet)?;
        self.open(now_ms, promising, reply)
    }

    fn counted<T>(&mut self, outcome: Result<T, Refused>) -> Result<T, Refused> {
        if outcome.is_err() {
            self.statistics.refuse();
        }
        outcome
    }

    fn answer<'b>(
        &self,
        now_ms: u32,
        from: Option<SocketAddr>,
        parts: &Parts<'_>,
        reply: &'b mut [u8],
    ) -> Result<&'b [u8], Refused> {
        self.common.challenge(parts)?;
        self.common.handshake(parts.session, [now_ms, parts.time_ms], self.challenge_for(from), reply)
    }

    /// The challenge that opens the next session, for this address.
    fn challenge_for(&self, peer: Option<SocketAddr>) -> [u8; NONCE_LEN] {
        let (address, port) = match peer.map(|peer| (peer.ip(), peer.port())) {
            None => ([0; 16], 0),
            Some((IpAddr::V4(ip), port)) => (ip.to_ipv6_mapped().octets(), port),
            Some((IpAddr::V6(ip), port)) => (ip.octets(), port),
        };
        let parts: [&[u8]; 3] = [&self.opened.to_le_bytes(), &address, &port.to_le_bytes()];
        self.secret.derive(b"challenge", &parts).nonce()
    }

    fn message(
        &mut self,
        now_ms: u32,
        from: Option<SocketAddr>,
        parts: &Parts<'_>,
    ) -> Result<Opened, Refused> {
        let Parts { session: id, number, .. } = *parts;
        if let Some(session) = self.sessions.iter_mut().flatten().find(|session| session.id == id) {
            let opened = |is_overtaken, message| {
                Ok(Opened { session: id, is_first: false, is_overtaken, number, message })
            };
            if let Some(message) = session.open_overtaken(parts, now_ms)? {
                self.statistics.accept_overtaken();
                return opened(true, message);
            }
            let (message, lost) = session.open(parts, now_ms)?;
            session.peer = from;
            self.statistics.accept(lost);
            return opened(false, message);
        }
        let key = self.common.session_key(id, self.challenge_for(from));
        let age = Age::first(now_ms, parts.time_ms, parts.echo_ms)?;
        let mut session = Session { id, key, peer: from, next: 0, accepts_from: None, taken: 0, age };
        // A wrong tag says no more than that this session is none.
        let (message, _) = session.open(parts, now_ms).map_err(|refused| match refused {
            Refused::Forged => Refused::NoSession,
            other => other,
        })?;
        self.statistics.accept(0);
        self.opened = self.opened.wrapping_add(1);
        let [station, asker] = &mut self.sessions;
        let opened = Opened { session: id, is_first: true, is_overtaken: false, number, message };
        *(if opened.is_of_station() { station } else { asker }) = Some(session);
        Ok(opened)
    }

    /// Ends the sessions of those who have fallen silent. To be called with each tick.
    pub fn forget_silent(&mut self, now_ms: u32) {
        for place in &mut self.sessions {
            if place.as_ref().is_some_and(|session| session.silent_ms(now_ms) > LISTENING_MS) {
                *place = None;
            }
        }
    }

    /// Who a session is with; none where there is no such session.
    pub fn peer(&self, session: u64) -> Option<Option<SocketAddr>> {
        self.sessions.iter().flatten().find(|known| known.id == session).map(|known| known.peer)
    }

    /// Writes a message as a packet into `buffer`; gives its number and its bytes.
    ///
    /// # Errors
    /// [`Refused::NoSession`] if that has ended.
    pub fn seal<'b>(
        &mut self,
        now_ms: u32,
        session: u64,
        message: &Message,
        buffer: &'b mut [u8],
    ) -> Result<(u64, &'b [u8]), Refused> {
        let found = self.sessions.iter_mut().flatten().find(|known| known.id == session);
        found.ok_or(Refused::NoSession)?.seal(&self.common, now_ms, message, buffer)
    }
}
