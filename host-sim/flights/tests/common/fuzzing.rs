//! Many damaged files through a reader: nothing panics, hangs, or takes much more memory than the file.
//!
//! A base file is given as its records. They are changed, dropped, repeated, swapped and spliced, then put
//! together with lengths and checksums that fit, so that damage gets behind them; then some files are
//! changed once more as a whole. The seed is printed; `QUADLAB_FUZZ_SEED`, `QUADLAB_FUZZ_FIRST` and
//! `QUADLAB_FUZZ_CASES` run the same files again, or more of them.

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use cpu_time::ThreadTime;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// What reading may take beside four times the file, bytes.
const MEMORY: u64 = 64 << 20;
/// Processor time that no file of this size may take.
const SLOWEST: Duration = Duration::from_secs(2);
/// A file that is not done after this hangs.
const HANG: Duration = Duration::from_secs(60);
/// Records are not repeated beyond this, bytes.
const LARGEST: usize = 1 << 18;

/// A file to begin with.
pub(crate) struct Base {
    /// Name of the file that the reader is told.
    pub(crate) name: &'static str,
    /// Its parts: lines, messages, frames.
    pub(crate) records: Vec<Vec<u8>>,
    /// Makes a file of the parts, with lengths and checksums that fit.
    pub(crate) seal: fn(&[Vec<u8>]) -> Vec<u8>,
}

/// What came of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Refused,
    /// Read, but nothing in it is a flight.
    #[allow(dead_code, reason = "not every test needs all of it")]
    Read,
    Flown,
}

/// The parts one after another.
pub(crate) fn joined(records: &[Vec<u8>]) -> Vec<u8> {
    records.concat()
}

/// A file cut in front of every place where some bytes stand.
pub(crate) fn cut_before(bytes: &[u8], marker: &[u8]) -> Vec<Vec<u8>> {
    let mut records = vec![Vec::new()];
    for (at, &byte) in bytes.iter().enumerate() {
        if bytes[at..].starts_with(marker) {
            records.push(Vec::new());
        }
        records.last_mut().expect("the first").push(byte);
    }
    records.retain(|record| !record.is_empty());
    records
}

/// Reads so many damaged files; panics with what runs the first bad one again.
pub(crate) fn fuzz(cases: u64, bases: Vec<Base>, read: fn(&str, &[u8]) -> Outcome) {
    for base in &bases {
        let whole = (base.seal)(&base.records);
        assert_eq!(read(base.name, &whole), Outcome::Flown, "{} is no good file", base.name);
    }
    let setting = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().expect(name));
    let seed = setting("QUADLAB_FUZZ_SEED").unwrap_or_else(|| RandomState::new().hash_one(0));
    let first = setting("QUADLAB_FUZZ_FIRST").unwrap_or(0);
    let cases = setting("QUADLAB_FUZZ_CASES").unwrap_or(cases);
    println!("{cases} damaged files, QUADLAB_FUZZ_SEED={seed}");
    let at = Arc::new(AtomicU64::new(first));
    let (done, is_done) = channel::<()>();
    let worker = std::thread::spawn({
        let at = at.clone();
        move || {
            let mut summary = Summary::default();
            for case in first..first + cases {
                at.store(case, Ordering::Relaxed);
                let base = &bases[case as usize % bases.len()];
                summary.add(base.name, &damaged(base, seed, case), read);
            }
            drop(done);
            println!("{summary:?}");
        }
    });
    let again = |case| format!("QUADLAB_FUZZ_SEED={seed} QUADLAB_FUZZ_FIRST={case} QUADLAB_FUZZ_CASES=1");
    loop {
        let before = at.load(Ordering::Relaxed);
        if is_done.recv_timeout(HANG) == Err(RecvTimeoutError::Disconnected) {
            break;
        }
        assert!(at.load(Ordering::Relaxed) != before, "hangs: {}", again(before));
    }
    assert!(worker.join().is_ok(), "bad file: {}", again(at.load(Ordering::Relaxed)));
}

/// Reads one file, within its bounds.
#[allow(dead_code, reason = "not every test needs all of it")]
pub(crate) fn take(name: &str, bytes: &[u8], read: fn(&str, &[u8]) -> Outcome) {
    let mut summary = Summary::default();
    summary.add(name, bytes, read);
    println!("{name}, {} bytes: {summary:?}", bytes.len());
}

/// What the files took.
#[derive(Debug, Default)]
struct Summary {
    refused: u64,
    read: u64,
    flown: u64,
    most_bytes: u64,
    slowest: Duration,
    all: Duration,
}

impl Summary {
    fn add(&mut self, name: &str, bytes: &[u8], read: fn(&str, &[u8]) -> Outcome) {
        if let Some(folder) = std::env::var_os("QUADLAB_FUZZ_KEEP") {
            std::fs::write(PathBuf::from(folder).join(name), bytes).expect("a folder to keep files in");
        }
        let began = ThreadTime::now();
        let mut outcome = Outcome::Refused;
        let memory = allocation_counter::measure(|| outcome = read(name, bytes));
        let took = began.elapsed();
        let most = 4 * bytes.len() as u64 + MEMORY;
        assert!(memory.bytes_max <= most, "{name}: {} bytes for {}", memory.bytes_max, bytes.len());
        assert!(took < SLOWEST, "{name}: {took:?} for {} bytes", bytes.len());
        match outcome {
            Outcome::Refused => self.refused += 1,
            Outcome::Read => self.read += 1,
            Outcome::Flown => self.flown += 1,
        }
        self.most_bytes = self.most_bytes.max(memory.bytes_max);
        self.slowest = self.slowest.max(took);
        self.all += took;
    }
}

/// The file of a case.
fn damaged(base: &Base, seed: u64, case: u64) -> Vec<u8> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ case.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut records = base.records.clone();
    // Most often one: what reads every row, or refuses a file at the first fault, goes on to the next thing.
    let inside = [0, 1, 1, 1, 2, 3, 5, 8][rng.random_range(0..8_usize)];
    for _ in 0..inside {
        change_records(&mut records, &mut rng);
    }
    let mut bytes = (base.seal)(&records);
    // What no change inside can reach: the file's own frame, checksums that do not fit.
    if inside == 0 || rng.random_range(0..4_u8) == 0 {
        for _ in 0..rng.random_range(1..4_u8) {
            change_bytes(&mut bytes, &mut rng);
        }
    }
    bytes
}

/// One of so many; half of the time one of the first, where a file describes itself.
fn place(count: usize, rng: &mut Pcg64Mcg) -> usize {
    let part: f64 = rng.random_range(0.0..1.0);
    let part = if rng.random_range(0..2_u8) == 0 { part } else { part.powi(4) };
    ((count as f64 * part) as usize).min(count.saturating_sub(1))
}

fn change_records(records: &mut Vec<Vec<u8>>, rng: &mut Pcg64Mcg) {
    if records.is_empty() {
        return;
    }
    let (at, other) = (place(records.len(), rng), place(records.len(), rng));
    match rng.random_range(0..16_u8) {
        0 => drop(records.remove(at)),
        1 => {
            let again = records[at].clone();
            let room = LARGEST.saturating_sub(records.iter().map(Vec::len).sum()) / again.len().max(1);
            let most = if rng.random_range(0..50_u8) == 0 { 2000 } else { 4 };
            let copies = rng.random_range(1..=most).min(room);
            records.splice(at..at, std::iter::repeat_n(again, copies));
        }
        2 => records.swap(at, other),
        3 => {
            let (head, tail) = (place(records[at].len(), rng), place(records[other].len(), rng));
            let tail = records[other].get(tail..).unwrap_or_default().to_vec();
            records[at].truncate(head);
            records[at].extend(tail);
        }
        4 => {
            let moved = records.remove(at);
            records.insert(other.min(records.len()), moved);
        }
        _ => change_bytes(&mut records[at], rng),
    }
}

fn change_bytes(bytes: &mut Vec<u8>, rng: &mut Pcg64Mcg) {
    if bytes.is_empty() {
        return bytes.extend((0..rng.random_range(0..40_u8)).map(|_| rng.random::<u8>()));
    }
    let at = place(bytes.len(), rng);
    match rng.random_range(0..12_u8) {
        0 | 1 => bytes[at] ^= 1 << rng.random_range(0..8_u8),
        2 => bytes[at] = rng.random(),
        3..=5 => overwrite(bytes, at, rng),
        6 => bytes.truncate(at),
        7 => {
            let end = (at + rng.random_range(1..64_usize)).min(bytes.len());
            bytes.drain(at..end);
        }
        8 => {
            let more: Vec<u8> = (0..rng.random_range(1..32_u8)).map(|_| rng.random()).collect();
            bytes.splice(at..at, more);
        }
        9 => {
            let end = (at + rng.random_range(1..64_usize)).min(bytes.len());
            bytes[at..end].fill([0, 0xff, 0x80, 0x7f, b'P', rng.random()][rng.random_range(0..6_usize)]);
        }
        _ => token(bytes, at, rng),
    }
}

/// A number of one to eight bytes, either end first, at which counts and lengths go wrong.
fn overwrite(bytes: &mut [u8], at: usize, rng: &mut Pcg64Mcg) {
    let width = [1, 2, 4, 8][rng.random_range(0..4_usize)];
    let near = rng.random_range(0..9_u64);
    let size = bytes.len() as u64;
    let floats = [f64::NAN, f64::INFINITY, f64::MAX, f64::MIN_POSITIVE, -0.0, 1e15].map(f64::to_bits);
    let number = match rng.random_range(0..9_u8) {
        0 => near,
        1 => near.wrapping_neg(),
        2 => (1 << (8 * width - 1)) - near.min(1),
        3 => u64::MAX >> (64 - 8 * width),
        4 => size.wrapping_add(near).wrapping_sub(4),
        5 => 1 << rng.random_range(0..64_u8),
        6 => floats[rng.random_range(0..6_usize)],
        7 => u64::from((f64::from_bits(floats[rng.random_range(0..6_usize)]) as f32).to_bits()),
        _ => rng.random(),
    };
    let mut number = number.to_le_bytes();
    if rng.random_range(0..4_u8) == 0 {
        number[..width].reverse();
    }
    bytes.iter_mut().skip(at).zip(&number[..width]).for_each(|(byte, new)| *byte = *new);
}

/// A number or word of a text becomes another one.
fn token(bytes: &mut Vec<u8>, at: usize, rng: &mut Pcg64Mcg) {
    const TOKENS: [&str; 28] = [
        "",
        "0",
        "-0",
        "-1",
        "1e999",
        "-1e-999",
        "nan",
        "inf",
        "-inf",
        "99999999999999999999",
        "18446744073709551615",
        "9223372036854775807",
        "-9223372036854775808",
        "4294967296",
        "65536",
        "256",
        "1e15",
        "0.000000001",
        "0x7f800000",
        ",",
        ",,,,",
        "\n",
        "\r\n",
        "\"",
        "[",
        "=",
        "\u{fffd}",
        "Q",
    ];
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-+".contains(byte);
    let start = bytes[..at].iter().rposition(|byte| !is_word(byte)).map_or(0, |before| before + 1);
    let end = bytes[at..].iter().position(|byte| !is_word(byte)).map_or(bytes.len(), |length| at + length);
    let new = TOKENS[rng.random_range(0..TOKENS.len())];
    bytes.splice(start..end, new.bytes());
}
