//! `host-sim/logs/tests/logs/fuzz` runs the same harness for a bounded time on the stable compiler, each format by itself.
#![no_main]

#[path = "../harness/import.rs"]
mod harness;

// The first byte says which program's the name is: of some formats the content does not tell.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    const NAMES: [&str; 8] = ["a.ulg", "a.bin", "a.log", "a.bbl", "a.csv", "a.parquet", "a.bag", "a.mcap"];
    let Some((first, bytes)) = bytes.split_first() else { return };
    drop(harness::import(NAMES[usize::from(*first) % NAMES.len()], bytes));
});
