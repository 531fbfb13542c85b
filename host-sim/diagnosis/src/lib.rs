//! Which physical effect does a model lack, or what has changed since it was good? With the evidence, and what to fly next.
#![forbid(unsafe_code)]

pub mod changes;
pub mod diagnose;
pub mod evidence;
pub mod noise;
pub mod planning;
mod residual_tests;
mod screen;
mod search;
pub mod subsets;
pub mod workflow;

pub use diagnose::{Addition, Diagnosis, Options, Verdict, add, diagnose, diagnose_with};
pub use evidence::{Why, WhyError, why};
