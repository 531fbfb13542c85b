//! From flights to a model: preprocessing, checks, least-squares identification and comparison.
#![forbid(unsafe_code)]

pub mod checks;
pub mod compare;
pub mod filter;
pub mod fit;
pub mod prepare;
pub mod statistics;
#[cfg(test)]
mod testing;

pub use checks::{Examined, Fault, FaultKind, Parts, Severity, Taken, examine, examine_parts};
pub use compare::{Comparison, compare};
pub use fit::alignment::{align, align_to};
pub use fit::clock_offset::Reference;
pub use fit::closed_loop::{MotorsOfFlights, motors_of_flights};
pub use fit::linearise::residuals;
pub use fit::motor_response::{MotorResponse, motor_responses};
pub use fit::output_error::{RefineError, Refinement, RefinementOutcome, refine};
pub use fit::{
    AtSame, CenterOfMass, Fit, FitError, MotorThrust, Residuals, RotorComparison, SignDoubt, WideSwing,
    compare_rotors, errors, fit, has_rotation, impossible_signs, inertia_ratios, rotation_doubts,
    rotor_signs, rotors_differ, sign_doubts, turns_too_weakly, without_rotation,
};
pub use prepare::{Alignment, Conditions, ForceTarget, PrepareError, Prepared};
