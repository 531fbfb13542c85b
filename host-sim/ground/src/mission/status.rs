//! What a mission knows of the craft, what it asks for, and how it goes.

use control::Conditions;
use proto::{Gains, Pose, Request, State};

/// What is known of the craft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CraftStatus {
    /// What it is doing.
    pub state: State,
    /// Where it is.
    pub pose: Pose,
    /// Which preflight checks pass, one bit each.
    pub preflight: u16,
    /// What was found in the tick in which it went into this state, one bit each.
    pub found: u32,
}

impl CraftStatus {
    /// The faults that brought the craft into its state, for people; nothing if there were none.
    pub(super) fn because(&self) -> String {
        let faults = Conditions::from_bits(self.found);
        let names: Vec<_> =
            faults.iter().filter(|fault| !fault.is_asked_for()).map(|fault| fault.name()).collect();
        if names.is_empty() { String::new() } else { format!(", because of {}", names.join(", ")) }
    }
}

/// What has to be sent beside the command until the craft has done it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask {
    /// A request, repeated until the craft is in its state.
    Request(Request),
    /// Gains, repeated until they are answered.
    Gains(Gains),
}

impl Ask {
    /// Is a craft in this state where the request would bring it?
    pub(crate) fn is_fulfilled(&self, state: State) -> bool {
        match self {
            Self::Gains(_) => false,
            Self::Request(Request::Arm) => !matches!(state, State::Disarmed | State::Cut),
            Self::Request(Request::Land) => matches!(state, State::Land | State::Disarmed | State::Cut),
            Self::Request(Request::Disarm) => state == State::Disarmed,
            Self::Request(Request::Cut) => state == State::Cut,
        }
    }
}

/// How the mission goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Progress {
    /// Steps are left.
    Going,
    /// All is done.
    Done,
    /// It failed, for this reason.
    Failed(String),
}
