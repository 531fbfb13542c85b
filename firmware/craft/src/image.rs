//! A configuration as bytes that a program carries: what a gains file becomes for a chip without
//! files.
//!
//! ```text
//! "quadlab", version 1 | length of the rest u16 | SHA-256 of gains and vehicle file | Config (postcard) | CRC-32
//! ```
//!
//! Integers are little endian; the CRC (CRC-32/ISO-HDLC) is of everything before it. Whatever
//! follows an image is ignored, so that it can be read from a stretch of memory.

use control::Config;
use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc};

const MAGIC: [u8; 8] = *b"quadlab\x01";
const HEAD_LEN: usize = MAGIC.len() + 2;
const HASH_LEN: usize = 32;
const CRC_LEN: usize = 4;
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// No image is longer, in bytes.
pub const MAX_IMAGE_LEN: usize = 2048;

/// Why bytes are not an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageError {
    /// They do not begin like an image of this version.
    NotAnImage,
    /// They end too early.
    CutShort,
    /// The CRC does not fit.
    Damaged,
    /// The configuration in it cannot be read: the image is of another version of the program.
    OtherConfig,
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotAnImage => "not a gains image: it starts with other bytes",
            Self::CutShort => "a gains image that is cut short",
            Self::Damaged => "a damaged gains image (CRC)",
            Self::OtherConfig => {
                "a gains image for another version of the program: build both from the same source"
            }
        })
    }
}

impl core::error::Error for ImageError {}

/// Writes the image of `config`, read from files with this SHA-256, into `buffer`; `None` if that
/// is too short ([`MAX_IMAGE_LEN`] suffices).
pub fn encode<'a>(config: &Config, vehicle_sha256: &[u8; 32], buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let (head, rest) = buffer.split_at_mut_checked(HEAD_LEN)?;
    let (hash, rest) = rest.split_at_mut_checked(HASH_LEN)?;
    hash.copy_from_slice(vehicle_sha256);
    let body = postcard::to_slice(config, rest).ok()?.len();
    let (magic, length) = head.split_at_mut_checked(MAGIC.len())?;
    magic.copy_from_slice(&MAGIC);
    length.copy_from_slice(&u16::try_from(HASH_LEN + body + CRC_LEN).ok()?.to_le_bytes());
    let end = HEAD_LEN + HASH_LEN + body;
    let crc = CRC.checksum(buffer.get(..end)?).to_le_bytes();
    buffer.get_mut(end..end + CRC_LEN)?.copy_from_slice(&crc);
    buffer.get(..end + CRC_LEN)
}

/// The configuration of the image that `bytes` begin with, and the SHA-256 of its files. Whether it
/// can be flown is not checked.
///
/// # Errors
/// Why the bytes are not an image.
pub fn decode(bytes: &[u8]) -> Result<(Config, [u8; 32]), ImageError> {
    let rest = bytes.strip_prefix(&MAGIC).ok_or(ImageError::NotAnImage)?;
    let (length, rest) = rest.split_first_chunk().ok_or(ImageError::CutShort)?;
    let rest_len = usize::from(u16::from_le_bytes(*length));
    let rest = rest.get(..rest_len).ok_or(ImageError::CutShort)?;
    let (signed, crc) = rest.split_last_chunk::<CRC_LEN>().ok_or(ImageError::CutShort)?;
    let mut digest = CRC.digest();
    [&MAGIC, length.as_slice(), signed].into_iter().for_each(|part| digest.update(part));
    if digest.finalize() != u32::from_le_bytes(*crc) {
        return Err(ImageError::Damaged);
    }
    let (hash, body) = signed.split_first_chunk::<HASH_LEN>().ok_or(ImageError::CutShort)?;
    match postcard::take_from_bytes(body) {
        Ok((config, [])) => Ok((config, *hash)),
        _ => Err(ImageError::OtherConfig),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::gains::{BatteryFilter, Complement, GyroFusion};

    fn configs() -> [Config; 3] {
        let mut full = Config::thesis();
        full.estimation.gyro = Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::MatchedPair });
        full.estimation.battery = Some(BatteryFilter { gain: 0.02 });
        full.supervision.fence = control::supervision_limits::Fence::NONE;
        [Config::thesis(), Config::thesis_hand_tuned(), full]
    }

    #[test]
    fn images_round_trip_with_something_behind_them() {
        for config in configs() {
            let mut buffer = [0xa5; MAX_IMAGE_LEN];
            let length = encode(&config, &[9; 32], &mut buffer).unwrap().len();
            assert!(length < MAX_IMAGE_LEN * 3 / 4, "{length} bytes: room for more parameters");
            assert_eq!(decode(&buffer).unwrap(), (config, [9; 32]));
            assert_eq!(decode(&buffer[..length]).unwrap(), (config, [9; 32]));
        }
    }

    #[test]
    fn a_short_buffer_is_refused() {
        let config = Config::thesis();
        let mut buffer = [0; MAX_IMAGE_LEN];
        let length = encode(&config, &[0; 32], &mut buffer).unwrap().len();
        for short in 0..length {
            assert!(encode(&config, &[0; 32], &mut vec![0; short]).is_none(), "{short}");
        }
    }

    /// Every single flipped bit, and every shorter stretch.
    #[test]
    fn damage_is_found() {
        let mut buffer = [0; MAX_IMAGE_LEN];
        let image = encode(&Config::thesis(), &[3; 32], &mut buffer).unwrap().to_vec();
        for short in 0..image.len() {
            assert!(decode(&image[..short]).is_err(), "{short}");
        }
        for bit in 0..image.len() * 8 {
            let mut damaged = image.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(decode(&damaged).is_err(), "bit {bit}");
        }
    }
}
