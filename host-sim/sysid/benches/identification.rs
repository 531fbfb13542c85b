//! The hot paths from flight file to model: reading, preprocessing and regression of five 60 s flights at 100 Hz.
//!
//! The aims: a gigabyte a second read; five flights identified, preprocessing and regression, in 6 ms on one core.

mod common;

use divan::counter::BytesCount;
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

#[divan::bench]
fn read_flight_file(bencher: Bencher) {
    let text = common::text(&common::flight(0));
    bencher.counter(BytesCount::of_str(&text)).bench(|| common::read(black_box(&text)));
}

#[divan::bench]
fn prepare_five_flights(bencher: Bencher) {
    let flights = common::flights();
    bencher.bench(|| common::prepare(black_box(&flights)));
}

#[divan::bench]
fn fit_five_flights(bencher: Bencher) {
    let prepared = common::prepare(&common::flights());
    bencher.bench(|| common::fit(black_box(&prepared)));
}

/// Identification after reading, as the aim is stated: preprocessing and regression together.
#[divan::bench]
fn identify_five_flights(bencher: Bencher) {
    let flights = common::flights();
    bencher.bench(|| common::fit(&common::prepare(black_box(&flights))));
}
