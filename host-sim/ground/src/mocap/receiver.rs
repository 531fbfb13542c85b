//! What every tracker has in common: sightings and errors.

use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::time::Duration;

use proto::Pose;

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

/// What a tracker has sent.
#[derive(Debug, Clone, PartialEq)]
pub enum TrackerEvent {
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

/// A tracker that sees the craft.
pub trait MocapReceiver: Send {
    /// The next event, waiting for it up to `patience`.
    ///
    /// # Errors
    /// A socket that has failed for good.
    fn next(&mut self, patience: Duration) -> Result<TrackerEvent, MocapError>;

    /// What it is, for people.
    fn describe(&self) -> String;
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
