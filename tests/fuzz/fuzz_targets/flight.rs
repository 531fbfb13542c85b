//! `tests/tests/fuzz.rs` runs the same harness for a bounded time on the stable compiler.
#![no_main]

#[path = "../harness/flight.rs"]
#[allow(dead_code, reason = "each target takes one function of it")]
mod harness;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| drop(harness::flight(bytes)));
