//! What is checked of flights, of a vehicle file and of a fit: faults are found and named, not fitted away.

mod accelerometer;
pub mod accelerometer_offset;
pub mod airborne;
mod bench;
pub mod channels;
pub mod clocks;
pub mod coarse_commands;
pub mod command_clock;
pub mod derived_rates;
mod examine;
mod frame_hypotheses;
mod frame_relations;
mod frame_taps;
pub mod frames;
pub mod gyro;
pub mod imu;
pub mod interpolated;
mod leaning_attitude;
mod linear_sensor;
pub mod motors;
pub mod overlap;
pub mod rotor_response;
pub mod tracker_mount;
mod tracker_tilt;
mod tracks;
pub mod under_sampled;
pub mod vehicle;

pub use examine::{Examined, Fault, FaultKind, Parts, Severity, Taken, examine, examine_parts};
