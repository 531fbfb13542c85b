//! A model structure fitted to flights.

pub mod alignment;
mod assembly;
pub mod balance;
pub mod clock_offset;
pub mod closed_loop;
mod doubts;
mod error;
pub mod even_hats;
mod fitted;
pub mod gauss_newton;
pub mod gusts;
mod identification;
mod in_gust;
mod jackknife;
pub mod least_squares;
pub mod linearise;
mod load_shapes;
pub mod low_frequency;
pub mod motor_response;
mod nonlinear;
pub mod open_loop;
pub mod output_error;
mod parameters;
pub mod pieces;
mod predicted;
mod quadratic;
mod random_effects;
mod residuals;
mod rotation;
mod rotor_comparison;
pub mod rows;
pub mod segments;
mod shapes;
pub mod slow;
pub mod slung_load;
pub mod starts;
pub mod swing;
pub mod terms;
pub mod times_hats;
pub mod trim;
mod undefined;
mod unloaded;
pub mod weather;
mod wide_swings;

pub use assembly::timing;
pub use doubts::{
    SignDoubt, impossible_signs, inertia_ratios, produces_thrust, rotation_doubts, rotor_signs, sign_doubts,
    turns_too_weakly,
};
pub use error::{FitError, check_residuals};
pub use fitted::Fit;
pub use identification::{fit, fit_if};
pub use parameters::{priors_of, step_end};
pub use residuals::{Residuals, errors};
pub use rotation::{has_rotation, without_rotation};
pub use rotor_comparison::{
    AtSame, CenterOfMass, MotorThrust, RotorComparison, compare_rotors, rotors_differ,
};
pub use unloaded::Beginning;
pub use wide_swings::WideSwing;
