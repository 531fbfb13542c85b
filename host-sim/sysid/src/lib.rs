//! From flight files to a model: reading, preprocessing, least-squares identification, comparison and diagnosis.
#![forbid(unsafe_code)]

pub mod alignment;
pub mod changes;
pub mod closed_loop;
pub mod compare;
pub mod conditions;
mod decimal;
pub mod diagnose;
pub mod filter;
pub mod fit;
pub mod flight;
pub mod noise;
pub mod prepare;
pub mod refine;
pub mod regress;
mod rows;
pub mod trim;

pub use alignment::{Alignment, Reference, align, align_to};
pub use closed_loop::{MotorsOfFlights, motors_of_flights};
pub use compare::{Comparison, compare};
pub use diagnose::{Addition, Diagnosis, Verdict, add, diagnose};
pub use fit::{
    Fit, FitError, Residuals, errors, fit, has_rotation, impossible_signs, residuals, rotation_doubts,
    without_rotation,
};
pub use flight::{Column, Flight, FlightError};
pub use prepare::{Conditions, ForceTarget, PrepareError, Prepared};
pub use refine::{RefineError, Refinement, RefinementOutcome, refine};
