//! The motor test stand: logs of single motors, and the motor map, lag and dead time that they give.
#![forbid(unsafe_code)]

pub mod motor_map;
pub mod stand;
