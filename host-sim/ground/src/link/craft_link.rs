//! The ground's end of the link: packets out and in, with key and who may be talked to. No sockets,
//! no clock, and no file once it is open.

use std::net::IpAddr;
use std::path::PathBuf;

use proto::{GroundEnd, MAX_PACKET_LEN, Message, NotAdmitted, Refused, Statistics};
use proto_files::{FileError, random, read_key};

/// Where a craft listens unless told otherwise: the port of `com`'s example configuration.
pub const PORT: u16 = 14650;

/// What the link needs to know.
#[derive(Debug, Clone, Default)]
pub struct LinkSettings {
    /// Tells crafts with one key apart.
    pub number: u16,
    /// The file of the key that the craft has too.
    pub key: Option<PathBuf>,
    /// Talk to a craft on another machine without a key.
    pub allow_open: bool,
}

/// Why there is no link.
#[derive(Debug, thiserror::Error)]
pub enum CraftLinkError {
    /// The key, or a system without random bytes.
    #[error(transparent)]
    File(#[from] FileError),
    /// A craft on another machine, and no key.
    #[error(transparent)]
    Peer(#[from] NotAdmitted),
}

/// The link to one craft.
#[derive(Debug)]
pub struct CraftLink {
    end: GroundEnd,
}

/// The ground's clock as packets carry it: ms modulo 2^32.
fn ms(now_us: u64) -> u32 {
    (now_us / 1000) as u32
}

impl CraftLink {
    /// The link to the craft at `peer`.
    ///
    /// # Errors
    /// A stranger without a key; a key file that cannot be used.
    pub fn open(settings: &LinkSettings, peer: IpAddr) -> Result<Self, CraftLinkError> {
        let key = settings.key.as_deref().map(read_key).transpose()?;
        proto::admit(peer, key.as_ref(), settings.allow_open)?;
        Ok(Self { end: GroundEnd::new(settings.number, key, random()?) })
    }

    /// A hello to be sent, if the craft is not heard and it is time.
    pub fn greet(&mut self, now_us: u64) -> Option<Vec<u8>> {
        self.end.greet(ms(now_us), &mut [0; MAX_PACKET_LEN]).map(<[u8]>::to_vec)
    }

    /// A message as a packet, and its number.
    ///
    /// # Errors
    /// [`Refused::NoSession`] before the craft has been heard.
    pub fn seal(&mut self, now_us: u64, message: &Message) -> Result<(u64, Vec<u8>), Refused> {
        let mut buffer = [0; MAX_PACKET_LEN];
        let (number, packet) = self.end.seal(ms(now_us), message, &mut buffer)?;
        Ok((number, packet.to_vec()))
    }

    /// The message in a packet; none if it opened a session.
    ///
    /// # Errors
    /// Why it was not taken; all of these are counted.
    pub fn unseal(&mut self, now_us: u64, packet: &[u8]) -> Result<Option<Message>, Refused> {
        Ok(self.end.hear(ms(now_us), packet)?.map(|(_, message)| message))
    }

    /// What has come from the craft so far.
    pub fn statistics(&self) -> Statistics {
        self.end.statistics
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn key_file(folder: &Path) -> PathBuf {
        use std::os::unix::fs::PermissionsExt;
        let path = folder.join("key");
        fs::write(&path, "07".repeat(32)).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        path
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
    fn each_start_has_chance_of_its_own() {
        let hellos: Vec<_> = (0..2)
            .map(|_| CraftLink::open(&LinkSettings::default(), HERE).unwrap().greet(0).unwrap())
            .collect();
        assert_ne!(hellos[0], hellos[1]);
    }

    #[test]
    fn junk_is_counted_and_harmless() {
        let mut link = CraftLink::open(&LinkSettings::default(), HERE).unwrap();
        for junk in [&[][..], &[2; 10], &[0xff; 400]] {
            assert!(link.unseal(0, junk).is_err());
        }
        assert_eq!(link.statistics().refused, 3);
        assert_eq!(link.seal(0, &Message::Who), Err(Refused::NoSession));
    }
}
