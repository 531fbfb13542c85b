//! Flights for tests of the estimation, and what identification makes of them.
#![allow(dead_code, reason = "each test binary uses its own part")]

mod flown;
mod shared;

use model::Model;
use sysid::Prepared;

#[allow(unused_imports, reason = "each test binary uses its own part")]
pub(crate) use flown::{FED_BACK, NONE, Noise, ORDINARY, fly, truth};
#[allow(unused_imports, reason = "each test binary uses its own part")]
pub(crate) use shared::shared;

/// Flights of the seeds, prepared.
pub(crate) fn prepared(
    model: &Model,
    seeds: std::ops::Range<u64>,
    seconds: f64,
    noise: &Noise,
) -> Vec<Prepared> {
    seeds.map(|seed| Prepared::new(&fly(model, seed, seconds, noise), &model.vehicle).unwrap()).collect()
}
