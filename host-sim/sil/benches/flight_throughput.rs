//! Closed-loop steps in a second of processor time: one recorded flight of 60,000 ticks, in a fresh
//! process.
//!
//! The aim is four million. `cargo xtask bench` runs it several times and takes the median; with
//! `--against` it does so in turn with a reference written in C.

mod common;

use cpu_time::ProcessTime;

fn main() {
    let plan = common::plan(600.0);
    let start = ProcessTime::now();
    let recording = sil::fly(&plan).expect("the thesis' plan can be flown");
    let cpu_s = start.elapsed().as_secs_f64();
    let steps = recording.rows.len() - 1;
    assert!(recording.complete && steps == 60_000, "the flight ended after {steps} steps");
    println!(r#"{{"work":"closed-loop steps","amount":{steps},"cpu_s":{cpu_s}}}"#);
}
