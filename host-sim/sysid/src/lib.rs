//! From flight files to a model: reading, preprocessing, least-squares identification, comparison and diagnosis.
#![forbid(unsafe_code)]

pub mod changes;
pub mod compare;
pub mod conditions;
mod decimal;
pub mod diagnose;
pub mod filter;
pub mod fit;
pub mod flight;
pub mod noise;
pub mod prepare;
pub mod regress;
mod rows;
mod screen;
mod select;
pub mod subsets;
pub mod why;

pub use compare::{Comparison, compare};
pub use diagnose::{Addition, Diagnosis, Options, Verdict, add, diagnose, diagnose_with};
pub use fit::{Fit, FitError, Residuals, errors, fit, impossible_signs, residuals};
pub use flight::{Column, Flight, FlightError};
pub use prepare::{Conditions, ForceTarget, PrepareError, Prepared};
pub use why::{Why, WhyError, why};
