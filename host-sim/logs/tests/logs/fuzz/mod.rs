//! Damaged logs of every format through the whole import, up to flights and the draft of a vehicle.

#[path = "../../../../flights/tests/common/fuzzing.rs"]
mod fuzzing;
#[path = "../../../../../tests/fuzz/harness/import.rs"]
mod harness;
mod programs;
mod ros;

use fuzzing::{Outcome, fuzz};

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

// As many as take no more than 20 s of processor time; `QUADLAB_FUZZ_CASES=100000` runs more of the others.
fuzzed! {
    ulog: 100_000 of programs::ulog();
    dataflash_binary: 100_000 of programs::dataflash_binary();
    dataflash_text: 100_000 of programs::dataflash_text();
    blackbox: 50_000 of programs::blackbox();
    crazyflie: 100_000 of programs::crazyflie();
    parquet: 100_000 of programs::parquet();
    rosbag1: 50_000 of ros::rosbag1();
    mcap: 50_000 of ros::mcap();
    rosbag2: 20_000 of ros::rosbag2();
}

/// A few kilobytes that become a hundred megabytes.
#[test]
fn what_grows_without_end_is_cut() {
    for (name, bytes) in ros::bombs() {
        fuzzing::take(name, &bytes, look);
    }
    fuzzing::take("long.parquet", &programs::long_parquet(), look);
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
