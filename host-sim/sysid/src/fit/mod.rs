//! A model structure fitted to flights.

pub mod alignment;
pub mod closed_loop;
mod identification;
mod jackknife;
pub mod least_squares;
pub mod linearise;
pub mod output_error;
pub mod rows;
pub mod slung_load;
pub mod starts;
pub mod trim;
mod undefined;

pub use identification::*;
