//! Instructions from flight file to model: reading one file, preparing and fitting five flights of 60 s at 100 Hz.
//!
//! The aims are times (see `identification`); the counts show a change of a percent, which times do not.
#![expect(missing_docs, reason = "the macros make public items without docs")]

mod common;

use flights::Flight;
use gungraun::{library_benchmark, library_benchmark_group, main};
use sysid::{Fit, Prepared};

fn text() -> String {
    common::text(&common::flight(0))
}

fn prepared() -> Vec<Prepared> {
    common::prepare(&common::flights())
}

// Inputs are handed back, so that dropping them is not counted.

#[library_benchmark]
#[bench::of(text())]
fn read_flight_file(text: String) -> (Flight, String) {
    (common::read(&text), text)
}

#[library_benchmark]
#[bench::of(common::flights())]
fn prepare_five_flights(flights: Vec<Flight>) -> (Vec<Prepared>, Vec<Flight>) {
    (common::prepare(&flights), flights)
}

#[library_benchmark]
#[bench::of(prepared())]
fn fit_five_flights(flights: Vec<Prepared>) -> (Fit, Vec<Prepared>) {
    (common::fit(&flights), flights)
}

library_benchmark_group!(
    name = identification;
    benchmarks = read_flight_file, prepare_five_flights, fit_five_flights
);
main!(library_benchmark_groups = identification);
