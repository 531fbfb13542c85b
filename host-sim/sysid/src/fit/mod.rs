//! A model structure fitted to flights.

pub mod alignment;
mod assembly;
pub mod closed_loop;
mod doubts;
mod error;
mod identification;
mod jackknife;
pub mod least_squares;
pub mod linearise;
mod load_shapes;
pub mod open_loop;
pub mod output_error;
mod parameters;
pub mod pieces;
mod predicted;
mod quadratic;
mod residuals;
mod rotation;
pub mod rows;
mod shapes;
pub mod slung_load;
pub mod starts;
pub mod swing;
pub mod trim;
mod undefined;
mod unloaded;

pub use doubts::{impossible_signs, produces_thrust, rotation_doubts};
pub use error::{FitError, check_residuals};
pub use identification::{Fit, fit, fit_if};
pub use parameters::{priors_of, step_end};
pub use residuals::{Residuals, errors};
pub use rotation::{has_rotation, without_rotation};
pub use unloaded::Beginning;
