//! What the tables of several programs need on their way to signals.

pub(super) mod series;
pub(super) mod surroundings;
