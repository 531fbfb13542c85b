//! Everything that is known before the first tick: what people tune, when the supervisor steps in,
//! and what makes either impossible to fly with.

pub mod error;
pub mod gains;
pub(crate) mod range_check;
pub mod supervision_limits;
pub mod thesis;
mod validation;
