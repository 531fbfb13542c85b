//! Software in the loop on this processor: a simulator asks tick by tick over UDP, and the law
//! answers.
//!
//! Each datagram is a packet ([`proto::Sealer`] without a key, link 0) with [`proto::Readings`];
//! the answer is one with [`proto::Outcome`]. UDP may lose either: asking for a tick again gives
//! its answer again, and the law is ticked only once. No motor turns, no clock is read: the
//! simulator's time is all there is, so it runs as fast as both can.

use std::net::{SocketAddr, UdpSocket};

use control::Config;
use craft::Lockstep;
use proto::{MAX_PACKET_LEN, Message, Opener, Outcome, Role, Sealer};

use crate::error::{Error, Result, log, system};

/// The law, ready to answer.
#[derive(Debug)]
pub struct Server {
    socket: UdpSocket,
    law: Lockstep,
    sealer: Sealer,
    opener: Opener,
    /// The last answer.
    last: Option<Outcome>,
}

impl Server {
    /// Listens for a simulator on this machine (or on any, if `open`).
    ///
    /// # Errors
    /// A configuration that cannot be flown, or a port that cannot be opened.
    pub fn open(config: &Config, listen: SocketAddr, open: bool) -> Result<Self> {
        proto::admit(listen.ip(), None, open)?;
        let law = Lockstep::new(config).map_err(|error| Error::Other(error.to_string()))?;
        let socket = UdpSocket::bind(listen).map_err(system("listen for the simulator"))?;
        Ok(Self {
            socket,
            law,
            sealer: Sealer::open(Role::Craft, 0),
            opener: Opener::open(Role::Ground, 0),
            last: None,
        })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The system's error.
    pub fn address(&self) -> Result<SocketAddr> {
        self.socket.local_addr().map_err(system("look at the simulator's port"))
    }

    /// Answers until the socket fails.
    ///
    /// # Errors
    /// A socket that fails.
    pub fn serve(&mut self) -> Result<std::convert::Infallible> {
        let mut buffer = [0; MAX_PACKET_LEN + 1];
        loop {
            let (length, from) = match self.socket.recv_from(&mut buffer) {
                Ok(got) => got,
                // The simulator's port is closed (ICMP): it may come back.
                Err(error) if error.kind() == std::io::ErrorKind::ConnectionRefused => continue,
                Err(error) => return Err(system("listen to the simulator")(error)),
            };
            match self.opener.unseal(&buffer[..length]) {
                Ok((_, message)) => self.answer(&message, from)?,
                Err(refused) => log(&format!("from {from}: {refused}")),
            }
        }
    }

    fn answer(&mut self, message: &Message, to: SocketAddr) -> Result<()> {
        let Message::Readings(asked) = message else { return Ok(()) };
        let outcome = match self.last {
            Some(last) if last.output.tick == asked.tick => Some(last),
            _ => self.law.answer(message),
        };
        let Some(outcome) = outcome else { return Ok(()) };
        self.last = Some(outcome);
        let mut buffer = [0; MAX_PACKET_LEN];
        let sealed = self.sealer.seal(&Message::Outcome(outcome), &mut buffer);
        let (_, packet) = sealed.map_err(|refused| Error::Other(refused.to_string()))?;
        // An answer that does not go out is asked for again.
        let _ = self.socket.send_to(packet, to);
        Ok(())
    }
}
