//! The ground's end of a link, and one that only listens.

use crate::age::Age;
use crate::frame::{VERSION, decode_body};
use crate::message::Message;
use crate::packet::{Key, NONCE_LEN, Refused, Role, Statistics};
use crate::session::{ASKS, Common, Parts, Session};

/// A ground station says hello again when it has not heard the craft for so long, ms.
pub const SILENT_MS: u32 = 500;

/// Between two hellos, ms.
const GREET_EVERY_MS: u32 = 20;

/// The ground's end of a link.
#[derive(Debug, Clone)]
pub struct GroundEnd {
    common: Common,
    /// The bit of session names that tells what kind they are.
    kind: u64,
    /// What the names of sessions are made from.
    secret: Key,
    /// Hellos of different sessions so far.
    greeted: u64,
    /// The session that a challenge is waited for, and when the last hello went out.
    greeting: Option<(u64, u32)>,
    session: Option<Session>,
    /// Numbers go on from session to session, so that an answer to one is never taken for another's.
    next: u64,
    /// Counts of what has come.
    pub statistics: Statistics,
}

impl GroundEnd {
    /// With or without a key; `random` has to be new at each start.
    pub fn new(link: u16, key: Option<Key>, random: [u8; 32]) -> Self {
        Self {
            common: Common::new(Role::Ground, link, key),
            kind: 0,
            secret: Key::new(random),
            greeted: 0,
            greeting: None,
            session: None,
            next: 0,
            statistics: Statistics::default(),
        }
    }

    /// The same for a program that only asks: it takes no session away from a ground station.
    pub fn asking(link: u16, key: Option<Key>, random: [u8; 32]) -> Self {
        Self { kind: ASKS, ..Self::new(link, key, random) }
    }

    /// A hello to be sent, if there is no session with a craft that is heard, and it is time.
    pub fn greet<'b>(&mut self, now_ms: u32, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        if self.session.as_ref().is_some_and(|session| session.silent_ms(now_ms) <= SILENT_MS) {
            return None;
        }
        let id = match self.greeting {
            Some((_, last_ms)) if now_ms.wrapping_sub(last_ms) < GREET_EVERY_MS => return None,
            Some((id, _)) => id,
            None => {
                self.greeted = self.greeted.wrapping_add(1);
                let nonce = self.secret.derive(b"hello", &[&self.greeted.to_le_bytes()]).nonce();
                let name = u64::from_le_bytes(nonce.first_chunk().copied().unwrap_or_default());
                name & !ASKS | self.kind
            }
        };
        self.greeting = Some((id, now_ms));
        self.common.handshake(id, [now_ms, 0], [0; NONCE_LEN], buffer).ok()
    }

    /// The number and message of a packet that is intact, genuine and new; none if it opened a
    /// session.
    ///
    /// # Errors
    /// Why the packet was refused; it is counted.
    pub fn hear(&mut self, now_ms: u32, packet: &[u8]) -> Result<Option<(u64, Message)>, Refused> {
        let heard = self.judge(now_ms, packet);
        if heard.is_err() {
            self.statistics.refuse();
        }
        heard
    }

    fn judge(&mut self, now_ms: u32, packet: &[u8]) -> Result<Option<(u64, Message)>, Refused> {
        let parts = self.common.read(packet)?;
        if parts.is_handshake() {
            return self.begin(now_ms, &parts).map(|()| None);
        }
        let session = self.session.as_mut().filter(|session| session.id == parts.session);
        let (message, lost) = session.ok_or(Refused::NoSession)?.open(&parts, now_ms)?;
        self.statistics.accept(lost);
        Ok(Some((parts.number, message)))
    }

    /// Takes the challenge that was asked for.
    fn begin(&mut self, now_ms: u32, parts: &Parts<'_>) -> Result<(), Refused> {
        let challenge = self.common.challenge(parts)?;
        // The answer to a hello that was repeated: it has done its work.
        if self.session.as_ref().is_some_and(|session| session.id == parts.session) {
            return Ok(());
        }
        let Some((id, _)) = self.greeting.filter(|(id, _)| *id == parts.session) else {
            return Err(Refused::Replayed);
        };
        let age = Age::first(now_ms, parts.time_ms, parts.echo_ms)?;
        let key = self.common.session_key(id, challenge);
        self.greeting = None;
        self.session = Some(Session { id, key, peer: None, next: 0, accepts_from: None, taken: 0, age });
        Ok(())
    }

    /// Is there a session?
    pub fn is_open(&self) -> bool {
        self.session.is_some()
    }

    /// Writes a message as a packet into `buffer`; gives its number and its bytes.
    ///
    /// # Errors
    /// [`Refused::NoSession`] before the craft has been heard.
    pub fn seal<'b>(
        &mut self,
        now_ms: u32,
        message: &Message,
        buffer: &'b mut [u8],
    ) -> Result<(u64, &'b [u8]), Refused> {
        let session = self.session.as_mut().ok_or(Refused::NoSession)?;
        session.next = self.next;
        let sealed = session.seal(&self.common, now_ms, message, buffer);
        self.next = session.next;
        sealed
    }
}

/// Reads what a craft says to somebody else, with the key: for tests and tools that stand between.
#[derive(Debug, Clone)]
pub struct Listener {
    common: Common,
    session: Option<(u64, Key)>,
}

impl Listener {
    /// For the craft with this key.
    pub fn new(link: u16, key: Option<Key>) -> Self {
        Self { common: Common::new(Role::Ground, link, key), session: None }
    }

    /// The message of a genuine packet of the craft, new or not, in the session that was opened last.
    pub fn hear(&mut self, packet: &[u8]) -> Option<Message> {
        let parts = self.common.read(packet).ok()?;
        if parts.is_handshake() {
            let challenge = self.common.challenge(&parts).ok()?;
            self.session = Some((parts.session, self.common.session_key(parts.session, challenge)));
            return None;
        }
        let (_, key) = self.session.as_ref().filter(|(id, _)| *id == parts.session)?;
        key.verifies(parts.signed, parts.tag).then(|| decode_body(VERSION, parts.body).ok())?
    }
}
