//! Flight control of a quadcopter: all that flies.
//!
//! An [`Autopilot`] is built from a [`Config`] and then ticked at a fixed rate: [`Autopilot::tick`]
//! takes [`Readings`], whatever has come since the tick before, and returns motor commands together
//! with everything that led to them. It is a supervisor (detectors, conditions, a state machine) in
//! front of the [`Controller`], the control law of A. Szabo's thesis (Wright State, 2017), chapters
//! 4.2.2 and 5, with its misprints resolved.
//!
//! Folders are levels, each using only those above it:
//!
//! | folder | what is in it |
//! |---|---|
//! | `dsp/` | filters and trigonometry in f32 |
//! | `config/` | what people tune: gains and supervision limits, and their checks |
//! | `allocation/` | from thrust and torques to motor commands: mixer, desaturation, motor map |
//! | `inputs/` | what comes in, and what happens to a bad value |
//! | `law/` | estimators, loops, the controller |
//! | `safety/` | the supervisor: detectors, conditions, state machine, preflight checks |
//! | `autopilot.rs` | all of it, ticked together |
//!
//! Conventions: SI units; inertial frame north-east-down, body frame front-right-down; Euler angles
//! Z-Y-X in radians. Rotors, seen from above: 1 front-left, 2 front-right, 3 rear-right, 4
//! rear-left; 1 and 3 turn counter-clockwise. "Command unit" is the vehicle's unit of motor
//! commands, microseconds of PWM for the thesis' craft.
//!
//! Each law is three types: what people tune (physical and rate-free, in [`gains`]), the immutable
//! law built for one sample time, and a small `Copy` state. No allocation, no clock, no input or
//! output, no panic; f32 in flight, the same bits on every target (libm or [`trig`] for
//! transcendental functions, no fused multiply-add).

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

mod allocation;
pub mod autopilot;
#[cfg(test)]
#[path = "../tests/common/cases.rs"]
mod cases;
mod config;
mod dsp;
mod inputs;
mod law;
#[cfg(test)]
#[path = "../tests/common/residues.rs"]
mod residues;
mod safety;
mod whereabouts;

pub use allocation::{desaturation, mixer, motor_map};
pub use config::{error, gains, supervision_limits, thesis};
pub use dsp::{canceller, filter, prefilter, trig};
pub use inputs::{input_checks, readings};
pub use law::{altitude, attitude, controller, estimator, pid, position, terms};
pub use safety::detectors::Counters;
pub use safety::{conditions, preflight, state_machine};

pub use autopilot::{Autopilot, Flight};
pub use conditions::{Condition, Conditions};
pub use controller::Controller;
pub use error::ConfigError;
pub use gains::Config;
pub use input_checks::{Fault, Faults};
pub use mixer::{Directions, Refused};
pub use pid::PidTerms;
pub use preflight::Preflight;
pub use readings::{Command, Measurement, Mode, Pose, Readings, Request};
pub use state_machine::State;
pub use supervision_limits::Supervision;
pub use terms::{OuterTerms, Terms, Tick};
