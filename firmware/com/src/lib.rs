//! The program of the computer on module (COM): Linux on ARM, as in the thesis (chapter 3), or any
//! other Linux.
//!
//! ```text
//! ground --UDP--> link --+                                     +--> motors (PWM through sysfs)
//! IMU --serial--> imu  --+--> craft::Craft, 100 times a second +--> link --UDP--> ground
//! battery --> battery  --+         (flight)                    +--> guardian: a sign of life
//! ```
//!
//! What flies is crate `control`, how messages become ticks is crate `craft`; here is what only
//! Linux has: a timer, ports, files, processes. The craft starts disarmed, and its motors idle
//! whichever way the program ends ([`guardian`]).
//!
//! Deliberately absent: the ground station, motion capture, any other bus than the thesis' (serial,
//! UDP, PWM).
#![forbid(unsafe_code)]

pub mod ask;
pub mod battery;
pub mod clock;
pub mod config;
pub mod error;
pub mod flight;
pub mod guardian;
pub mod imu;
pub mod jitter;
pub mod last_end;
pub mod link;
pub mod lockstep;
pub mod pwm;
pub mod realtime;
#[cfg(test)]
#[path = "../../control/tests/common/residues.rs"]
mod residues;
pub mod sockets;
pub mod watchdog;

pub use error::{Error, Result};
