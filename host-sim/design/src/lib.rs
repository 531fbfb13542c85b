//! From a model to gains that fly: equilibrium, linear model, loops, margins, responses.
//!
//! Follows A. Szabo's thesis (Wright State, 2017), chapter 5 and appendices A and B:
//!
//! 1. [`trim`]: the equilibrium, (5.13) and (5.14).
//! 2. [`linear`]: A, B, C, D about it (5.16), and the transfer function of each channel, (5.17) to (5.22).
//! 3. [`loops`]: the law's loops around the channels, as the thesis designs them (continuous) and as they fly (sampled at
//!    100 Hz with the filters of crate `control` and the pose some samples late).
//! 4. [`margins`], [`response`]: what the loops are judged by.
//! 5. [`procedure`]: gains from specifications, the thesis' way or searched for a late pose.
//! 6. [`fit`]: whether gains belong to a vehicle.
//! 7. [`printed`]: what the thesis prints, beside what is found.
//! 8. [`envelope`]: how far the craft can lean for ever.
//! 9. [`check`]: all of it for a model and a gains file, over battery voltages and over what the identification leaves
//!    uncertain.
//!
//! Conventions: SI units, radians, rad/s; states and inputs in the order of (5.13). Inputs of the linear model are thrust
//! (N, up) and angular accelerations (rad/s^2).
//!
//! Deliberately absent: flights (crate `sysid`), the nonlinear closed loop (crate `sil`), and drawing (crate `report`).
#![forbid(unsafe_code)]

#[path = "check/report.rs"]
pub mod check;
#[path = "analysis/frequency.rs"]
pub mod curves;
#[path = "analysis/steady_tilt.rs"]
pub mod envelope;
mod error;
#[path = "gains_match.rs"]
pub mod fit;
#[path = "plant/linear.rs"]
pub mod linear;
#[path = "loops/closed_loop.rs"]
pub mod loops;
#[path = "analysis/margins.rs"]
pub mod margins;
#[path = "thesis_values.rs"]
pub mod printed;
#[path = "synthesis/procedure.rs"]
pub mod procedure;
#[path = "analysis/response.rs"]
pub mod response;
#[path = "synthesis/search.rs"]
mod search;
#[path = "synthesis/specs.rs"]
pub mod specs;
#[path = "plant/state_space.rs"]
pub mod state_space;
#[path = "plant/trim.rs"]
pub mod trim;

pub use error::{DesignError, Result};
pub use nalgebra::Complex;

pub use gains_file::{Gains, GainsError, Provenance};
