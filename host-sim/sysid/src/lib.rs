//! From flight files to a model: reading, preprocessing, least-squares identification, comparison and diagnosis.
#![forbid(unsafe_code)]

mod about;
pub mod alignment;
mod battery;
pub mod changes;
pub mod channels_check;
pub mod clocks;
pub mod closed_loop;
pub mod command_clock;
pub mod compare;
pub mod conditions;
mod decimal;
pub mod diagnose;
pub mod faults;
pub mod filter;
pub mod fit;
pub mod flight;
pub mod frames_check;
pub mod imu_check;
pub mod information;
mod leverage;
pub mod library;
mod load_shapes;
pub mod motor_map;
pub mod motors_check;
pub mod noise;
pub mod overlap;
pub mod plausible;
pub mod prepare;
pub mod refine;
pub mod regress;
mod rows;
mod screen;
mod select;
mod spikes;
pub mod stand;
mod starts;
mod structure;
pub mod subsets;
mod swing;
mod tracks;
pub mod trim;
mod undefined;
pub mod why;

pub use about::residuals;
pub use alignment::{Alignment, Reference, align, align_to};
pub use closed_loop::{MotorsOfFlights, motors_of_flights};
pub use compare::{Comparison, compare};
pub use diagnose::{Addition, Diagnosis, Options, Verdict, add, diagnose, diagnose_with};
pub use faults::{Examined, Fault, FaultKind, Severity, examine};
pub use fit::{
    Fit, FitError, Residuals, errors, fit, has_rotation, impossible_signs, rotation_doubts, without_rotation,
};
pub use flight::{Column, Flight, FlightError};
pub use prepare::{Conditions, ForceTarget, PrepareError, Prepared};
pub use refine::{RefineError, Refinement, RefinementOutcome, refine};
pub use why::{Why, WhyError, why};
