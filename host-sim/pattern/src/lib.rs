//! What a craft is asked to fly, as a file; and what is added to its motors so that a flight is
//! informative.
//!
//! A [`Pattern`] is a table over time of what the ground station asks for: the mode, attitude or
//! position, and an injection for each motor command. The simulation flies it, the ground station
//! sends it; both read the file here.
//!
//! Three injections: the thesis' random sines ([`Excitation`], 4.2.1), orthogonal multisines with
//! small peaks ([`Multisine`]), and sweeps, one motor after the other ([`Sweep`]). All are sums of
//! numbers in command units; none knows a craft.
//!
//! Deliberately absent: who flies it. A plant is in crate `model`, a controller in crate `control`,
//! the loop in crate `sil`.
#![forbid(unsafe_code)]

mod file;
mod multisine;
pub mod random;
mod sweep;
mod thesis;

pub use file::{COLUMNS, Mode, Pattern, PatternError, Row};
pub use multisine::{Multisine, MultisineError, Sine, relative_peak_factor};
pub use sweep::{Spacing, Sweep, SweepError};
pub use thesis::Excitation;
