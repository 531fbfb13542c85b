//! Recordings: everything that is sent and heard, as MCAP, and each flight in it as a flight file.

mod entry;
mod error;
mod finish;
mod flight_cutter;
mod log;
mod recorder;
mod schema;

pub use entry::{Entry, Level, LinkRecord};
pub use error::RecordError;
pub use finish::{Finished, finish};
pub use flight_cutter::{FlightCutter, IN_THE_AIR_M};
pub use log::{Logged, read_log};
pub use recorder::{Recorder, part_of};
