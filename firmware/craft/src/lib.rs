//! What all programs of a craft share: messages in, one tick of the autopilot, messages out.
//!
//! A program (the COM on Linux, the microcontroller's firmware) owns a clock, a link, sensors and
//! motors. All else is here:
//!
//! ```text
//! per packet:  end.hear(now, from, packet) -> craft.receive(&opened)
//! per tick:    craft.tick(&Inputs { time, IMU, voltage, ... }) -> &Flight; its tick.pwm goes to the motors
//!              while let Some(message) = craft.next_message(&link) { end.seal(now, session, &message); send }
//! ```
//!
//! Between two ticks the newest pose and the newest command count. Of several requests the most
//! severe counts, in the supervisor's order (disarm, cut, land, arm): a cut is not undone by the
//! arming behind it. Every request is answered, with the number of its packet.
//!
//! [`Lockstep`] is the other way to be ticked, by a simulator that waits for each answer:
//! [`proto::Readings`] in, [`proto::Outcome`] out. It is a type of its own, so that no message can
//! put a flying craft into it. [`digest`] folds every bit of a tick into a number, to compare
//! targets with.
//!
//! Pure and total: no clock, no input or output, no allocation, no panic. Deliberately absent:
//! keys and sessions (they belong to the link: [`proto::CraftEnd`]), and who may talk at all
//! ([`proto::admit`]).
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod convert;
mod craft;
mod digest;
mod ground_clock;
pub mod image;
mod lockstep;
#[cfg(test)]
#[path = "../../control/tests/common/residues.rs"]
mod residues;

pub use craft::{Craft, Inputs, LinkStatus, Setup};
pub use digest::digest;
pub use lockstep::{Lockstep, RECORDING_MAGIC};
