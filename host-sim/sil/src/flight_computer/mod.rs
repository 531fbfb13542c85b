//! Where the autopilot runs: in this process, in another one, or on an emulated processor of the
//! craft.

mod emulated;
mod iceoryx2;
mod in_process;

pub use emulated::{Emulated, Emulation, Processor, Udp};
pub use iceoryx2::{Iceoryx2, serve};
pub use in_process::{FlightComputer, FlightComputerError, InProcess};
