//! What runs the autopilot and answers ticks, and the one in this process.

use control::{Autopilot, Config, Readings};
use craft::convert;

/// What can go wrong between the flight computer and the plant.
#[derive(Debug, thiserror::Error)]
pub enum FlightComputerError {
    /// The controller's configuration.
    #[error("controller configuration: {0}")]
    Config(#[from] control::ConfigError),
    /// The controller's process could not be started.
    #[error("cannot start the controller's process {program}: {reason}")]
    Start {
        /// The program.
        program: String,
        /// What the system said.
        reason: std::io::Error,
    },
    /// The configuration did not get from one process to the other.
    #[error("cannot hand the configuration to the controller's process: {reason}")]
    Configure {
        /// What the system said.
        reason: std::io::Error,
    },
    /// The other process is gone.
    #[error(
        "the controller's process ended in the middle of a flight ({status}); run again with --transport inproc to see whether the controller itself fails"
    )]
    PeerGone {
        /// How it ended.
        status: String,
    },
    /// The other process does not answer.
    #[error("the controller's process has not answered for {seconds} s; is the machine overloaded?")]
    Silent {
        /// How long.
        seconds: u64,
    },
    /// The other process answered something else.
    #[error("the controller's process answered tick {expected} with {found}")]
    WrongAnswer {
        /// The tick asked about.
        expected: u32,
        /// What came.
        found: String,
    },
    /// A message that cannot be read.
    #[error("between the processes: {0}")]
    Message(#[from] proto::Error),
    /// The middleware refused something.
    #[error("iceoryx2 cannot {what}: {reason}; is /dev/shm writable and not full?")]
    Middleware {
        /// What was tried.
        what: &'static str,
        /// What it said.
        reason: String,
    },
    /// Ctrl-C or a request to end.
    #[error("interrupted")]
    Interrupted,
}

/// Whatever runs the autopilot and answers ticks.
pub trait FlightComputer {
    /// One tick of the autopilot.
    ///
    /// # Errors
    /// What goes wrong between the processes; nothing in this one.
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, FlightComputerError>;
}

impl<L: FlightComputer + ?Sized> FlightComputer for &mut L {
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, FlightComputerError> {
        (**self).tick(tick, readings)
    }
}

impl<L: FlightComputer + ?Sized> FlightComputer for Box<L> {
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, FlightComputerError> {
        (**self).tick(tick, readings)
    }
}

/// The autopilot in the same process.
#[derive(Debug, Clone)]
pub struct InProcess {
    autopilot: Autopilot,
}

impl InProcess {
    /// A fresh autopilot of a craft in the air.
    ///
    /// # Errors
    /// The first parameter that cannot be flown with, by name.
    pub fn new(config: &Config) -> Result<Self, control::ConfigError> {
        Ok(Self { autopilot: Autopilot::in_flight(config)? })
    }

    /// A fresh autopilot of a craft that was just switched on.
    ///
    /// # Errors
    /// As [`InProcess::new`].
    pub fn disarmed(config: &Config) -> Result<Self, control::ConfigError> {
        Ok(Self { autopilot: Autopilot::new(config)? })
    }

    /// The motor, 0 to 3, that failed first.
    pub(crate) fn failed_motor(&self) -> Option<u8> {
        self.autopilot.failed_motor()
    }
}

impl FlightComputer for InProcess {
    // An answer that is used part by part where it is made need not be copied there as a whole.
    #[inline(always)]
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, FlightComputerError> {
        Ok(convert::outcome(tick, self.autopilot.tick(readings)))
    }
}
