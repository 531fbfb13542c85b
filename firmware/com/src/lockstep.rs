//! Software in the loop on this processor: a simulator asks tick by tick over UDP, and the law
//! answers.
//!
//! Each datagram is a packet ([`proto::Sealer`], link 0) with [`proto::Readings`];
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
            sealer: Sealer::new(Role::Craft, 0),
            opener: Opener::new(Role::Ground, 0),
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    fn readings(tick: u32) -> Message {
        Message::Readings(proto::Readings {
            tick,
            time_us: tick * 10_000,
            pose: Some(proto::Pose {
                position_m: [0.0, 0.0, -1.0 - 0.01 * tick as f32],
                attitude_rad: [0.0; 3],
            }),
            gyro_rad_s: None,
            battery_v: 11.1,
            command: None,
            request: None,
            outputs_ready: true,
        })
    }

    /// A datagram that is lost is asked for again; a law that ticked twice for it would be ahead of
    /// the simulation.
    #[test]
    fn a_tick_that_is_asked_for_twice_is_ticked_once() {
        let here = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let mut server = Server::open(&Config::thesis(), here, false).unwrap();
        let simulator = UdpSocket::bind(here).unwrap();
        let (mut law, mut opener) = (Lockstep::new(&Config::thesis()).unwrap(), Opener::new(Role::Craft, 0));
        for (tick, fresh) in [(0, true), (1, true), (1, false), (2, true)] {
            server.answer(&readings(tick), simulator.local_addr().unwrap()).unwrap();
            let mut buffer = [0; MAX_PACKET_LEN];
            let (length, _) = simulator.recv_from(&mut buffer).unwrap();
            let (_, got) = opener.unseal(&buffer[..length]).unwrap();
            let want = if fresh { law.answer(&readings(tick)) } else { server.last };
            assert_eq!(got, Message::Outcome(want.unwrap()), "tick {tick}");
        }
    }

    #[test]
    fn a_stranger_is_let_in_on_request_only() {
        let anywhere = SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0));
        assert!(matches!(Server::open(&Config::thesis(), anywhere, false), Err(Error::NotAdmitted(_))));
        assert!(Server::open(&Config::thesis(), anywhere, true).is_ok());
    }
}
