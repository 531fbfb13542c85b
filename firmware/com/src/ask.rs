//! The ground's side of one question: who is there, and what is it doing? For programs that install
//! others, and for people.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use proto::{GroundEnd, Identity, Key, MAX_PACKET_LEN, Message};

use crate::clock::monotonic_ms;
use crate::config;
use crate::error::{Error, Result, system};

/// Between two questions: UDP may lose one.
const AGAIN_AFTER: Duration = Duration::from_millis(200);

/// How to ask.
#[derive(Debug, Clone)]
pub struct Question {
    /// Where the craft listens.
    pub craft: SocketAddr,
    /// The craft's link number.
    pub number: u16,
    /// The key, if the craft has one.
    pub key: Option<Key>,
    /// How long to wait for an answer.
    pub patience: Duration,
}

impl Question {
    /// A question to the craft of this configuration, from its own machine.
    pub fn of(link: &config::LinkSettings, patience: Duration) -> Self {
        let mut craft = link.listen;
        if craft.ip().is_unspecified() {
            // What listens everywhere listens here.
            craft.set_ip(if craft.is_ipv4() {
                Ipv4Addr::LOCALHOST.into()
            } else {
                Ipv6Addr::LOCALHOST.into()
            });
        }
        Self { craft, number: link.number, key: link.key.clone(), patience }
    }
}

/// Asks until a craft answers or the time is up.
///
/// # Errors
/// No craft there, or one that takes other packets: what it looks like.
pub fn who(question: &Question) -> Result<Option<Identity>> {
    let any = if question.craft.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
    let socket = UdpSocket::bind(any).map_err(system("open a socket"))?;
    socket.connect(question.craft).map_err(system("reach the craft's address"))?;
    socket.set_read_timeout(Some(AGAIN_AFTER)).map_err(system("set up a socket"))?;
    let mut end = GroundEnd::asking(question.number, question.key.clone(), proto_files::random()?);
    let started = Instant::now();
    let mut refused = None;
    while started.elapsed() < question.patience {
        let mut buffer = [0; MAX_PACKET_LEN + 1];
        // A closed port on the same machine refuses; the craft may be about to start.
        if !ask(&socket, &mut end, &mut buffer) {
            std::thread::sleep(AGAIN_AFTER);
        }
        let asked = Instant::now();
        while asked.elapsed() < AGAIN_AFTER {
            let Ok(length) = socket.recv(&mut buffer) else { break };
            match end.hear(monotonic_ms(), &buffer[..length]) {
                Ok(Some((_, Message::Identity(identity)))) => return Ok(Some(identity)),
                Ok(Some(_)) => {}
                // There is a session now: the question can be asked.
                Ok(None) => drop(ask(&socket, &mut end, &mut buffer)),
                Err(why) => refused = Some(why),
            }
        }
    }
    match refused {
        Some(why) => Err(Error::Other(format!("{} answers, but {why}", question.craft))),
        None => Ok(None),
    }
}

/// Says hello, or asks where there is a session; could it be sent?
fn ask(socket: &UdpSocket, end: &mut GroundEnd, buffer: &mut [u8]) -> bool {
    let now_ms = monotonic_ms();
    let hello = end.greet(now_ms, buffer).is_none_or(|hello| socket.send(hello).is_ok());
    let who = end.seal(now_ms, &Message::Who, buffer);
    hello && who.map_or(true, |(_, packet)| socket.send(packet).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_craft_that_listens_everywhere_is_asked_here() {
        for (listen, craft) in [
            ("0.0.0.0:14650", "127.0.0.1:14650"),
            ("[::]:14650", "[::1]:14650"),
            ("192.168.1.2:1", "192.168.1.2:1"),
        ] {
            let link = config::LinkSettings {
                listen: listen.parse().unwrap(),
                number: 3,
                key: None,
                open: true,
                telemetry_every: 1,
            };
            let question = Question::of(&link, Duration::ZERO);
            assert_eq!((question.craft, question.number), (craft.parse().unwrap(), 3));
            assert!(question.key.is_none());
        }
    }
}
