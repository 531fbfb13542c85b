//! Flights for tests: those of the tests of whole diagnoses, shorter.

#[path = "../tests/common/mod.rs"]
mod common;

use crate::workflow::LoadedFlight;

pub(crate) use common::{NONE, ORDINARY, fly, prepared, truth};

/// Short flights of the true model as the workflow takes them: `flight-1.csv` for seed 1.
pub(crate) fn loaded(seeds: impl IntoIterator<Item = u64>) -> Vec<LoadedFlight> {
    let load = |seed| LoadedFlight::from_flight(&fly(&truth(), seed, 4.0, &ORDINARY), &truth().vehicle);
    seeds.into_iter().map(|seed| load(seed).unwrap()).collect()
}
