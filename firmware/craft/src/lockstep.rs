//! An autopilot that a simulator ticks and waits for.

use control::{Autopilot, Config, ConfigError, Flight};
use proto::Message;

use crate::convert;

/// An autopilot in the air, driven by [`proto::Readings`].
#[derive(Debug, Clone)]
pub struct Lockstep {
    autopilot: Autopilot,
}

impl Lockstep {
    /// A fresh autopilot of a craft in the air ([`Autopilot::in_flight`]).
    ///
    /// # Errors
    /// The first parameter that cannot be flown with, by name.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        Ok(Self { autopilot: Autopilot::in_flight(config)? })
    }

    /// One tick: the answer to readings. Anything else has none.
    #[inline]
    pub fn answer(&mut self, message: &Message) -> Option<proto::Outcome> {
        let Message::Readings(asked) = message else { return None };
        Some(convert::outcome(asked.tick, self.autopilot.tick(&convert::readings(asked))))
    }

    /// All of the last tick.
    pub fn flight(&self) -> &Flight {
        self.autopilot.flight()
    }
}
