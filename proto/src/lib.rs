//! Messages between the controller and whatever stands for its craft, defined once.
//!
//! A frame is one byte, the protocol [`VERSION`], and then the [`Message`] in postcard encoding: integers as variable
//! length, f32 as four bytes little endian, options and variants with a leading tag. Equal values give equal bytes on
//! every machine, and floating-point numbers arrive bit for bit.
//!
//! Units and frames are those of the project: SI, inertial frame north-east-down, body frame front-right-down, Euler
//! angles Z-Y-X in radians, motor commands in the vehicle's own unit.
//!
//! Deliberately absent: framing for byte streams, checksums and authentication (a transport that needs them adds them
//! around a frame), and any arithmetic.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod message;

pub use message::{Command, Input, Measurement, Message, Mode, Output, Refusal};

use core::fmt;

/// Version of the messages. Anything that changes the bytes of a message raises it.
pub const VERSION: u8 = 1;

/// No frame is longer, in bytes.
pub const MAX_FRAME_LEN: usize = 160;

/// Why bytes are not a message, or a message did not become bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// There are no bytes at all.
    Empty,
    /// The other side speaks another version.
    Version {
        /// The version found.
        found: u8,
    },
    /// The bytes end too early, or a tag has no meaning.
    Malformed,
    /// A complete message is followed by this many more bytes.
    TrailingBytes(usize),
    /// The buffer for the frame is too short; [`MAX_FRAME_LEN`] always suffices.
    BufferTooShort,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("an empty frame"),
            Self::Version { found } => {
                write!(
                    f,
                    "the other side speaks protocol version {found}, this one version {VERSION}: build both from the same source"
                )
            }
            Self::Malformed => f.write_str("not a message: cut short or damaged"),
            Self::TrailingBytes(count) => write!(f, "{count} bytes too many after a message"),
            Self::BufferTooShort => {
                write!(f, "the buffer is too short for a frame; {MAX_FRAME_LEN} bytes suffice")
            }
        }
    }
}

impl core::error::Error for Error {}

/// Writes `message` into `buffer` and returns the frame, its first bytes.
///
/// # Errors
/// [`Error::BufferTooShort`].
pub fn encode<'a>(message: &Message, buffer: &'a mut [u8]) -> Result<&'a [u8], Error> {
    let (version, rest) = buffer.split_first_mut().ok_or(Error::BufferTooShort)?;
    *version = VERSION;
    let body = postcard::to_slice(message, rest).map_err(|_| Error::BufferTooShort)?.len();
    Ok(&buffer[..=body])
}

/// Reads the message in `frame`.
///
/// # Errors
/// Whatever is wrong with the bytes; nothing panics.
pub fn decode(frame: &[u8]) -> Result<Message, Error> {
    let (&version, body) = frame.split_first().ok_or(Error::Empty)?;
    if version != VERSION {
        return Err(Error::Version { found: version });
    }
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Ok(message),
        Ok((_, rest)) => Err(Error::TrailingBytes(rest.len())),
        Err(_) => Err(Error::Malformed),
    }
}
