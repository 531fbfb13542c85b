//! Long runs: a craft that is not switched off for hours, and more flights than anybody looks at.
//!
//! What an hour of flying does not show, ten may: memory that grows, a clock or a counter that wraps,
//! a landing in a thousand that ends otherwise. The rules of a crash are the same in both
//! (module `crash`), and neither forgives one that physics did not demand.

mod crash;
mod deviations;
mod drawn_flights;
mod error;
mod kept;
mod memory;
mod missions;
mod monte_carlo;
mod soak;
mod watched;

pub use crash::Crash;
pub use deviations::Deviations;
pub use drawn_flights::{End, MonteCarlo};
pub use error::LongRunError;
pub use kept::KeptError;
pub use memory::{Memory, MemoryError};
pub use missions::{Missions, Seen};
pub use monte_carlo::{Conditions, Survey, drawn_fault, survey};
pub use soak::{Soak, SoakReport, soak};
pub use watched::{
    Crashed, Feasibility, Impossible, Observer, Watched, fly_watched, impossible, until_crash,
};
