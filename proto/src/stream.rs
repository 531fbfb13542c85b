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

#[cfg(test)]
mod tests {
    use super::*;

    fn packets(bytes: &[u8], deframer: &mut Deframer) -> Vec<Vec<u8>> {
        bytes.iter().filter_map(|byte| deframer.push(*byte).map(<[u8]>::to_vec)).collect()
    }

    /// Examples of Cheshire and Baker, "Consistent Overhead Byte Stuffing" (1999), worked by hand:
    /// each code byte is the distance to the next zero.
    #[test]
    fn stuffed_bytes_are_those_of_the_paper() {
        let mut buffer = [0; MAX_STREAM_LEN];
        assert_eq!(enframe(&[0x11, 0x22, 0x00, 0x33], &mut buffer).unwrap(), [3, 0x11, 0x22, 2, 0x33, 0]);
        assert_eq!(enframe(&[0, 0], &mut buffer).unwrap(), [1, 1, 1, 0]);
        assert_eq!(enframe(&[1; 20], &mut [0; 20]), None, "no room");
    }

    #[test]
    fn a_reader_that_starts_in_the_middle_finds_the_next_packet() {
        let mut buffer = [0; MAX_STREAM_LEN];
        let stuffed = enframe(&[7, 0, 9], &mut buffer).unwrap().to_vec();
        let mut deframer = Deframer::new();
        let stream = [&stuffed[2..], &stuffed, &[0, 0], &stuffed].concat();
        let found = packets(&stream, &mut deframer);
        assert_eq!(found[found.len() - 2..], [[7, 0, 9], [7, 0, 9]]);
    }

    #[test]
    fn what_is_too_long_is_dropped_and_counted() {
        let mut deframer = Deframer::new();
        let mut noise = vec![1; 3 * MAX_PACKET_LEN];
        noise.push(0);
        assert_eq!(packets(&noise, &mut deframer), [[0_u8; 0]; 0]);
        assert_eq!(deframer.dropped, 1);
        let mut buffer = [0; MAX_STREAM_LEN];
        let stuffed = enframe(&[5; MAX_PACKET_LEN], &mut buffer).unwrap();
        assert_eq!(packets(stuffed, &mut deframer), [[5; MAX_PACKET_LEN]]);
    }
}
