//! From a flight as logged to even stretches of samples that a regression can use.

mod battery;
pub mod conditions;
mod corrections;
mod outliers;
mod prepared;
mod states;

pub use conditions::Conditions;
pub use corrections::{Alignment, PieceOffset, Trim};
pub use prepared::{ForceTarget, PrepareError, Prepared, RotorTrack, Stretch, smoothed};
pub(crate) use prepared::{subtract, vector};
pub use states::{Part, States};
