//! Failsafe drills: for each rule of the supervisor a flight that sets it off, and one that just
//! does not.

mod drill;
mod list;
mod table;

pub use drill::{Drill, DrillResult, ExpectedResponse};
pub use list::drills;
pub use table::table;
