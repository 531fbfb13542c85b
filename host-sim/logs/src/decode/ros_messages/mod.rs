//! ROS messages, 1 and 2: their definitions as text, and serialised messages into the columns of a
//! table.
//!
//! Field names are joined with dots, elements of arrays counted: `pose.position.x`, `data[0]`. Times
//! and durations are one column in ns. Text is left out. Of arrays the first 64 elements become
//! columns; those of arrays without a fixed length are there from the message on that first has them,
//! NaN where a message is shorter.

mod builtin;
mod definition;
mod reader;
mod serialised;
mod topics;

pub(super) use definition::Dialect;
#[cfg(feature = "all-formats")]
pub(super) use definition::full_type_name;
pub(super) use topics::{Encoding, Topics};
