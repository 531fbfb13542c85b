//! Why an analysis or a design cannot be made.

use std::path::PathBuf;

use crate::procedure::Shortfall;

/// Why an analysis or a design cannot be made: one clear line each.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// The model lacks an effect that a channel needs.
    #[error(
        "the model has no \"{effect}\", which the {channel} channel needs; identify the craft again or add the effect"
    )]
    MissingEffect {
        /// The effect's identifier.
        effect: &'static str,
        /// The channel.
        channel: &'static str,
    },
    /// The model has states beyond the twelve of (5.13).
    #[error(
        "the model has the effect \"{effect}\", whose swing the linear model of (5.13) does not hold: leave the load at home, or give it as mass-change"
    )]
    Swinging {
        /// The effect's identifier.
        effect: &'static str,
    },
    /// The optimiser found nothing near enough to rest.
    #[error("no equilibrium: the cost J of (5.13) stays at {cost:.3e}, mostly in {worst}; {hint}")]
    NoEquilibrium {
        /// The least cost reached.
        cost: f64,
        /// The derivative with the largest rest.
        worst: &'static str,
        /// What may be wrong.
        hint: &'static str,
    },
    /// The optimiser gave up.
    #[error("the search for an equilibrium failed: {0}")]
    Optimiser(String),
    /// An input does not move what it should.
    #[error("the {channel} channel cannot be controlled: {input} does not move {output} in this model")]
    Uncontrollable {
        /// The channel.
        channel: &'static str,
        /// Its input.
        input: &'static str,
        /// Its output.
        output: &'static str,
    },
    /// A loop cannot be built around a channel.
    #[error("the {channel} channel is not of a form that its loop can be closed around: {reason}")]
    Channel {
        /// The channel.
        channel: &'static str,
        /// Why.
        reason: String,
    },
    /// No gain meets a specification: the design ran and came to nothing.
    #[error("{}: {}: wanted {}, reached {} at best", .0.name, .0.what, .0.wanted, .0.reached)]
    Unmet(Shortfall),
    /// An eigenvalue iteration or a matrix inverse failed.
    #[error("numerical failure in {0}: the model's coefficients are far from those of any craft")]
    Numerics(&'static str),
    /// A specifications file cannot be read.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is not what it should be.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong, on one line.
        message: String,
    },
    /// A gains file.
    #[error(transparent)]
    Gains(#[from] gains_file::GainsError),
}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, DesignError>;
