//! The link's sockets: one that hears everybody, and one that hears the known peer alone.
//!
//! The kernel keeps a queue for each socket and drops what comes when it is full. Whoever floods
//! the port would fill the queue that the pilot's packets wait in, and however fast it is emptied
//! once a tick, most of them would be lost. So the peer that is known gets a socket of its own:
//! bound to the same address (`SO_REUSEPORT`) and connected to the peer, which is where Linux then
//! puts that peer's packets and nobody else's. A flood fills the other queue.
//!
//! `SO_REUSEPORT` is on only while the second socket is bound, so a second program on the same port
//! is still refused. Linux alone asks for the same user on both.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};

use proto::MAX_PACKET_LEN;
use socket2::{Domain, Protocol, SockRef, Socket, Type};

use crate::clock::monotonic_ns;
use crate::error::{Result, system};

/// What the known peer's queue is asked to hold, bytes: seconds of packets. Linux gives no more
/// than `net.core.rmem_max`. The queue of the others stays short: what waits in a long one is old.
const QUEUE_LEN: usize = 1 << 20;

/// Packets of the known peer that are looked at in a tick; a ground station sends some five.
const LOOKS: usize = 512;

/// How long the packets of others are looked at in a tick, ns: a twentieth of it.
const OTHERS_NS: u64 = 500_000;

/// Which queue a packet was in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Queue {
    /// The known peer's.
    Known,
    /// Everybody else's.
    Others,
}

/// The sockets.
#[derive(Debug)]
pub struct Sockets {
    others: UdpSocket,
    address: SocketAddr,
    known: Option<(SocketAddr, UdpSocket)>,
}

impl Sockets {
    /// Listens.
    ///
    /// # Errors
    /// A port that is taken.
    pub fn open(listen: SocketAddr) -> Result<Self> {
        let others = UdpSocket::bind(listen)
            .map_err(system("listen on the link's port; is another program using it?"))?;
        others.set_nonblocking(true).map_err(system("set up the link's socket"))?;
        let address = others.local_addr().map_err(system("read the address of the link's port"))?;
        Ok(Self { others, address, known: None })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Gives this peer a queue of its own, and the one before none. Where that is not possible, it
    /// shares the others'.
    pub fn prefer(&mut self, peer: SocketAddr) {
        if self.known.as_ref().is_none_or(|(known, _)| *known != peer) {
            // Closed first: two peers at one time are not known.
            self.known = None;
            self.known = self.connected(peer).ok().map(|socket| (peer, socket));
        }
    }

    fn connected(&self, peer: SocketAddr) -> std::io::Result<UdpSocket> {
        let socket = Socket::new(Domain::for_address(self.address), Type::DGRAM, Some(Protocol::UDP))?;
        socket.set_nonblocking(true)?;
        // As much as there may be.
        let _ = socket.set_recv_buffer_size(QUEUE_LEN);
        socket.set_reuse_port(true)?;
        let listening = SockRef::from(&self.others);
        listening.set_reuse_port(true)?;
        let bound = socket.bind(&self.address.into());
        listening.set_reuse_port(false)?;
        bound?;
        socket.connect(&peer.into())?;
        Ok(socket.into())
    }

    /// Hands over what has arrived, the known peer's first; never waits. Others are heard for a
    /// short time only, however many they are.
    pub fn receive(&self, mut each: impl FnMut(&[u8], SocketAddr, Queue)) {
        if let Some((_, socket)) = &self.known {
            let mut looks = 0..LOOKS;
            empty(socket, || looks.next().is_some(), |packet, from| each(packet, from, Queue::Known));
        }
        let until_ns = monotonic_ns().saturating_add(OTHERS_NS);
        empty(&self.others, || monotonic_ns() < until_ns, |packet, from| each(packet, from, Queue::Others));
    }

    /// Sends a packet; what cannot be sent is lost, as on the air.
    pub fn send(&self, packet: &[u8], to: SocketAddr) {
        let _ = self.others.send_to(packet, to);
    }
}

/// Takes packets out of a queue as long as there are any and `go_on`.
fn empty(socket: &UdpSocket, mut go_on: impl FnMut() -> bool, mut each: impl FnMut(&[u8], SocketAddr)) {
    // A byte more than a packet has, to see what is too long.
    let mut buffer = [0; MAX_PACKET_LEN + 1];
    while go_on() {
        match socket.recv_from(&mut buffer) {
            Ok((length, from)) => each(buffer.get(..length).unwrap_or_default(), from),
            Err(error) if error.kind() == ErrorKind::WouldBlock => return,
            // The other side's port is closed (ICMP); the next packet may be another's.
            Err(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: &str = "127.0.0.1:0";

    fn heard(sockets: &Sockets) -> Vec<(Vec<u8>, Queue)> {
        let mut all = Vec::new();
        sockets.receive(|packet, _, queue| all.push((packet.to_vec(), queue)));
        all
    }

    #[test]
    fn the_known_peer_has_a_queue_of_its_own() {
        let mut sockets = Sockets::open(HERE.parse().unwrap()).unwrap();
        let [pilot, next, stranger] = [(); 3].map(|()| UdpSocket::bind(HERE).unwrap());
        let queue_of = |sockets: &Sockets, from: &UdpSocket| {
            from.send_to(b"x", sockets.address()).unwrap();
            heard(sockets)[..].first().unwrap().1
        };
        assert_eq!(queue_of(&sockets, &pilot), Queue::Others);
        for known in [&pilot, &next, &pilot] {
            sockets.prefer(known.local_addr().unwrap());
            for from in [&pilot, &next, &stranger] {
                let is_known = from.local_addr().unwrap() == known.local_addr().unwrap();
                assert_eq!(queue_of(&sockets, from) == Queue::Known, is_known);
            }
        }
        // A flood that nobody takes fills one queue; what the pilot says waits in the other.
        for _ in 0..100_000 {
            stranger.send_to(&[7; 100], sockets.address()).unwrap();
        }
        pilot.send_to(b"land", sockets.address()).unwrap();
        assert_eq!(heard(&sockets)[0], (b"land".to_vec(), Queue::Known));
    }

    #[test]
    fn a_second_program_on_the_port_is_refused_with_a_known_peer_too() {
        let mut sockets = Sockets::open(HERE.parse().unwrap()).unwrap();
        let peer = UdpSocket::bind(HERE).unwrap();
        sockets.prefer(peer.local_addr().unwrap());
        let refused = Sockets::open(sockets.address()).unwrap_err().to_string();
        assert!(refused.contains("is another program using it?"), "{refused}");
    }
}
