//! What gains are designed for: the equilibrium of a model, thesis (5.13) and (5.14), the linear
//! model about it, (5.15) and (5.16), its channels, (5.17) to (5.22), and linear systems in
//! general.

mod channel;
mod linear;
mod state_space;
mod trim;

pub(crate) use channel::polynomial;
pub use channel::{CANCEL_TOLERANCE, CHANNELS, Cancelled, Channel, ChannelId, MatrixA};
pub(crate) use linear::sign_matrix;
pub use linear::{Linear, MatrixB, with_perturbation};
pub use state_space::{Block, Input, Network, Output, StateSpace, Sweep};
pub(crate) use trim::Slide;
pub use trim::{
    Equilibrium, INPUT_UNITS, INPUTS, STATE_UNITS, STATES, TrimTarget, equilibrium, hover_nearby,
};
