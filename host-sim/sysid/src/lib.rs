//! From flight files to a model: reading, preprocessing, least-squares identification, comparison and diagnosis.
#![forbid(unsafe_code)]

mod decimal;
pub mod filter;
pub mod flight;

pub use flight::{Column, Flight, FlightError};
