//! Why a model cannot be written for another tool.

use design::DesignError;

/// Why a model cannot be written for another tool.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A physical parameter that the model's effects do not give.
    #[error(
        "the model does not tell {name} ({symbol}), which the tool needs: it comes from the effects {effects}"
    )]
    Unknown {
        /// As people write it.
        symbol: &'static str,
        /// What it is.
        name: &'static str,
        /// Where it comes from.
        effects: &'static str,
    },
    /// Commands stand in for rotor speeds.
    #[error(
        "the model has commands in place of rotor speeds, and other tools ask for rad/s: measure how commands become rotor speeds \
         (quadlab motor-map) and identify again"
    )]
    NoRotorSpeeds,
    /// Moments of inertia of no rigid body.
    #[error(
        "moments of inertia of {0:?} kg m^2 are impossible: none can exceed the sum of the others. Fly so that two axes turn at \
         once and identify again"
    )]
    NoRigidBody([f64; 3]),
    /// No thrusts of its rotors hold the craft.
    #[error(
        "the rotors of this model cannot carry the craft without turning it: one would have to push down. Check the order of the \
         motors and identify again"
    )]
    NoHover,
    /// Gains that are larger than an image of them may be.
    #[error("the gains do not fit into an image for a program in C")]
    LargeGains,
    /// It cannot be linearised.
    #[error(transparent)]
    Design(#[from] DesignError),
}
