//! Why a flight cannot be used.

/// Why a flight cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// Too short.
    #[error(
        "has {samples} samples over {duration_s:.2} s; at least {needed_s:.2} s without gaps or missing values are needed"
    )]
    TooShort {
        /// Samples in the file.
        samples: usize,
        /// First to last time, s.
        duration_s: f64,
        /// Length without gaps that is needed, s.
        needed_s: f64,
    },
    /// Neither rotor speeds nor a map.
    #[error(
        "has no rotor speeds (omega1..4) and the vehicle file has no motor map; give [motors] command, voltage and offset, or map = \"identify\""
    )]
    NoRotorSpeeds,
    /// A user's formula has no value anywhere for long enough.
    #[error("has nothing left to use: {reason} nearly everywhere")]
    Undefined {
        /// Which formula.
        reason: String,
    },
}
