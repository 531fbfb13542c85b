//! Why a long run cannot be flown.

use super::kept::KeptError;
use super::memory::MemoryError;
use crate::flight::SilError;

/// Why a long run cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum LongRunError {
    /// A flight.
    #[error(transparent)]
    Flight(#[from] SilError),
    /// Its memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The file that keeps its flights.
    #[error(transparent)]
    Kept(#[from] KeptError),
}

impl From<crate::flight_computer::FlightComputerError> for LongRunError {
    fn from(error: crate::flight_computer::FlightComputerError) -> Self {
        Self::Flight(error.into())
    }
}
