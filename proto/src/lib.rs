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
//! Inside a process and over shared memory a frame is all there is. Between a law and a simulator it
//! travels as a plain packet ([`Sealer`], [`Opener`]): header with version, direction, link and
//! number; the message; a CRC. Between a craft and its ground station packets belong to a session
//! ([`CraftEnd`], [`GroundEnd`]), which no packet of another time or of another start fits. On a byte
//! stream the packet is stuffed ([`enframe`], [`Deframer`]: COBS). An IMU board's serial line is
//! stuffed the same way, with a format of its own ([`imu_frame`]).
//!
//! Versions: only [`VERSION`] is read and written; others are refused by name. Its bytes are pinned
//! in `tests/wire_v3.rs`.
//!
//! Deliberately absent: encryption (a pose is no secret), sockets, files, clocks and chance: whoever uses a
//! session says what time it is and brings random bytes.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod age;
mod craft_end;
mod frame;
mod ground_end;
pub mod imu_frame;
mod message;
mod packet;
mod peer;
mod ramp;
#[cfg(test)]
#[path = "../../firmware/control/tests/common/residues.rs"]
mod residues;
mod session;
mod stream;

pub use age::OLDEST_MS;
pub use craft_end::{CraftEnd, Heard, LISTENING_MS, Opened, Promising};
pub use frame::{Error, MAX_FRAME_LEN, MIN_VERSION, VERSION, decode, encode};
pub use ground_end::{GroundEnd, Listener, SILENT_MS};
pub use message::{
    Answer, Command, Counters, Ending, Gains, Identity, ImuSample, Input, Loop, Measurement, Message, Mode,
    Outcome, Output, Pose, Readings, Refusal, Request, State, Supervision, Telemetry, TimedPose, Timer,
};
pub use packet::{Key, MAX_PACKET_LEN, Opener, Refused, Role, Sealer, Statistics, TAG_LEN};
pub use peer::{NotAdmitted, admit};
pub use ramp::Unwrapped;
pub use stream::{Deframer, MAX_STREAM_LEN, enframe};
