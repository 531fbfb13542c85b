//! The ground's end of the link: packets out and in, with key, counters and who may be talked to.
//! No sockets.

use std::net::IpAddr;
use std::path::{Path, PathBuf};

use proto::{
    CounterStore, Key, MAX_PACKET_LEN, Message, NotAdmitted, Opener, Refused, Role, Sealer, Statistics,
};
use proto_files::{CounterFile, FileError, read_key};

/// Where a craft listens unless told otherwise: the port of `com`'s example configuration.
pub const PORT: u16 = 14650;

/// What the link needs to know.
#[derive(Debug, Clone, Default)]
pub struct LinkSettings {
    /// Tells crafts with one key apart.
    pub number: u16,
    /// The file of the key that the craft has too.
    pub key: Option<PathBuf>,
    /// Folder of the packet counters; the key's folder if it is not given.
    pub counters: Option<PathBuf>,
    /// Talk to a craft on another machine without a key.
    pub allow_open: bool,
}

/// Why there is no link, or why a packet was refused or could not be made.
#[derive(Debug, thiserror::Error)]
pub enum CraftLinkError {
    /// The key or a counter.
    #[error(transparent)]
    File(#[from] FileError),
    /// A craft on another machine, and no key.
    #[error(transparent)]
    Peer(#[from] NotAdmitted),
    /// A packet.
    #[error("{0}")]
    Packet(#[from] Refused),
}

/// The link to one craft.
#[derive(Debug)]
pub struct CraftLink {
    sealer: Sealer,
    opener: Opener,
    /// Counter files of the packets sent and received; none without a key.
    stores: Option<[CounterFile; 2]>,
}

impl CraftLink {
    /// The link to the craft at `peer`.
    ///
    /// # Errors
    /// A stranger without a key; a key or counter file that cannot be used.
    pub fn open(settings: &LinkSettings, peer: IpAddr) -> Result<Self, CraftLinkError> {
        let key = settings.key.as_deref().map(read_key).transpose()?;
        proto::admit(peer, key.as_ref(), settings.allow_open)?;
        match (key, &settings.key) {
            (Some(key), Some(path)) => Self::with_key(settings, key, path),
            _ => Ok(Self {
                sealer: Sealer::open(Role::Ground, settings.number),
                opener: Opener::open(Role::Craft, settings.number),
                stores: None,
            }),
        }
    }

    fn with_key(settings: &LinkSettings, key: Key, path: &Path) -> Result<Self, CraftLinkError> {
        let folder = match (&settings.counters, path.parent()) {
            (Some(folder), _) => folder.clone(),
            (None, Some(folder)) => folder.to_owned(),
            (None, None) => PathBuf::new(),
        };
        let counter =
            |what: &str| CounterFile::new(folder.join(format!("ground-{}-{what}", settings.number)));
        let [mut sent, mut heard] = ["sent", "heard"].map(counter);
        let mut link = Self {
            sealer: Sealer::authenticated(Role::Ground, settings.number, key.clone(), sent.load()?),
            opener: Opener::authenticated(Role::Craft, settings.number, key, heard.load()?),
            stores: Some([sent, heard]),
        };
        link.keep()?;
        Ok(link)
    }

    /// Stores what has to be stored before more numbers are used.
    fn keep(&mut self) -> Result<(), CraftLinkError> {
        if let Some([sent, heard]) = &mut self.stores {
            self.sealer.counter.keep(sent)?;
            self.opener.guard.keep(heard)?;
        }
        Ok(())
    }

    /// A message as a packet, and its number.
    ///
    /// # Errors
    /// Numbers that cannot be stored.
    pub fn seal(&mut self, message: &Message) -> Result<(u64, Vec<u8>), CraftLinkError> {
        self.keep()?;
        let mut buffer = [0; MAX_PACKET_LEN];
        let (number, packet) = self.sealer.seal(message, &mut buffer)?;
        Ok((number, packet.to_vec()))
    }

    /// The message in a packet. An identity makes this side skip to the numbers that the craft
    /// accepts.
    ///
    /// # Errors
    /// Why it was not taken; all of these are counted.
    pub fn unseal(&mut self, packet: &[u8]) -> Result<Message, CraftLinkError> {
        let (_, message) = match self.opener.unseal(packet) {
            Err(Refused::NotReserved) => {
                self.keep()?;
                self.opener.unseal(packet)?
            }
            other => other?,
        };
        self.sealer.follow(&mut self.opener);
        if let Message::Identity(identity) = &message {
            self.sealer.counter.skip_to(identity.accepts_from);
        }
        self.keep()?;
        Ok(message)
    }

    /// What has come from the craft so far.
    pub fn statistics(&self) -> Statistics {
        self.opener.statistics
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::{Identity, State};
    use std::fs;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn key_file(folder: &Path) -> PathBuf {
        use std::os::unix::fs::PermissionsExt;
        let path = folder.join("key");
        fs::write(&path, "07".repeat(32)).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        path
    }

    fn craft(accepts_from: u64) -> (Sealer, Opener) {
        let key = Key::new([7; 32]);
        let mut sealer = Sealer::authenticated(Role::Craft, 3, key.clone(), 0);
        let mut opener = Opener::authenticated(Role::Ground, 3, key, accepts_from);
        sealer.counter.reserved(u64::MAX);
        opener.guard.reserved(u64::MAX);
        (sealer, opener)
    }

    #[test]
    fn strangers_need_a_key() {
        let far: IpAddr = "10.1.2.3".parse().unwrap();
        let settings = LinkSettings::default();
        assert!(CraftLink::open(&settings, HERE).is_ok());
        let message = CraftLink::open(&settings, far).unwrap_err().to_string();
        assert!(message.contains("10.1.2.3") && message.contains("key"), "{message}");
        assert!(CraftLink::open(&LinkSettings { allow_open: true, ..settings }, far).is_ok());
        let folder = tempfile::tempdir().unwrap();
        let key = Some(key_file(folder.path()));
        assert!(CraftLink::open(&LinkSettings { key, ..LinkSettings::default() }, far).is_ok());
    }

    #[test]
    fn after_a_restart_numbers_go_on_and_a_craft_that_is_ahead_is_caught_up_with() {
        let folder = tempfile::tempdir().unwrap();
        let settings =
            LinkSettings { number: 3, key: Some(key_file(folder.path())), ..LinkSettings::default() };
        let (mut sealer, mut opener) = craft(0);
        let mut last = None;
        for _ in 0..3 {
            let mut link = CraftLink::open(&settings, HERE).unwrap();
            for _ in 0..600 {
                let (number, packet) = link.seal(&Message::Who).unwrap();
                assert!(last.is_none_or(|last| number > last));
                last = Some(number);
                opener.unseal(&packet).unwrap();
            }
        }
        // A craft whose store is far ahead refuses, and says from where on it accepts.
        let mut link = CraftLink::open(&settings, HERE).unwrap();
        let (mut ahead_sealer, mut ahead) = craft(1_000_000);
        ahead_sealer.counter.skip_to(10_000);
        let (_, packet) = link.seal(&Message::Who).unwrap();
        assert!(matches!(ahead.unseal(&packet), Err(Refused::Replayed { accepts_from: 1_000_000 })));
        let identity = Message::Identity(Identity {
            versions: [1, 2],
            program: [0, 1, 0],
            vehicle_sha256: [0; 32],
            accepts_from: 1_000_000,
            state: State::Disarmed,
        });
        let mut buffer = [0; MAX_PACKET_LEN];
        let (_, packet) = ahead_sealer.seal(&identity, &mut buffer).unwrap();
        assert_eq!(link.unseal(packet).unwrap(), identity);
        let (number, packet) = link.seal(&Message::Who).unwrap();
        assert_eq!(number, 1_000_000);
        assert!(ahead.unseal(&packet).is_ok());
        // What was heard once is not heard again, by a restarted ground station neither.
        let (_, packet) = sealer.seal(&identity, &mut buffer).unwrap();
        assert!(CraftLink::open(&settings, HERE).unwrap().unseal(packet).is_err());
    }

    #[test]
    fn junk_is_counted_and_harmless() {
        let mut link = CraftLink::open(&LinkSettings::default(), HERE).unwrap();
        for junk in [&[][..], &[2; 10], &[0xff; 400]] {
            assert!(link.unseal(junk).is_err());
        }
        assert_eq!(link.statistics().refused, 3);
    }
}
