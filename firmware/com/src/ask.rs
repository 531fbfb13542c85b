//! The ground's side of one question: who is there, and what is it doing? For programs that install
//! others, and for people.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use proto::{CounterStore, Identity, Key, MAX_PACKET_LEN, Message, Opener, Role, Sealer};
use proto_files::CounterFile;

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
    /// The key, and the folder in which the ground keeps its packet numbers.
    pub key: Option<(Key, PathBuf)>,
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
        Self { craft, number: link.number, key: link.key.clone().zip(link.counters.clone()), patience }
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
    let (mut sealer, mut opener, counters) = ends(question)?;
    let started = Instant::now();
    let mut refused = None;
    while started.elapsed() < question.patience {
        let mut buffer = [0; MAX_PACKET_LEN + 1];
        let sealed = sealer.seal(&Message::Who, &mut buffer);
        let (number, packet) = sealed.map_err(|refused| Error::Other(refused.to_string()))?;
        // A closed port on the same machine refuses; the craft may be about to start.
        let sent = socket.send(packet);
        let asked = Instant::now();
        while asked.elapsed() < AGAIN_AFTER {
            let Ok(length) = socket.recv(&mut buffer) else { break };
            match opener.unseal(&buffer[..length]) {
                // The answer to an earlier question; its age is unknown.
                Ok((_, Message::Identity(identity))) if identity.accepts_from <= number => {}
                // It answers the question, or only saw that its number is behind; either way it
                // says who it is.
                Ok((_, Message::Identity(identity))) => {
                    if let Some([_, mut heard]) = counters {
                        heard.store(opener.guard.accepts_from())?;
                    }
                    return Ok(Some(identity));
                }
                Ok(_) => {}
                Err(why) => refused = Some(why),
            }
        }
        if sent.is_err() {
            std::thread::sleep(AGAIN_AFTER);
        }
    }
    match refused {
        Some(why) => Err(Error::Other(format!("{} answers, but {why}", question.craft))),
        None => Ok(None),
    }
}

type Ends = (Sealer, Opener, Option<[CounterFile; 2]>);

/// The numbers that this side has used and heard are kept in files of their own: asking is not
/// flying. What was heard is kept exactly and not by stretches, or a second question within seconds
/// would take the craft's answer for an echo.
fn ends(question: &Question) -> Result<Ends> {
    let number = question.number;
    let Some((key, folder)) = &question.key else {
        return Ok((Sealer::open(Role::Ground, number), Opener::open(Role::Craft, number), None));
    };
    let mut counters = ["ask-sent", "ask-heard"].map(|name| CounterFile::new(folder.join(name)));
    let [sent, heard] = &mut counters;
    let mut sealer = Sealer::authenticated(Role::Ground, number, key.clone(), sent.load()?);
    sealer.counter.keep(sent)?;
    let mut opener = Opener::authenticated(Role::Craft, number, key.clone(), heard.load()?);
    opener.guard.reserved(u64::MAX);
    Ok((sealer, opener, Some(counters)))
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
                counters: None,
                open: true,
                telemetry_every: 1,
            };
            let question = Question::of(&link, Duration::ZERO);
            assert_eq!((question.craft, question.number), (craft.parse().unwrap(), 3));
            assert!(question.key.is_none());
        }
    }
}
