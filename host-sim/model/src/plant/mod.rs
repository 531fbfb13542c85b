//! The plant: a model that flies.

mod delay_line;
mod equations;
mod state;

pub use delay_line::DelayLine;
pub use equations::{Plant, Substeps};
pub use state::State;
