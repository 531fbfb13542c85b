//! From a flight as logged to even stretches of samples that a regression can use.

mod battery;
pub mod conditions;
mod outliers;
mod prepared;

pub use prepared::{Conditions, ForceTarget, PrepareError, Prepared, RotorTrack, Stretch, smoothed};
pub(crate) use prepared::{subtract, vector};
