//! A frame: one byte, the protocol [`VERSION`], and a [`Message`] in postcard encoding.

use core::fmt;

use crate::message::Message;

/// Version of the messages that are written. Anything that changes the bytes of a message raises
/// it.
pub const VERSION: u8 = 3;

/// Oldest version that is still read.
pub const MIN_VERSION: u8 = 3;

/// No frame is longer, in bytes.
pub const MAX_FRAME_LEN: usize = 320;

/// Why bytes are not a message, or a message did not become bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Error {
    /// There are no bytes.
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
                    "the other side speaks protocol version {found}, this one speaks {VERSION}: build both from the same source"
                )
            }
            Self::Malformed => f.write_str("not a message: cut short or damaged"),
            Self::TrailingBytes(count) => write!(f, "{count} extra bytes after a message"),
            Self::BufferTooShort => {
                write!(f, "the buffer is too short for a frame; {MAX_FRAME_LEN} bytes are enough")
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
    decode_body(version, body)
}

/// Reads the message of a version without its first byte.
pub(crate) fn decode_body(version: u8, body: &[u8]) -> Result<Message, Error> {
    if !(MIN_VERSION..=VERSION).contains(&version) {
        return Err(Error::Version { found: version });
    }
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Ok(message),
        Ok((_, rest)) => Err(Error::TrailingBytes(rest.len())),
        Err(_) => Err(Error::Malformed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_begins_with_its_version() {
        let mut buffer = [0; MAX_FRAME_LEN];
        let frame = encode(&Message::Who, &mut buffer).unwrap();
        // `Who` is the tenth message.
        assert_eq!(frame, [VERSION, 9]);
        assert_eq!(decode(frame), Ok(Message::Who));
        assert_eq!(decode(&[]), Err(Error::Empty));
        assert_eq!(decode(&[VERSION + 1, 9]), Err(Error::Version { found: VERSION + 1 }));
        assert_eq!(decode(&[MIN_VERSION - 1, 9]), Err(Error::Version { found: MIN_VERSION - 1 }));
        assert_eq!(decode(&[VERSION, 9, 0, 0]), Err(Error::TrailingBytes(2)));
        assert_eq!(decode(&[VERSION]), Err(Error::Malformed));
        assert_eq!(encode(&Message::Who, &mut [0; 1]), Err(Error::BufferTooShort));
    }
}
