//! The fuzz target's harness on the stable compiler: the committed corpus, every cut of it, and
//! mutations, bounded.

#[path = "../../firmware/control/tests/common/cases.rs"]
mod cases;
mod common;

#[path = "../fuzz/harness.rs"]
mod harness;

use std::path::Path;

use cases::cases;
use proptest::prelude::*;
use proto::{Key, MAX_FRAME_LEN, MAX_PACKET_LEN, MAX_STREAM_LEN, Role, Sealer, encode, enframe};

fn corpus() -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/decode");
    let mut paths: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// What the corpus has to hold: each message as frame, plain packet, and packet of a session on a
/// stream. (With `WRITE_CORPUS=1` it is written.)
#[test]
fn the_corpus_holds_every_message() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/decode");
    for (k, message) in common::messages().iter().enumerate() {
        let (mut frame, mut packet, mut stream) =
            ([0; MAX_FRAME_LEN], [0; MAX_PACKET_LEN], [0; MAX_STREAM_LEN]);
        let frame = encode(message, &mut frame).unwrap().to_vec();
        let open = Sealer::new(Role::Ground, 0).seal(message, &mut packet).unwrap().1.to_vec();
        let (mut ground, _) = common::session(0, Some(Key::new([1; 32])));
        let keyed = ground.seal(0, message, &mut packet).unwrap().1.to_vec();
        let stream = enframe(&keyed, &mut stream).unwrap().to_vec();
        // The packet without its CRC: the harness appends one that fits.
        let bare = open[..open.len() - 4].to_vec();
        for (kind, bytes) in [("frame", frame), ("packet", open), ("bare", bare), ("stream", stream)] {
            let path = folder.join(format!("{k:02}-{kind}"));
            if std::env::var_os("WRITE_CORPUS").is_some() {
                std::fs::write(&path, &bytes).unwrap();
            }
            assert_eq!(std::fs::read(&path).unwrap(), bytes, "{}", path.display());
        }
    }
}

#[test]
fn the_corpus_and_every_cut_of_it() {
    // An interpreter is ten thousand times slower.
    let (every_file, every) = if cfg!(miri) { (9, 4001) } else { (1, 1) };
    for bytes in corpus().into_iter().step_by(every_file) {
        for length in (0..=bytes.len()).step_by(every) {
            harness::run(&bytes[..length]);
        }
        for bit in (0..bytes.len() * 8).step_by(every) {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            harness::run(&flipped);
        }
    }
}

proptest! {
    #![proptest_config(cases(30_000))]

    #[test]
    fn mutations_of_it(
        which in any::<prop::sample::Index>(),
        other in any::<prop::sample::Index>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..6), 1..12),
    ) {
        let corpus = corpus_once();
        let mut bytes = which.get(corpus).clone();
        for (place, byte, kind) in edits {
            let k = place.index(bytes.len() + 1);
            match kind {
                0 if k < bytes.len() => bytes[k] = byte,
                1 if k < bytes.len() => { bytes.remove(k); }
                2 => bytes.insert(k, byte),
                3 => bytes.truncate(k),
                4 => { let tail = other.get(corpus); bytes.truncate(k); bytes.extend(&tail[k.min(tail.len())..]); }
                _ => bytes.extend(std::iter::repeat_n(byte, usize::from(byte))),
            }
        }
        harness::run(&bytes);
    }

    #[test]
    fn anything(bytes in prop::collection::vec(any::<u8>(), 0..800)) {
        harness::run(&bytes);
    }
}

fn corpus_once() -> &'static [Vec<u8>] {
    static CORPUS: std::sync::OnceLock<Vec<Vec<u8>>> = std::sync::OnceLock::new();
    CORPUS.get_or_init(corpus)
}
