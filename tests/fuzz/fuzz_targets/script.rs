//! `tests/tests/fuzz.rs` runs the same harness for a bounded time on the stable compiler.
#![no_main]

#[path = "../harness/script.rs"]
mod harness;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| drop(harness::script(bytes)));
