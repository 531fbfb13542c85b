//! From a flight as logged to even stretches of samples that a regression can use.

mod battery;
mod biases;
mod channels;
mod columns;
pub mod conditions;
mod corrections;
mod dead_reckoning;
mod error;
mod further;
mod grid;
mod outliers;
mod prepared;
mod states;
mod stretch;

pub use biases::StandingGyro;
pub(crate) use biases::subtract_accelerometer_bias;
pub use conditions::Conditions;
pub use corrections::{Alignment, PieceOffset, Trim};
pub use error::PrepareError;
pub use outliers::Outlier;
pub use prepared::{ForceTarget, Prepared};
pub use states::{Part, States};
pub use stretch::{RotorTrack, Stretch, smoothed};
pub(crate) use stretch::{push, subtract, vector};
