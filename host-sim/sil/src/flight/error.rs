//! Why a flight cannot be flown.

use crate::flight_computer::FlightComputerError;

/// Why a flight cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum SilError {
    /// The controller's configuration.
    #[error("controller configuration: {0}")]
    Config(#[from] control::ConfigError),
    /// A gains file.
    #[error(transparent)]
    Gains(#[from] design::GainsError),
    /// A number of the plan.
    #[error("flight plan: {field} is {value}: {expected}")]
    Plan {
        /// Which.
        field: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: &'static str,
    },
    /// Where the autopilot runs.
    #[error(transparent)]
    FlightComputer(#[from] FlightComputerError),
    /// A user's formula without a value where the craft flew to: the flight ends there.
    #[error("the simulated flight ends after {time_s:.2} s: {undefined}")]
    Undefined {
        /// Which.
        undefined: model::user_effect::Undefined,
        /// When, s.
        time_s: f64,
    },
    /// An output file.
    #[error(transparent)]
    File(#[from] report::Error),
}
