//! The link to the ground: UDP datagrams that are packets of crate `proto`.
//!
//! The loop's thread sends and receives itself, without ever waiting; in a flood it opens
//! [`BUDGET`] packets a tick and the kernel drops the rest. Packet numbers that have to be on the
//! disk before they are used are stored by a thread of their own ([`Keeper`]); the loop asks for
//! them in time and checks whether they are stored.
//!
//! Telemetry goes to whoever sent the last pose, command or clock; answers and the identity to
//! whoever asked. So a second program may ask a craft who it is without taking the telemetry away
//! from its pilot.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

use craft::Craft;
use proto::{CounterStore, MAX_PACKET_LEN, Message, Opener, Refused, Role, Sealer};
use proto_files::CounterFile;

use crate::config;
use crate::error::{Result, log, system};

/// Packets opened in a tick: over ten times what a ground station sends.
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
    socket: UdpSocket,
    sealer: Sealer,
    opener: Opener,
    keeper: Option<Keeper>,
    settings: config::LinkSettings,
    /// Who gets telemetry.
    ground: Option<SocketAddr>,
    /// Who asked last.
    asker: Option<SocketAddr>,
    strangers: u32,
}

impl Link {
    /// Opens the link.
    ///
    /// # Errors
    /// A port that is taken, or counters that cannot be read or stored.
    pub fn open(settings: &config::LinkSettings) -> Result<Self> {
        let socket = UdpSocket::bind(settings.listen)
            .map_err(system("listen on the link's port; is another program using it?"))?;
        socket.set_nonblocking(true).map_err(system("set up the link's socket"))?;
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
        Ok(Self { socket, sealer, opener, keeper, settings, ground: None, asker: None, strangers: 0 })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The system's error.
    pub fn address(&self) -> Result<SocketAddr> {
        self.socket.local_addr().map_err(system("read the address of the link's port"))
    }

    /// Passes what has arrived on to the craft; `note` gets what was refused. Never waits, never
    /// allocates.
    pub fn receive(&mut self, craft: &mut Craft, mut note: impl FnMut(Notice)) {
        let mut buffer = [0; MAX_PACKET_LEN + 1];
        for _ in 0..BUDGET {
            match self.socket.recv_from(&mut buffer) {
                Ok((length, from)) => {
                    self.take(buffer.get(..length).unwrap_or_default(), from, craft, &mut note)
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                // The other side's port is closed (ICMP); the next packet may be another's.
                Err(_) => {}
            }
        }
        self.reserve();
    }

    fn take(&mut self, packet: &[u8], from: SocketAddr, craft: &mut Craft, note: &mut impl FnMut(Notice)) {
        let config::LinkSettings { key, open, .. } = &self.settings;
        if proto::admit(from.ip(), key.as_ref(), *open).is_err() {
            self.strangers = self.strangers.saturating_add(1);
            return note(Notice::Stranger(from));
        }
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
                // Genuine, but behind: its sender is told where to go on.
                if let Refused::Replayed { .. } = refused {
                    self.asker = Some(from);
                    craft.introduce();
                }
                note(Notice::Refused(from, refused));
            }
        }
    }

    /// Sends the craft's messages. Never waits, never allocates; what cannot be sent is lost, as on
    /// the air.
    pub fn send(&mut self, craft: &mut Craft) {
        let counts = self.counts();
        let mut buffer = [0; MAX_PACKET_LEN];
        while let Some(message) = craft.next_message(&counts) {
            let to = match message {
                Message::Telemetry(_) => self.ground,
                _ => self.asker.or(self.ground),
            };
            let Some(to) = to else { continue };
            if let Ok((_, packet)) = self.sealer.seal(&message, &mut buffer) {
                let _ = self.socket.send_to(packet, to);
            }
        }
        self.reserve();
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
