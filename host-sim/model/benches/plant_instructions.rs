//! Instructions of the thesis' plant over one control period of 0.01 s. The time is the aim (see `plant`); the count
//! shows a change of a percent, which times do not.
#![expect(missing_docs, reason = "the macros make public items without docs")]

mod common;

use common::{Formation, Motion};
use gungraun::{library_benchmark, library_benchmark_group, main};

/// In a box, so that handing it back costs nothing.
fn under_way(substeps: u32) -> Box<Motion> {
    let mut motion = Box::new(Motion::new(substeps));
    motion.step();
    motion
}

#[library_benchmark]
#[bench::of(under_way(1))]
fn one_substep(mut motion: Box<Motion>) -> Box<Motion> {
    motion.step();
    motion
}

#[library_benchmark]
#[bench::of(under_way(4))]
fn four_substeps(mut motion: Box<Motion>) -> Box<Motion> {
    motion.step();
    motion
}

/// Eight craft. Valgrind knows no vectors of eight numbers, so that these are of four.
fn formation() -> Box<Formation> {
    let mut formation = Box::new(Formation::new(4));
    formation.step();
    formation
}

#[library_benchmark]
#[bench::of(formation())]
fn eight_side_by_side(mut formation: Box<Formation>) -> Box<Formation> {
    formation.step();
    formation
}

#[library_benchmark]
#[bench::of(formation())]
fn eight_one_by_one(mut formation: Box<Formation>) -> Box<Formation> {
    formation.step_each();
    formation
}

library_benchmark_group!(name = plant; benchmarks = one_substep, four_substeps, eight_side_by_side, eight_one_by_one);
main!(library_benchmark_groups = plant);
