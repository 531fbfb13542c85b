//! Messages between the controller, the ground and whatever simulates the craft, defined once.
//!
//! A frame is one byte, the protocol [`VERSION`], and then the [`Message`] in postcard encoding:
//! integers as variable length, f32 as four bytes little endian, options and variants with a
//! leading tag. Equal values give equal bytes on every machine, and floating-point numbers arrive
//! bit for bit.
//!
//! Units and frames are those of the project: SI, inertial frame north-east-down, body frame
//! front-right-down, Euler angles Z-Y-X in radians, motor commands in the vehicle's own unit.
//!
//! Inside a process and over shared memory a frame is all there is. Over a network or a wire it
//! travels as a packet ([`Sealer`], [`Opener`]): header with version, direction, link and a number
//! that never comes twice; the message; with a [`Key`] an HMAC-SHA-256 tag; a CRC. On a byte stream
//! the packet is stuffed ([`enframe`], [`Deframer`]: COBS). An IMU board's serial line is stuffed
//! the same way, with a format of its own ([`imu_frame`]).
//!
//! Versions: [`MIN_VERSION`] to [`VERSION`] are read, [`VERSION`] is written. Version 1 had `Input`
//! and `Output` only, and no packets. The bytes of each version are pinned in `tests/wire_v1.rs`
//! and `tests/wire_v2.rs`.
//!
//! Deliberately absent: encryption (a pose is no secret), sockets, files and clocks.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod counter;
mod frame;
pub mod imu_frame;
mod message;
mod packet;
mod peer;
mod ramp;
mod stream;

pub use counter::{CounterStore, LEAP, RESERVE, ReplayGuard, SendCounter};
pub use frame::{Error, MAX_FRAME_LEN, MIN_VERSION, VERSION, decode, encode};
pub use message::{
    Answer, Command, Counters, Gains, Identity, ImuSample, Input, Loop, Measurement, Message, Mode, Outcome,
    Output, Pose, Readings, Refusal, Request, State, Supervision, Telemetry, TimedPose, Timer,
};
pub use packet::{Key, MAX_PACKET_LEN, Opener, Refused, Role, Sealer, Statistics, TAG_LEN};
pub use peer::{NotAdmitted, admit};
pub use ramp::Unwrapped;
pub use stream::{Deframer, MAX_STREAM_LEN, enframe};
