//! Motion capture: where a tracker sees the craft, whatever the tracker.
//!
//! A [`Receiver`] waits for frames and gives poses in our frames. Three are here: [`Vicon`] (UDP object stream, crate's module
//! [`vicon`](crate::vicon)), [`OptiTrack`](crate::optitrack::OptiTrack) (NatNet) and [`Replay`](crate::replay::Replay) (a
//! flight file). A simulated laboratory speaks Vicon's format.
//!
//! Nothing that comes in over the network ends a receiver: what cannot be used is refused by name and counted. Trackers do not
//! show who they are, so whoever can reach the port can move the craft: bind to the tracker's own network.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use proto::Pose;

use crate::frames::{Frames, rotation_from_xyz};
use crate::vicon::Block;

/// Larger than any datagram.
pub(crate) const DATAGRAM: usize = 65_536;

/// A frame in which the craft was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Number of the tracker's frame.
    pub frame: u32,
    /// Where the craft is.
    pub pose: Pose,
    /// How old the frame was when it came, as far as the tracker says.
    pub age: Duration,
}

/// What a receiver has heard.
#[derive(Debug, Clone, PartialEq)]
pub enum Heard {
    /// The craft.
    Seen(Sighting),
    /// A frame in which the cameras lost it.
    NotSeen {
        /// Number of the frame.
        frame: u32,
    },
    /// Something that cannot be used, and why.
    Refused(String),
    /// Nothing in that time.
    Nothing,
    /// Nothing more will come.
    End,
}

/// Why a tracker cannot be listened to.
#[derive(Debug, thiserror::Error)]
pub enum MocapError {
    /// The port.
    #[error("cannot listen for the tracker on {address}: {source}; is another program listening there?")]
    Bind {
        /// Where.
        address: String,
        /// What the system said.
        source: io::Error,
    },
    /// The socket failed later.
    #[error("the tracker's socket failed: {0}")]
    Socket(#[from] io::Error),
    /// A NatNet server does not do what it should.
    #[error("NatNet server {server}: {problem}")]
    Server {
        /// Its address.
        server: SocketAddr,
        /// What is wrong and how to mend it.
        problem: String,
    },
    /// A flight to replay that cannot be.
    #[error("cannot replay {file}: {problem}")]
    Replay {
        /// The file.
        file: String,
        /// What is wrong.
        problem: String,
    },
}

/// Something that sees the craft.
pub trait Receiver: Send {
    /// The next thing heard, waiting for it up to `patience`.
    ///
    /// # Errors
    /// A socket that has failed for good.
    fn next(&mut self, patience: Duration) -> Result<Heard, MocapError>;

    /// What it is, for people.
    fn describe(&self) -> String;
}

/// Which frames are new. UDP may deliver late or twice; a tracker that starts anew counts from a low number again.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Order {
    last: Option<u32>,
}

/// Frames this far back are those of a tracker that was restarted: 10 s at 100 Hz.
const RESTARTED: i32 = -1000;

impl Order {
    /// Is this frame newer than all before?
    pub(crate) fn is_new(&mut self, frame: u32) -> bool {
        let ahead = self.last.map_or(1, |last| frame.wrapping_sub(last).cast_signed());
        if ahead <= 0 && ahead > RESTARTED {
            return false;
        }
        self.last = Some(frame);
        true
    }
}

/// Turns a wait that ran out into nothing; gives the length of what came.
pub(crate) fn received<T>(outcome: io::Result<T>) -> Result<Option<T>, MocapError> {
    match outcome {
        Ok(got) => Ok(Some(got)),
        Err(error) => match error.kind() {
            // A closed port on the other side (ICMP) is none of ours.
            ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::ConnectionRefused
            | ErrorKind::ConnectionReset => Ok(None),
            _ => Err(error.into()),
        },
    }
}

/// Sockets refuse a wait of zero.
pub(crate) fn at_least(patience: Duration) -> Option<Duration> {
    Some(patience.max(Duration::from_micros(100)))
}

/// Vicon Tracker's UDP object stream.
#[derive(Debug)]
pub struct Vicon {
    socket: UdpSocket,
    frames: Frames,
    /// The object's name; absent: the only one.
    object: Option<String>,
    order: Order,
    buffer: Vec<u8>,
}

impl Vicon {
    /// Listens on `address` ([`vicon::PORT`](crate::vicon::PORT) is Tracker's) for the object of that name, or for the only one.
    ///
    /// # Errors
    /// [`MocapError::Bind`].
    pub fn listen(address: SocketAddr, object: Option<String>, frames: Frames) -> Result<Self, MocapError> {
        let bind = |source| MocapError::Bind { address: address.to_string(), source };
        let socket = UdpSocket::bind(address).map_err(bind)?;
        Ok(Self { socket, frames, object, order: Order::default(), buffer: vec![0; DATAGRAM] })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// What a datagram says of the craft.
    fn judge(&mut self, length: usize) -> Heard {
        let datagram = self.buffer.get(..length).unwrap_or_default();
        let block = match Block::parse(datagram) {
            Ok(block) => block,
            Err(error) => return Heard::Refused(error.to_string()),
        };
        let Block { frame, objects } = &block;
        let named = |name: &str| objects.iter().find(|object| object.name == name);
        let object = match (&self.object, objects.as_slice()) {
            (Some(name), _) => named(name),
            (None, [only]) => Some(only),
            (None, []) => None,
            (None, several) => {
                let names: Vec<&str> = several.iter().map(|object| object.name.as_str()).collect();
                return Heard::Refused(format!(
                    "the tracker streams {} objects: name the craft's ({})",
                    several.len(),
                    names.join(", ")
                ));
            }
        };
        // A block without the craft may belong to a frame whose next block has it.
        let Some(object) = object else { return Heard::Nothing };
        if !self.order.is_new(*frame) {
            return Heard::Refused(format!("frame {frame} came late or twice"));
        }
        if !object.is_seen() {
            return Heard::NotSeen { frame: *frame };
        }
        let position_m = object.translation_mm.map(|mm| mm * 1e-3);
        match self.frames.pose(position_m, &rotation_from_xyz(object.rotation_rad)) {
            Some(pose) => Heard::Seen(Sighting { frame: *frame, pose, age: Duration::ZERO }),
            None => Heard::Refused(format!("frame {frame} has a pose that is no number")),
        }
    }
}

impl Receiver for Vicon {
    fn next(&mut self, patience: Duration) -> Result<Heard, MocapError> {
        self.socket.set_read_timeout(at_least(patience))?;
        match received(self.socket.recv(&mut self.buffer))? {
            Some(length) => Ok(self.judge(length)),
            None => Ok(Heard::Nothing),
        }
    }

    fn describe(&self) -> String {
        let port = self.address().map_or_else(|_| "?".into(), |address| address.to_string());
        format!("Vicon Tracker's object stream on {port}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Axes;
    use crate::vicon::Object;

    const SOON: Duration = Duration::from_secs(5);

    fn object(name: &str, x_mm: f64) -> Object {
        Object { name: name.into(), translation_mm: [x_mm, 0.0, 1000.0], rotation_rad: [0.1, 0.0, 0.0] }
    }

    fn lab(name: Option<&str>) -> (Vicon, UdpSocket) {
        let here: SocketAddr = "127.0.0.1:0".parse().unwrap();
        let vicon = Vicon::listen(here, name.map(Into::into), Frames::with_axes(Axes::Z_UP)).unwrap();
        let tracker = UdpSocket::bind(here).unwrap();
        tracker.connect(vicon.address().unwrap()).unwrap();
        (vicon, tracker)
    }

    #[test]
    fn the_crafts_object_is_found_by_name_or_by_being_alone() {
        for (name, objects, x_m) in [
            (Some("quad"), vec![object("wand", 1.0), object("quad", 2500.0)], 2.5),
            (None, vec![object("anything", -300.0)], -0.3),
        ] {
            let (mut vicon, tracker) = lab(name);
            tracker.send(&Block { frame: 9, objects }.to_bytes()).unwrap();
            let Heard::Seen(seen) = vicon.next(SOON).unwrap() else { panic!("not seen") };
            assert_eq!(seen.frame, 9);
            assert_eq!(seen.pose.position_m, [x_m, 0.0, -1.0]);
            assert!((seen.pose.attitude_rad[0] - 0.1).abs() < 1e-6, "{seen:?}");
        }
        let (mut vicon, tracker) = lab(None);
        let objects = vec![object("wand", 1.0), object("quad", 2.0)];
        tracker.send(&Block { frame: 1, objects }.to_bytes()).unwrap();
        let Heard::Refused(why) = vicon.next(SOON).unwrap() else { panic!("not refused") };
        assert!(why.contains("wand, quad"), "{why}");
    }

    #[test]
    fn what_cannot_be_used_is_refused_and_the_next_frame_is_heard() {
        let (mut vicon, tracker) = lab(None);
        let hidden = Object { translation_mm: [0.0; 3], rotation_rad: [0.0; 3], ..object("quad", 0.0) };
        let broken = Object { translation_mm: [f64::NAN; 3], ..object("quad", 0.0) };
        let mut hear = |bytes: &[u8]| {
            tracker.send(bytes).unwrap();
            vicon.next(SOON).unwrap()
        };
        let block = |frame, object| Block { frame, objects: vec![object] }.to_bytes();
        assert!(matches!(hear(b"hello"), Heard::Refused(_)));
        assert!(matches!(hear(&block(5, object("quad", 1.0))), Heard::Seen(_)));
        assert!(matches!(hear(&block(5, object("quad", 1.0))), Heard::Refused(_)), "twice");
        assert!(matches!(hear(&block(4, object("quad", 1.0))), Heard::Refused(_)), "late");
        assert_eq!(hear(&block(6, hidden)), Heard::NotSeen { frame: 6 });
        assert!(matches!(hear(&block(7, broken)), Heard::Refused(_)));
        assert_eq!(hear(&Block { frame: 8, objects: Vec::new() }.to_bytes()), Heard::Nothing);
        assert!(matches!(hear(&block(9, object("quad", 1.0))), Heard::Seen(_)));
        assert_eq!(vicon.next(Duration::ZERO).unwrap(), Heard::Nothing);
    }

    #[test]
    fn frame_numbers_wrap_and_trackers_restart() {
        let mut order = Order::default();
        let new: Vec<bool> = [u32::MAX - 1, u32::MAX, 0, u32::MAX, 1, 90_000, 89_999, 3, 4]
            .map(|frame| order.is_new(frame))
            .into();
        assert_eq!(new, [true, true, true, false, true, true, false, true, true]);
    }
}
