//! The link to the ground: UDP datagrams that are packets of crate `proto`.
//!
//! The loop's thread sends and receives itself, without ever waiting and without a file. Every packet
//! that has come is looked at (length, CRC, header), which is cheap; of those that look right
//! [`BUDGET`] a tick are opened, from the pilot's queue and from everybody else's each ([`Sockets`]):
//! tags are what takes time. So a flood costs the pilot nothing, and the tick little.
//!
//! Telemetry goes to whoever sent the last pose, command or clock; answers and the identity to
//! whoever asked. So a second program may ask a craft who it is without taking the telemetry away
//! from its pilot. Both are sessions ([`proto::CraftEnd`]): nothing goes to an address that has not
//! answered a challenge, but a challenge as long as the question, and nothing to one that has fallen
//! silent.

use std::net::SocketAddr;

use craft::Craft;
use proto::{CraftEnd, Heard, MAX_PACKET_LEN, Message, Opened, Refused};

use crate::clock::monotonic_ms;
use crate::config;
use crate::error::Result;
use crate::sockets::{Queue, Sockets};

/// Packets opened of each queue in a tick: over ten times what a ground station sends.
pub const BUDGET: usize = 48;

/// Something that a human should read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Notice {
    /// A packet that was refused.
    Refused(SocketAddr, Refused),
    /// A peer on another machine, although there is no key.
    Stranger(SocketAddr),
}

/// The link's end on the craft.
#[derive(Debug)]
pub struct Link {
    sockets: Sockets,
    end: CraftEnd,
    settings: config::LinkSettings,
    /// The session of whoever gets telemetry.
    ground: Option<u64>,
    /// The session of whoever asked last.
    asker: Option<u64>,
    strangers: u32,
}

impl Link {
    /// Opens the link.
    ///
    /// # Errors
    /// A port that is taken, or a system without random bytes.
    pub fn open(settings: &config::LinkSettings) -> Result<Self> {
        let end = CraftEnd::new(settings.number, settings.key.clone(), proto_files::random()?);
        let (sockets, settings) = (Sockets::open(settings.listen)?, settings.clone());
        Ok(Self { sockets, end, settings, ground: None, asker: None, strangers: 0 })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.sockets.address()
    }

    /// Passes what has arrived on to the craft; `note` gets what was refused. Never waits, never
    /// allocates.
    pub fn receive(&mut self, craft: &mut Craft, mut note: impl FnMut(Notice)) {
        let now_ms = monotonic_ms();
        let Self { sockets, end, settings, ground, asker, strangers } = self;
        let mut budgets = [BUDGET; 2];
        sockets.receive(|packet, from, queue| {
            if proto::admit(from.ip(), settings.key.as_ref(), settings.open).is_err() {
                *strangers = strangers.saturating_add(1);
                return note(Notice::Stranger(from));
            }
            let [others, known] = &mut budgets;
            let budget = if queue == Queue::Known { known } else { others };
            match open(end, now_ms, packet, from, budget, sockets) {
                Ok(Some(opened)) => {
                    let Opened { session, is_first, ref message, .. } = opened;
                    let asks = !matches!(message, Message::Pose(_) | Message::Command(_) | Message::Timer(_));
                    if asks || is_first {
                        *asker = Some(session);
                    }
                    if !asks {
                        *ground = Some(session);
                    }
                    craft.receive(&opened);
                }
                Ok(None) => {}
                Err(refused) => note(Notice::Refused(from, refused)),
            }
        });
        end.forget_silent(now_ms);
        if let Some(pilot) = ground.and_then(|ground| end.peer(ground)).flatten() {
            sockets.prefer(pilot);
        }
    }

    /// Sends the craft's messages. Never waits, never allocates.
    pub fn send(&mut self, craft: &mut Craft) {
        let now_ms = monotonic_ms();
        let mut counts = craft::LinkStatus::from(self.end.statistics);
        counts.refused = counts.refused.saturating_add(self.strangers);
        let mut buffer = [0; MAX_PACKET_LEN];
        while let Some(message) = craft.next_message(&counts) {
            let to = match message {
                Message::Telemetry(_) => self.ground,
                _ => self.asker.or(self.ground),
            };
            let Some((session, peer)) = to.and_then(|to| Some((to, self.end.peer(to)??))) else { continue };
            if let Ok((_, packet)) = self.end.seal(now_ms, session, &message, &mut buffer) {
                self.sockets.send(packet, peer);
            }
        }
    }
}

/// What a packet says, if it may still be opened in this tick; hellos are answered.
fn open(
    end: &mut CraftEnd,
    now_ms: u32,
    packet: &[u8],
    from: SocketAddr,
    budget: &mut usize,
    sockets: &Sockets,
) -> std::result::Result<Option<Opened>, Refused> {
    let promising = end.glance(Some(from), packet)?;
    // What comes too often to be opened is not told either: the log has enough of it.
    let Some(left) = budget.checked_sub(1) else { return Ok(None) };
    *budget = left;
    let mut reply = [0; MAX_PACKET_LEN];
    match end.open(now_ms, promising, &mut reply)? {
        Heard::Message(opened) => Ok(Some(opened)),
        Heard::Hello(challenge) => {
            sockets.send(challenge, from);
            Ok(None)
        }
    }
}
