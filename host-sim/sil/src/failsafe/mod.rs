//! Failsafe drills.

mod drill;

pub use drill::{Drill, Expected, Found, drills, table};
