//! From a model to gains that fly: equilibrium, linear model, loops, margins, responses.
//!
//! Follows A. Szabo's thesis (Wright State, 2017), chapter 5 and appendices A and B. Each folder
//! uses those before it:
//!
//! 1. [`plant`]: the equilibrium, (5.13) and (5.14); A, B, C, D about it (5.16); the transfer
//!    function of each channel, (5.17) to (5.22).
//! 2. [`loops`]: the law's loops around the channels, as the thesis designs them (continuous) and
//!    as they fly (sampled at 100 Hz with the filters of crate `control`, and with a pose that is
//!    some samples old).
//! 3. [`analysis`]: margins, responses, root loci, and the greatest tilt that the craft can hold.
//! 4. [`synthesis`]: gains from specifications, the thesis' way or searched for a late pose.
//! 5. [`check`]: all of it for a model and a gains file, over battery voltages and over what the
//!    identification leaves uncertain.
//!
//! Beside them: [`gains_match`], whether gains belong to a vehicle, and [`thesis_values`], what the
//! thesis prints beside what is found.
//!
//! Conventions: SI units, radians, rad/s; states and inputs in the order of (5.13). Inputs of the
//! linear model are thrust (N, up) and angular accelerations (rad/s^2).
//!
//! Deliberately absent: flights (crate `sysid`), the nonlinear closed loop (crate `sil`), and
//! drawing (crate `report`).
#![forbid(unsafe_code)]

pub mod analysis;
pub mod check;
mod error;
pub mod gains_match;
pub mod loops;
pub mod plant;
pub mod synthesis;
pub mod thesis_values;

pub use error::{Criterion, DesignError, Result, Shortfall, SpecField, SpecKey, SpecTable};
pub use nalgebra::Complex;

pub use gains_file::{Gains, GainsError, Provenance};
