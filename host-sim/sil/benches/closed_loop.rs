//! Speed of the loop in process: ideal sensors, no delay, one Runge-Kutta step a tick.
//!
//! The aim is four million steps a second on one core: 250 ns a step, 15 ms for the flight of
//! 60,000.

mod common;

use divan::{Bencher, black_box, counter::ItemsCount};
use sil::{ClosedLoop, fly};

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 1000)]
fn closed_loop_step(bencher: Bencher) {
    let plan = common::plan(60.0);
    let mut flight = ClosedLoop::in_process(&plan).expect("the thesis' plan can be flown");
    bencher.bench_local(|| black_box(flight.step()));
}

/// With the recording of each step, as one flies.
#[divan::bench(sample_count = 30)]
fn flight_of_60000_ticks(bencher: Bencher) {
    let plan = common::plan(600.0);
    bencher.counter(ItemsCount::new(60_000_u32)).bench_local(|| black_box(fly(&plan)));
}
