//! Packets on a byte stream: consistent overhead byte stuffing, with a zero after each packet.
//!
//! A zero never occurs inside, so a reader that starts in the middle or loses bytes resynchronises
//! at the next one.

use cobs::{DecodeResult, DecoderState};

use crate::packet::MAX_PACKET_LEN;

/// No stuffed packet is longer, in bytes: one byte of overhead in 254, one more, and the zero.
pub const MAX_STREAM_LEN: usize = MAX_PACKET_LEN + MAX_PACKET_LEN / 254 + 2;

/// Writes a packet in its stuffed form with its zero; `None` if `buffer` is too short
/// ([`MAX_STREAM_LEN`] suffices).
pub fn enframe<'a>(packet: &[u8], buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let length = cobs::try_encode(packet, buffer).ok()?;
    *buffer.get_mut(length)? = 0;
    buffer.get(..=length)
}

/// Finds packets in a byte stream.
#[derive(Debug)]
pub struct Deframer {
    state: DecoderState,
    /// What has been unstuffed of the present packet.
    buffer: [u8; MAX_PACKET_LEN],
    length: usize,
    /// Too long to be a packet: everything up to the next zero is dropped.
    overlong: bool,
    /// Frames that were no packets; stays at the greatest number.
    pub dropped: u32,
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deframer {
    /// Nothing has come yet.
    pub const fn new() -> Self {
        let state = DecoderState::Idle;
        Self { state, buffer: [0; MAX_PACKET_LEN], length: 0, overlong: false, dropped: 0 }
    }

    /// Takes one byte; gives the packet that it ends, still sealed.
    pub fn push(&mut self, byte: u8) -> Option<&[u8]> {
        // Byte by byte: a buffer that is unstuffed in place is indexed by its own content, and no
        // compiler sees that this cannot panic.
        match self.state.feed(byte) {
            // Zeros between packets are allowed.
            Ok(DecodeResult::NoData) => None,
            Ok(DecodeResult::DataStart) => {
                (self.length, self.overlong) = (0, false);
                None
            }
            Ok(DecodeResult::DataContinue(byte)) => {
                match self.buffer.get_mut(self.length) {
                    Some(place) => {
                        *place = byte;
                        self.length += 1;
                    }
                    None => self.overlong = true,
                }
                None
            }
            Ok(DecodeResult::DataComplete) if !self.overlong => self.buffer.get(..self.length),
            Ok(DecodeResult::DataComplete) | Err(_) => {
                self.dropped = self.dropped.saturating_add(1);
                None
            }
        }
    }
}
