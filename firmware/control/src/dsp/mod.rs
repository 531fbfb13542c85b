//! Arithmetic on signals: filters and their design, trigonometry in f32.

pub mod canceller;
pub mod filter;
pub mod prefilter;
pub(crate) mod recent;
pub mod trig;
