//! Recordings: everything that is sent and heard, as MCAP, and each flight in it as a flight file.
//!
//! **While it runs** the log is `NAME.mcap.part`: MCAP without chunks. A thread of its own writes each
//! message as it comes, so a killed program loses the last milliseconds at most. A disk that is full
//! or slow delays nothing but the recording: messages wait in memory, and go to the disk when it takes
//! them; after some minutes without one they are left out, which people are told and the log says. **When it ends** [`finish`] reads that log and writes `NAME.mcap` (with chunks and
//! indices, as Foxglove and PlotJuggler like it) and `NAME-1.csv`, `NAME-2.csv` ... (one flight
//! each, see [`logs::FlightCutter`]), each under a temporary name
//! first; then the part goes. A part that a crash left behind is finished in the same way: what is damaged
//! is left out, and the log's metadata `quadlab.completeness` says how much of the recording it holds.
//!
//! Messages are JSON with a JSON schema each, in SI units, the fields those of crate `proto`:
//!
//! | topic | what |
//! |---|---|
//! | `/telemetry` | from the craft, each tick |
//! | `/pose`, `/command`, `/request`, `/gains` | to the craft |
//! | `/identity`, `/last_end`, `/answer` | from the craft |
//! | `/link` | delay, skew and losses, four times a second |
//! | `/log` | what people were told (`foxglove.Log`) |
//! | `/tf`, `/track` | where the craft is, and its way in the last minute, for Foxglove's 3-D panel (`foxglove.FrameTransform`, `foxglove.PosesInFrame`) |
//!
//! Times are nanoseconds of the machine's wall clock at the start plus the ground's clock since. A
//! missing number (a pose before the first) is a field that is not there. Deliberately absent: compression
//! (`mcap compress` does it).

mod disk_writer;
mod entry;
mod error;
mod finish;
mod log;
mod nulls;
mod recorder;
mod records;
mod scene;
mod schema;

pub use entry::{Entry, Level, LinkRecord};
pub use error::RecordError;
pub use finish::{Finished, Recovered, finish, recover};
pub use recorder::{Recorder, part_of};
pub use records::Completeness;
