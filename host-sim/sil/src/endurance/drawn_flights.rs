//! Which flights a survey flies, and how one of them can end.

use control::Config;

use super::crash::Crash;

/// The last of a flight's state, for comparing runs bit by bit.
pub(super) type Last = [u8; 16];

/// How many flights, and the first one's seed; the others count on from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonteCarlo {
    /// What flies.
    pub config: Config,
    /// Flights.
    pub flights: u64,
    /// Seed of the first.
    pub seed: u64,
    /// Age of the poses, samples; drawn for each flight where there is none.
    pub delay_samples: Option<usize>,
}

/// How a flight ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// In the pilot's hands.
    Flying,
    /// Held or landing in the supervisor's hands, or down and disarmed.
    Supervised,
    /// As physics demanded, for this reason.
    Impossible(String),
    /// In a crash, after so many s.
    Crashed(Crash, f64),
}
