//! The link to the ground: UDP datagrams that are packets of crate `proto`.
//!
//! The loop's thread sends and receives itself, without ever waiting. Every packet that has come is
//! looked at (length, CRC, header), which is cheap; of those that look right [`BUDGET`] a tick are
//! opened, from the pilot's queue and from everybody else's each ([`Sockets`]): tags are what takes
//! time. So a flood costs the pilot nothing, and the tick little. Packet numbers that have to be on
//! the disk before they are used are stored by a thread of their own ([`Keeper`]); the loop asks
//! for them in time and checks whether they are stored.
//!
//! Telemetry goes to whoever sent the last pose, command or clock; answers and the identity to
//! whoever asked. So a second program may ask a craft who it is without taking the telemetry away
//! from its pilot. A genuine packet that comes again changes neither: whoever sends it need not have
//! the key.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

use craft::Craft;
use proto::{CounterStore, MAX_PACKET_LEN, Message, Opener, Refused, Role, Sealer};
use proto_files::CounterFile;

use crate::config;
use crate::error::{Result, log, system};
use crate::sockets::{Queue, Sockets};

/// Packets opened of each queue in a tick: over ten times what a ground station sends.
pub const BUDGET: usize = 48;

/// Between two looks of the keeper. A stretch of numbers lasts for seconds.
const LOOK_EVERY: Duration = Duration::from_millis(10);

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
    end: End,
}

/// What the link makes of packets.
#[derive(Debug)]
struct End {
    sealer: Sealer,
    opener: Opener,
    keeper: Option<Keeper>,
    settings: config::LinkSettings,
    /// Who gets telemetry.
    ground: Option<SocketAddr>,
    /// Who asked last.
    asker: Option<SocketAddr>,
    strangers: u32,
    /// Packets of others' queue and of the known peer's that may still be opened in this tick.
    budgets: [usize; 2],
}

impl Link {
    /// Opens the link.
    ///
    /// # Errors
    /// A port that is taken, or counters that cannot be read or stored.
    pub fn open(settings: &config::LinkSettings) -> Result<Self> {
        Ok(Self { sockets: Sockets::open(settings.listen)?, end: End::open(settings)? })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.sockets.address()
    }

    /// Passes what has arrived on to the craft; `note` gets what was refused. Never waits, never
    /// allocates.
    pub fn receive(&mut self, craft: &mut Craft, mut note: impl FnMut(Notice)) {
        let Self { sockets, end } = self;
        end.budgets = [BUDGET; 2];
        sockets.receive(|packet, from, queue| end.take(packet, from, queue, craft, &mut note));
        if let Some(ground) = end.ground {
            sockets.prefer(ground);
        }
        end.reserve();
    }

    /// Sends the craft's messages. Never waits, never allocates.
    pub fn send(&mut self, craft: &mut Craft) {
        let Self { sockets, end } = self;
        let counts = end.counts();
        let mut buffer = [0; MAX_PACKET_LEN];
        while let Some(message) = craft.next_message(&counts) {
            let to = match message {
                Message::Telemetry(_) => end.ground,
                _ => end.asker.or(end.ground),
            };
            let Some(to) = to else { continue };
            if let Ok((_, packet)) = end.sealer.seal(&message, &mut buffer) {
                sockets.send(packet, to);
            }
        }
        end.reserve();
    }
}

impl End {
    fn open(settings: &config::LinkSettings) -> Result<Self> {
        let number = settings.number;
        let (sealer, opener, keeper) = match (&settings.key, &settings.counters) {
            (Some(key), Some(folder)) => {
                let [mut sent, mut heard] = ["sent", "heard"].map(|name| CounterFile::new(folder.join(name)));
                let mut sealer = Sealer::authenticated(Role::Craft, number, key.clone(), sent.load()?);
                let opener = Opener::authenticated(Role::Ground, number, key.clone(), heard.load()?);
                // The first stretch before the loop begins; later ones beside it. What is heard
                // first is lost while the first stretch of heard numbers is stored.
                sealer.counter.keep(&mut sent)?;
                (sealer, opener, Some(Keeper::start([sent, heard])?))
            }
            _ => (Sealer::open(Role::Craft, number), Opener::open(Role::Ground, number), None),
        };
        let settings = settings.clone();
        let (ground, asker, strangers) = (None, None, 0);
        Ok(Self { sealer, opener, keeper, settings, ground, asker, strangers, budgets: [0; 2] })
    }

    fn take(
        &mut self,
        packet: &[u8],
        from: SocketAddr,
        queue: Queue,
        craft: &mut Craft,
        note: &mut impl FnMut(Notice),
    ) {
        let config::LinkSettings { key, open, .. } = &self.settings;
        if proto::admit(from.ip(), key.as_ref(), *open).is_err() {
            self.strangers = self.strangers.saturating_add(1);
            return note(Notice::Stranger(from));
        }
        if let Err(refused) = self.opener.glance(packet) {
            return note(Notice::Refused(from, refused));
        }
        let [others, known] = &mut self.budgets;
        let budget = if queue == Queue::Known { known } else { others };
        // What comes too often to be opened is not told either: the log has enough of it.
        let Some(left) = budget.checked_sub(1) else { return };
        *budget = left;
        match self.opener.unseal(packet) {
            Ok((number, message)) => {
                self.sealer.follow(&mut self.opener);
                match message {
                    Message::Pose(_) | Message::Command(_) | Message::Timer(_) => self.ground = Some(from),
                    _ => self.asker = Some(from),
                }
                craft.hear(number, &message);
            }
            // Genuine, but its number is still being stored.
            Err(Refused::NotReserved) => {}
            Err(refused) => {
                // Genuine, but behind: the ground is told where to go on. Whoever sent this may have
                // no key and be sending again what somebody else said: it is told only as long as
                // nobody else is known.
                if let Refused::Replayed { .. } = refused {
                    if self.ground.is_none() {
                        self.asker.get_or_insert(from);
                    }
                    craft.introduce();
                }
                note(Notice::Refused(from, refused));
            }
        }
    }

    fn counts(&self) -> craft::LinkStatus {
        let mut counts = craft::LinkStatus::from(&self.opener);
        counts.refused = counts.refused.saturating_add(self.strangers);
        counts
    }

    /// Asks for the next stretches of numbers, and takes those that are stored.
    fn reserve(&mut self) {
        let Some(keeper) = &self.keeper else { return };
        let [sent, heard] = &*keeper.stretches;
        sent.settle(self.sealer.counter.to_reserve(), |number| self.sealer.counter.reserved(number));
        heard.settle(self.opener.guard.to_reserve(), |number| self.opener.guard.reserved(number));
    }
}

/// Stores packet numbers beside the loop.
#[derive(Debug)]
pub struct Keeper {
    stretches: Arc<[Stretch; 2]>,
}

/// What should be stored, and what is.
#[derive(Debug, Default)]
struct Stretch {
    wanted: AtomicU64,
    stored: AtomicU64,
}

impl Stretch {
    fn settle(&self, wanted: Option<u64>, mut reserved: impl FnMut(u64)) {
        if let Some(number) = wanted {
            self.wanted.store(number, Ordering::Relaxed);
            reserved(self.stored.load(Ordering::Acquire));
        }
    }

    /// Stores what is wanted and not there yet.
    fn keep(&self, file: &mut CounterFile) -> std::result::Result<(), proto_files::FileError> {
        let wanted = self.wanted.load(Ordering::Relaxed);
        if wanted > self.stored.load(Ordering::Relaxed) {
            file.store(wanted)?;
            self.stored.store(wanted, Ordering::Release);
        }
        Ok(())
    }
}

impl Keeper {
    fn start(mut files: [CounterFile; 2]) -> Result<Self> {
        let stretches = Arc::new(<[Stretch; 2]>::default());
        let shared = Arc::clone(&stretches);
        let keep = move || loop {
            for (stretch, file) in shared.iter().zip(&mut files) {
                if let Err(error) = stretch.keep(file) {
                    log(&format!("{error}; when the packet numbers are used up the link falls silent"));
                    sleep(Duration::from_secs(1));
                }
            }
            sleep(LOOK_EVERY);
        };
        thread::Builder::new()
            .name("keeper".into())
            .spawn(keep)
            .map_err(system("start the thread of the counters"))?;
        Ok(Self { stretches })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loop asks, the keeper stores, and only then the loop may use the numbers.
    #[test]
    fn numbers_are_used_only_once_they_are_stored() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = CounterFile::new(folder.path().join("sent"));
        let stretch = Stretch::default();
        let settle = |wanted| {
            let mut reserved = None;
            stretch.settle(wanted, |number| reserved = Some(number));
            reserved
        };
        assert_eq!(settle(None), None, "nothing is asked for");
        assert_eq!(settle(Some(1024)), Some(0), "not stored yet");
        stretch.keep(&mut file).unwrap();
        assert_eq!(settle(Some(1024)), Some(1024));
        assert_eq!(file.load().unwrap(), 1024);
        let mut missing = CounterFile::new(folder.path().join("none/sent"));
        settle(Some(2048));
        assert!(stretch.keep(&mut missing).is_err());
        assert_eq!(settle(Some(2048)), Some(1024), "what cannot be stored is not used");
    }
}
