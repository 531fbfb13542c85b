//! Who may talk to a craft at all.

use core::fmt;
use core::net::IpAddr;

use crate::packet::Key;

/// A peer that is not on this machine, and no key to know it by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotAdmitted {
    /// Where it is.
    pub peer: IpAddr,
}

impl fmt::Display for NotAdmitted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} is not on this machine and there is no key: whoever can reach the port could fly the craft; give a key file, or allow open links explicitly",
            self.peer
        )
    }
}

impl core::error::Error for NotAdmitted {}

/// May `peer` be talked to? With a key, anybody (the packets show who they are); without one, this
/// machine only, unless `allow_open`.
///
/// # Errors
/// [`NotAdmitted`].
pub fn admit(peer: IpAddr, key: Option<&Key>, allow_open: bool) -> Result<(), NotAdmitted> {
    if key.is_some() || allow_open || peer.to_canonical().is_loopback() {
        return Ok(());
    }
    Err(NotAdmitted { peer })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strangers_need_a_key() {
        let key = Key::new([7; 32]);
        for (peer, here) in [
            ("127.0.0.1", true),
            ("127.8.9.10", true),
            ("::1", true),
            ("::ffff:127.0.0.1", true),
            ("192.168.1.2", false),
            ("0.0.0.0", false),
            ("::", false),
            ("::ffff:10.0.0.1", false),
        ] {
            let address: IpAddr = peer.parse().unwrap();
            assert_eq!(admit(address, None, false).is_ok(), here, "{peer}");
            assert!(
                admit(address, Some(&key), false).is_ok() && admit(address, None, true).is_ok(),
                "{peer}"
            );
        }
    }
}
