//! Speed of the thesis' plant over one control period of 0.01 s, in 17 states. Four million closed-loop steps a second
//! leave plant and controller together 250 ns for the period in one Runge-Kutta step.

mod common;

use common::{Formation, Motion};
use divan::Bencher;

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 1000)]
fn one_substep(bencher: Bencher) {
    let mut motion = Motion::new(1);
    bencher.bench_local(|| motion.step());
}

#[divan::bench(sample_size = 1000)]
fn four_substeps(bencher: Bencher) {
    let mut motion = Motion::new(4);
    bencher.bench_local(|| motion.step());
}

/// Eight craft.
#[divan::bench(sample_size = 1000)]
fn eight_side_by_side(bencher: Bencher) {
    let mut formation = Formation::new(4);
    bencher.bench_local(|| formation.step());
}

#[divan::bench(sample_size = 1000)]
fn eight_one_by_one(bencher: Bencher) {
    let mut formation = Formation::new(4);
    bencher.bench_local(|| formation.step_each());
}
