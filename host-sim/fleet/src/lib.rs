//! Fleets: any number of flights of any number of craft, read once, and asked as often as one likes.
//!
//! 1. [`Fleet::find`] looks which craft there are in a folder, and which files are theirs.
//! 2. [`pass`] reads what is new and keeps of each flight what its checks found, a few plain figures, and its normal equations
//!    ([`equations`]), in one Parquet file. A pass that is stopped goes on where it was.
//! 3. [`ask`] answers from that file: the model of each craft over time, what changed and when, what explains it ([`changes`]), craft
//!    against craft, battery against battery, faults of loggers. Other effects, other flights: another question, and no log is read.
//! 4. [`look_up_causes`] asks the logs before and after a change, once, as `quadlab diagnose --changed` does.
#![forbid(unsafe_code)]

mod answer;
mod cause;
pub mod changes;
mod compare;
mod document;
pub mod equations;
mod error;
mod events;
pub mod fit;
mod history;
mod index;
mod layout;
mod pass;
mod question;
mod read;
mod reference;
mod row;
mod scatter;
mod settings;
mod settled;
mod sides;
mod steps;
mod tables;
mod unknown;
mod when;
mod words;

pub use answer::{Answered, CraftHistory, ask, look_up_causes};
pub use cause::CauseInLogs;
pub use changes::Size;
pub use compare::{BatteryComparison, BatteryDifference, CraftComparison, CraftDifference};
pub use document::{Answer, AxisAnswer, CoefficientAnswer, CraftAnswer, FaultAnswer, Unused};
pub use error::FleetError;
pub use events::{Event, Explanation, Moment, MotorShares, Moved, OddFlight};
pub use history::{Kind, Series};
pub use index::Index;
pub use layout::{Craft, Fleet};
pub use pass::{Indexed, PassOptions};
pub use question::FlightOf;
pub use question::Question;
pub use reference::Reference;
pub use row::{LoggerFault, Row, State};
pub use scatter::{Mean, mean};
pub use settled::pass;
pub use steps::SIGNIFICANCE;
pub use tables::tables;
pub use when::{When, WhenFrom, day_and_time, of_text};
