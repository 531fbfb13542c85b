//! Instructions of one control tick, supervisor and input checks included, after a second of
//! flight. They are the host's; on the Cortex-M4F, where the aim is under 1,500, the same tick
//! takes other ones.
#![expect(missing_docs, reason = "the macros make public items without docs")]

mod common;

use common::Flight;
use control::Mode;
use gungraun::{library_benchmark, library_benchmark_group, main};

/// A flight whose filters have forgotten the start. In a box, so that handing it back costs
/// nothing.
fn under_way(mode: Mode) -> Box<Flight> {
    let mut flight = Box::new(Flight::new(mode));
    for _ in 0..100 {
        flight.tick();
    }
    flight
}

#[library_benchmark]
#[bench::of(under_way(Mode::Attitude))]
fn attitude_mode(mut flight: Box<Flight>) -> ([f32; 4], Box<Flight>) {
    (flight.tick(), flight)
}

#[library_benchmark]
#[bench::of(under_way(Mode::Position))]
fn position_mode(mut flight: Box<Flight>) -> ([f32; 4], Box<Flight>) {
    (flight.tick(), flight)
}

library_benchmark_group!(name = tick; benchmarks = attitude_mode, position_mode);
main!(library_benchmark_groups = tick);
