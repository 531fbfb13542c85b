//! Flights for tests: those of the tests of whole diagnoses, shorter.

#[path = "../tests/common/flown.rs"]
mod flown;

use model::Model;
use sysid::Prepared;

use crate::workflow::LoadedFlight;

pub(crate) use flown::{NONE, Noise, ORDINARY, fly, truth};

/// Flights of the seeds, prepared.
pub(crate) fn prepared(
    model: &Model,
    seeds: std::ops::Range<u64>,
    seconds: f64,
    noise: &Noise,
) -> Vec<Prepared> {
    seeds.map(|seed| Prepared::new(&fly(model, seed, seconds, noise), &model.vehicle).unwrap()).collect()
}

/// Short flights of the true model as the workflow takes them: `flight-1.csv` for seed 1.
pub(crate) fn loaded(seeds: impl IntoIterator<Item = u64>) -> Vec<LoadedFlight> {
    let load = |seed| LoadedFlight::from_flight(&fly(&truth(), seed, 4.0, &ORDINARY), &truth().vehicle);
    seeds.into_iter().map(|seed| load(seed).unwrap()).collect()
}
