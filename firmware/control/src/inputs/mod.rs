//! What comes in with each tick, and what happens to a bad value.

pub mod checks;
