//! The plant: a model that flies.

mod abreast;
mod delay_line;
mod equations;
mod stages;
mod state;

pub use abreast::{Abreast, LANES};
pub use delay_line::DelayLine;
pub use equations::{Hold, Holds, Plant, Substeps};
pub use state::State;
