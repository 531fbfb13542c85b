//! Where the autopilot runs: in this process, in another one, or on an emulated processor of the
//! craft.

mod emulated;
#[cfg(feature = "shared-memory")]
mod iceoryx2;
mod in_process;

pub use emulated::{Emulated, Emulation, Processor, Udp};
#[cfg(feature = "shared-memory")]
pub use iceoryx2::{Iceoryx2, serve};
pub use in_process::{FlightComputer, FlightComputerError, InProcess};
