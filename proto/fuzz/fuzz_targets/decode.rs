//! Any bytes to every decoder there is. The same harness runs for a bounded time in
//! `tests/fuzz.rs`.
#![no_main]

#[path = "../harness.rs"]
mod harness;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| harness::run(bytes));
