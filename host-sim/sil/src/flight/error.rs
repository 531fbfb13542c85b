//! Why a flight cannot be flown.

use std::path::PathBuf;

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
    /// A model file.
    #[error(transparent)]
    Model(#[from] model::ModelError),
    /// A craft whose motors cannot be commanded.
    #[error(
        "{}: vehicle.motors: has no map from command to rotor speed; give command, voltage and offset to fly it",
        .0.display()
    )]
    NoMotorMap(PathBuf),
    /// A craft that the thesis' gains are not for.
    #[error(
        "{}: vehicle.motors.command_range: is {found:?}; the thesis' gains are for {expected:?}; give --gains",
        path.display()
    )]
    OtherCommands {
        /// The model file.
        path: PathBuf,
        /// The craft's range.
        found: [f64; 2],
        /// That of the gains.
        expected: [f64; 2],
    },
    /// A craft that cannot hover.
    #[error(transparent)]
    Hover(#[from] design::DesignError),
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
        undefined: model::user_effects::Undefined,
        /// When, s.
        time_s: f64,
    },
    /// An output file.
    #[error(transparent)]
    File(#[from] report::Error),
}
