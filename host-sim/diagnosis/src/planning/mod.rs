//! What a flight will tell before it is flown.

pub mod information;
pub mod library;
