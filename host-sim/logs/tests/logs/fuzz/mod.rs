//! Damaged logs of every format through the whole import, up to flights and the draft of a vehicle.

#[path = "../../../../flights/tests/common/fuzzing.rs"]
mod fuzzing;
#[path = "../../../../../tests/fuzz/harness/import.rs"]
mod harness;
mod programs;
mod ros;

use fuzzing::{Outcome, fuzz};
use rand::{RngExt, SeedableRng};

fn look(name: &str, bytes: &[u8]) -> Outcome {
    match harness::import(name, bytes) {
        Ok(true) => Outcome::Flown,
        Ok(false) => Outcome::Read,
        Err(_) => Outcome::Refused,
    }
}

macro_rules! fuzzed {
    ($($test:ident: $cases:literal of $bases:expr;)*) => {
        $(
            #[test]
            fn $test() {
                fuzz($cases, $bases, look);
            }
        )*
    };
}

// As many as take some 5 s of processor time; the night runs 100,000 of each (`QUADLAB_FUZZ_CASES`).
fuzzed! {
    ulog: 25_000 of programs::ulog();
    dataflash_binary: 25_000 of programs::dataflash_binary();
    dataflash_text: 25_000 of programs::dataflash_text();
    blackbox: 12_500 of programs::blackbox();
    crazyflie: 25_000 of programs::crazyflie();
    parquet: 25_000 of programs::parquet();
    rosbag1: 12_500 of ros::rosbag1();
    mcap: 6_000 of ros::mcap();
    rosbag2: 5_000 of ros::rosbag2();
}

/// Rows of all tables, and whether something is said to be missing; nothing where there is no log at all.
fn held(name: &str, bytes: &[u8]) -> (usize, bool) {
    logs::decode(bytes, std::path::Path::new(name)).map_or((0, true), |log| {
        (log.tables.iter().map(|table| table.rows).sum(), !log.losses.damage.is_empty())
    })
}

/// Logs cut off at a thousand places: all that stood before is there, but for the record that was cut and the one before it, and the log
/// says that it is damaged.
#[test]
fn a_log_that_was_cut_off_keeps_what_came_before() {
    let streams = [
        programs::ulog(),
        programs::dataflash_binary(),
        programs::dataflash_text(),
        programs::blackbox(),
        programs::crazyflie(),
    ];
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(39);
    for base in streams.into_iter().flatten() {
        let parts: Vec<Vec<u8>> = (0..=base.records.len()).map(|k| (base.seal)(&base.records[..k])).collect();
        let rows: Vec<usize> = parts.iter().map(|part| held(base.name, part).0).collect();
        let whole = &parts[parts.len() - 1];
        // What a seal appends is no part of the records.
        let appended = parts[0].len();
        let mut told = 0;
        for _ in 0..1000 {
            let length = rng.random_range(0..whole.len());
            let before = parts.iter().rposition(|part| part.len() <= length + appended).unwrap_or(0);
            let (found, is_damaged) = held(base.name, &whole[..length]);
            assert!(
                found + 1 >= rows[before],
                "{} cut at {length}: {found} of {} rows",
                base.name,
                rows[before]
            );
            // Half a header of a log that follows may look like a frame.
            assert!(found <= rows[rows.len() - 1] + 1, "{} cut at {length}: {found}", base.name);
            told += usize::from(is_damaged);
        }
        println!("{}: {} rows, {told} of 1000 cuts are told", base.name, rows[rows.len() - 1]);
        // A line of text that ends within its last number is a line, and between two frames of a blackbox all is well.
        let least = if base.name.ends_with(".log") { 700 } else { 800 };
        assert!(told > least, "{}: {told} of 1000 cuts are told", base.name);
    }
}

/// A few kilobytes that become a hundred megabytes.
#[test]
fn what_grows_without_end_is_cut() {
    for (name, bytes) in ros::bombs() {
        fuzzing::take(name, &bytes, look);
    }
    fuzzing::take("long.parquet", &programs::long_parquet(), look);
}

/// Ten megabytes of each format: a log whose records come again and again, and one log behind the other.
#[test]
fn ten_megabytes_take_no_two_seconds_and_little_memory() {
    const LONG: usize = 10 << 20;
    let programs = [programs::ulog(), programs::dataflash_binary(), programs::dataflash_text()];
    let others = [programs::blackbox(), programs::crazyflie(), ros::rosbag1(), ros::mcap()];
    for base in programs.into_iter().chain(others).flatten() {
        let whole = (base.seal)(&base.records);
        let times = LONG / whole.len();
        fuzzing::take(base.name, &(base.seal)(&vec![base.records.clone(); times].concat()), look);
        fuzzing::take(base.name, &whole.repeat(times), look);
    }
}

/// The fuzz target begins with what is damaged here; its first byte says which of its names a log has. Run it after a format has
/// changed: `cargo test --workspace --test logs corpus -- --ignored`.
#[test]
#[ignore = "writes the corpus anew"]
fn the_corpus_is_written() {
    const ENDINGS: [&str; 8] = ["ulg", "bin", "log", "bbl", "csv", "parquet", "bag", "mcap"];
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz/corpus/import");
    let programs = [programs::ulog(), programs::dataflash_binary(), programs::dataflash_text()];
    let others = [programs::blackbox(), programs::crazyflie(), programs::parquet()];
    let ros = [ros::rosbag1(), ros::mcap(), ros::rosbag2()];
    for (k, base) in programs.into_iter().chain(others).chain(ros).flatten().enumerate() {
        let ending = base.name.rsplit('.').next().unwrap_or_default().to_lowercase();
        let first = ENDINGS.iter().position(|known| *known == ending).unwrap_or(0) as u8;
        let bytes = [vec![first], (base.seal)(&base.records)].concat();
        std::fs::write(corpus.join(format!("{k:02}-{}", base.name)), bytes).unwrap();
    }
}
