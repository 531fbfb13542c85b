//! What keeps a flight safe: detectors raise conditions, a state machine acts on them.

pub mod conditions;
pub mod detectors;
pub mod state_machine;
