//! What the pilot can ask for in flight.

/// What the pilot can ask for in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the words say it")]
pub enum PilotRequest {
    Arm,
    TakeOff,
    Pattern,
    Land,
    Disarm,
    Cut,
}
