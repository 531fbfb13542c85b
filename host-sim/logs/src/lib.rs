//! Logs of other programs and quadlab's own recordings: decoded, put into quadlab's frames and units, and cut into flights.
//!
//! Three steps, each of which can be looked at by itself:
//! - `decode`: the file's own tables, names and times, nothing interpreted ([`Log`]);
//! - `sources`: which table is the position, the attitude, the commands; north-east-down, front-right-down, SI ([`Recording`]);
//! - `conversion`: airborne parts on one time grid ([`flights::Flight`]).
//!
//! quadlab's own recordings hold flights already, in its frames and units: they are cut, and nothing else ([`FlightCutter`]).
//!
//! A damaged log gives what stands before and after the damage. Nothing here panics on what a file holds.
#![forbid(unsafe_code)]

mod clocks;
mod conversion;
mod decode;
mod error;
mod format;
mod import;
mod log;
mod progress;
mod recording;
mod sources;
mod spans;
mod statistics;
mod tables;
mod vehicle;

pub use clocks::ClockPair;
pub use conversion::{Cause, Cut, Part, convert};
pub use decode::{LEFT_OUT, decode, telemetry_from_json};
pub use error::LogError;
pub use format::Format;
pub use import::{
    Import, Messages, STANDARD_INPUT, Sources, format_of, import, import_bytes, import_watched,
    read_standard_input,
};
pub use log::{Column, Log, Losses, ParameterChange, Table, TimeUnit, Values};
pub use progress::{Progress, Watch};
pub use recording::{Hints, Recording, Signal, Signals, Span};
pub use sources::{FlightCutter, OwnFlight, record};
pub use vehicle::{Draft, draft, how_to_measure};
