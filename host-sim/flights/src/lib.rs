//! Flight files: what a log holds, in which units and frames, read and written.
//!
//! A flight is a table of samples at nominally 100 Hz. Columns are found by name, in any order;
//! unknown ones are left alone; an empty field is a missing value (NaN in memory). What cannot be
//! right (time going back, degrees for radians, millimetres for metres) is refused with the row,
//! the column and how to mend it.
#![forbid(unsafe_code)]

mod checks;
mod column_map;
mod columns;
mod completion;
mod decimal;
mod error;
mod flight;
mod foreign;
mod header;
mod interpolation;
mod mend;
mod names;
mod parts;
mod reading;
mod sampling;
mod stand_in;

pub use column_map::{ColumnMap, MAP_FILE, Source};
pub use columns::{COLUMNS, Column};
pub use completion::UNKNOWN_VOLTAGE_V;
pub use decimal::read as read_decimal;
pub use error::FlightError;
pub use flight::Flight;
pub use interpolation::{hermite, interpolated};
pub use mend::{CannotMend, Mend, MendedColumn};
pub use names::is_known_name;
pub use parts::{parts_file, parts_text, parts_to_use};
pub use reading::{header_names, text_columns};
pub use sampling::{GAP_PERIODS, median_step};
pub use stand_in::StandIn;
