//! The craft on a bare Cortex-M4F: the same flight law as on every other target, a wire to the
//! ground, four motors.
//!
//! - [`Program`] is all that is not hardware: packets in, a tick when it is due, motors, packets
//!   out. It runs, and is tested, on any machine.
//! - [`Board`] is all that is: link, clock, sensors, motors, watchdog. There are two, each for its
//!   own build: QEMU's `mps2` (for tests and simulation: a [`simulator`] is its motors and sensors) and, with the
//!   feature of that name, `stm32f405`.
//! - [`reset`]: why the chip was started, which the ground is told.
//! - [`esc`], [`battery`], [`imu`], [`ring`]: drivers over embedded-hal and embedded-io traits.
//!
//! A chip has no files: gains and vehicle are built in ([`GAINS_IMAGE`], see `build.rs`), and the
//! identity contains their SHA-256. It boots disarmed with motors at idle. If it ever panics, the
//! motors go to idle and the watchdog restarts it, disarmed.
//!
//! The link has a key if one was built in ([`LINK_KEY`], see `build.rs`): whoever can read the chip's
//! flash has it too. Without one, whoever holds the wire controls the craft. Telemetry that does not
//! fit into the buffer of the link is dropped, never waited for.
//!
//! Programs: `mcu` flies; `mcu-lockstep` is ticked by a simulator; `mcu-measure` counts the
//! instructions of a period; `mcu-no-panic` links only if no panic can be reached from receiving,
//! ticking and sending in a period.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(not(target_os = "none"), forbid(unsafe_code))]
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod battery;
mod board;
mod clock;
pub mod esc;
pub mod imu;
#[cfg(all(target_os = "none", not(feature = "stm32f405")))]
pub mod mps2;
mod program;
pub mod reset;
#[cfg(test)]
#[path = "../../control/tests/common/residues.rs"]
mod residues;
pub mod ring;
pub mod simulator;
#[cfg(all(target_os = "none", feature = "stm32f405"))]
pub mod stm32f405;
#[cfg(target_os = "none")]
pub mod systick;

pub use board::Board;
pub use program::{BootError, Program, VERSION};

/// Gains and vehicle as they were built in: an image of `craft::image`.
pub static GAINS_IMAGE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/gains.image"));

/// The link's key as it was built in.
pub const LINK_KEY: Option<proto::Key> = include!(concat!(env!("OUT_DIR"), "/link_key.rs"));
