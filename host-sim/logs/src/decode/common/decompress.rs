//! Compressed parts of a log. A damaged part gives what stands before the damage.

use std::io::Read;

use super::budget::Budget;
use super::faults::guarded;

/// How a part is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::decode) enum Compression {
    Bzip2,
    Lz4,
    Zstandard,
}

/// What came of a part.
#[derive(Debug)]
pub(in crate::decode) struct Decompressed {
    pub(in crate::decode) bytes: Vec<u8>,
    /// Whether all of it is there.
    pub(in crate::decode) whole: bool,
}

/// Decompresses a part, to no more than `most` bytes and no more than the budget has.
pub(in crate::decode) fn decompress(
    compressed: &[u8],
    compression: Compression,
    most: usize,
    budget: &mut Budget,
) -> Decompressed {
    let most = most.min(budget.next());
    let mut bytes = Vec::new();
    let whole = guarded(|| match compression {
        Compression::Bzip2 => read(bzip2_rs::DecoderReader::new(compressed), most, &mut bytes),
        Compression::Lz4 => read(lz4_flex::frame::FrameDecoder::new(compressed), most, &mut bytes),
        #[cfg(feature = "all-formats")]
        Compression::Zstandard => zstd::stream::read::Decoder::with_buffer(compressed)
            .is_ok_and(|decoder| read(decoder, most, &mut bytes)),
        #[cfg(not(feature = "all-formats"))]
        Compression::Zstandard => false,
    });
    budget.take(bytes.len());
    Decompressed { whole: whole == Some(true), bytes }
}

/// Reads up to `most` bytes; whether it came to the end without an error.
fn read(mut decoder: impl Read, most: usize, bytes: &mut Vec<u8>) -> bool {
    // One more byte than allowed tells whether there is more. What was read before an error stays in
    // `bytes`.
    let whole = decoder.by_ref().take(most as u64 + 1).read_to_end(bytes).is_ok() && bytes.len() <= most;
    bytes.truncate(most);
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `printf 'quadlab quadlab quadlab\n' | bzip2 | xxd -p`
    const BZIP2: &str = "425a683931415926535987e7f8ac00000a51800010400034042200200021b506410c08c19c344229c78bb9229c284843f3fc5600";

    fn from_hex(text: &str) -> Vec<u8> {
        (0..text.len() / 2).map(|k| u8::from_str_radix(&text[2 * k..2 * k + 2], 16).unwrap()).collect()
    }

    #[test]
    fn bzip2_of_the_original_program() {
        let mut budget = Budget::for_decompression(0);
        let result = decompress(&from_hex(BZIP2), Compression::Bzip2, 1000, &mut budget);
        assert!(result.whole);
        assert_eq!(result.bytes, b"quadlab quadlab quadlab\n");
    }

    #[test]
    fn a_part_that_was_cut_gives_its_beginning() {
        let plain: Vec<u8> = (0..1_000_000_u32).flat_map(|k| (k / 7).to_le_bytes()).collect();
        let compressed = zstd::stream::encode_all(&plain[..], 1).unwrap();
        let mut budget = Budget::for_decompression(0);
        let half = &compressed[..compressed.len() / 2];
        let result = decompress(half, Compression::Zstandard, plain.len(), &mut budget);
        assert!(!result.whole && result.bytes.len() > plain.len() / 3);
        assert!(plain.starts_with(&result.bytes));
    }

    #[test]
    fn no_more_than_allowed() {
        let compressed = zstd::stream::encode_all(&vec![0; 10_000_000][..], 1).unwrap();
        let mut budget = Budget::for_decompression(0);
        let result = decompress(&compressed, Compression::Zstandard, 1000, &mut budget);
        assert_eq!((result.bytes.len(), result.whole), (1000, false));
    }
}
