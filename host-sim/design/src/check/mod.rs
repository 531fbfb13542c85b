//! Everything about a model and its gains in one report: `quadlab design check`.
//!
//! Margins also over what is not known for sure: the coefficients of the model and the battery
//! voltage.

mod all;
mod battery;
mod loops;
mod report;
mod uncertainty;

pub use all::check;
pub use report::{
    ActuatorMargins, BatteryLoop, BatteryReport, CheckOptions, CheckReport, DisturbanceReport, LoopReport,
    LoopSpread, MovedZero, Pair, Spread, StepReport, Uncertainty,
};
pub use uncertainty::CoefficientErrors;
