//! Instructions of one closed-loop step in process: ideal sensors, no delay, one Runge-Kutta step a
//! tick.
//!
//! The time is the aim (see `closed_loop`); the count shows a change of a percent, which times do
//! not.
#![expect(missing_docs, reason = "the macros make public items without docs")]

mod common;

use gungraun::{library_benchmark, library_benchmark_group, main};
use sil::{ClosedLoop, FlightComputerError, InProcess, Row};

type Loop = ClosedLoop<'static, InProcess>;

/// A flight after its first second. In a box, so that handing it back costs nothing.
fn under_way() -> Box<Loop> {
    let plan = Box::leak(Box::new(common::plan(60.0)));
    let mut flight = Box::new(ClosedLoop::in_process(plan).expect("the thesis' plan can be flown"));
    for _ in 0..100 {
        flight.step().expect("the loop is in process");
    }
    flight
}

#[library_benchmark]
#[bench::of(under_way())]
fn closed_loop_step(mut flight: Box<Loop>) -> (Result<Row, FlightComputerError>, Box<Loop>) {
    (flight.step(), flight)
}

library_benchmark_group!(name = closed_loop; benchmarks = closed_loop_step);
main!(library_benchmark_groups = closed_loop);
