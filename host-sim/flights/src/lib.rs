//! Flight files: what a log holds, in which units and frames, read and written.
#![forbid(unsafe_code)]

mod decimal;
mod flight;

pub use flight::{COLUMNS, Column, Flight, FlightError, median_step};
