//! What comes in with each tick, and what happens to a bad value.

pub mod input_checks;
pub mod readings;
