//! When no known effect fits: what the unknown one looks like.
//!
//! What a model leaves of the training flights is projected on what the model's own coefficients cannot take, and made white
//! (`problem.rs`, `whitening.rs`). A form is a way to act (`channels.rs`), perhaps about a center (`center.rs`), times one or two shapes
//! (`shapes.rs`) of measured quantities (`variables.rs`, `chosen.rs`, `meaning.rs`). All of them are tried at once (`search.rs`) over hats
//! (`hats.rs`), against the residual (`against.rs`); the same search on residuals of random phases says what chance finds (`phases.rs`).
//! The best are fitted exactly (`refine.rs`), and the simplest of those that are worth about the same on flights left out is chosen
//! (`choice.rs`). For how long it remembers, and whether by one lag or two, is searched last (`memory.rs`). It becomes an effect of users
//! (`define.rs`) and a sentence (`words.rs`).

mod against;
pub(crate) mod candidates;
mod center;
mod channels;
pub(crate) mod choice;
pub(crate) mod chosen;
pub(crate) mod define;
pub(crate) mod form;
mod hats;
mod meaning;
pub(crate) mod memory;
mod phases;
pub(crate) mod problem;
mod products;
mod proposal;
pub(crate) mod refine;
mod search;
mod shapes;
pub(crate) mod variables;
mod whitening;
pub(crate) mod words;

pub use proposal::{Discovery, DiscoveryVerdict, FlightFall, FormNumber, Proposal};
