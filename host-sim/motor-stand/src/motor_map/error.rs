//! Why a run on the stand says nothing.

/// Why a run says nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotorMapError {
    /// Too little in common.
    #[error(
        "the two logs do not overlap enough: {craft_s:.1} s and {rotor_s:.1} s without gaps; at least {needed_s} s of both are needed"
    )]
    TooShort {
        /// Length of the craft's log, s.
        craft_s: f64,
        /// Length of the tachometer's, s.
        rotor_s: f64,
        /// Needed, s.
        needed_s: f64,
    },
    /// No offset at which the logs look alike.
    #[error(
        "no overlap of the clocks: wherever the logs are laid side by side, commands and voltage explain at most {percent:.0} % of the rotor's speed; are both of the same run and motor?"
    )]
    NoOverlap {
        /// Part explained at best, percent.
        percent: f64,
    },
    /// Several offsets at which they do.
    #[error(
        "the clocks' offset is ambiguous: {first_s:.2} s and {second_s:.2} s fit alike because the commands repeat themselves; add a part that does not (a pause, a sine of another frequency)"
    )]
    Ambiguous {
        /// One offset, s.
        first_s: f64,
        /// The other, s.
        second_s: f64,
    },
    /// The voltage hardly moved, or by little more than its noise.
    #[error(
        "voltage coefficient not excited: vbat goes from {low_v:.2} to {high_v:.2} V, {why}; run the battery down from full to empty, or leave the voltage out with --without-voltage"
    )]
    VoltageNotExcited {
        /// Smallest, V.
        low_v: f64,
        /// Largest, V.
        high_v: f64,
        /// Why that is not enough.
        why: String,
    },
    /// The voltage does not help to predict the speed.
    #[error(
        "the data do not support a voltage coefficient ({value:.1} +- {error:.1} rad/s/V): with it, other parts of the run are predicted no better than by chance, or by less than matters; run the battery down from full to empty, or leave the voltage out with --without-voltage"
    )]
    VoltageNotSupported {
        /// What a fit makes of it, rad/s/V.
        value: f64,
        /// Its standard error, rad/s/V.
        error: f64,
    },
    /// The commands do not determine something.
    #[error(
        "the commands do not determine {what}: drive the motor by a saw-tooth and by sines up to several hertz"
    )]
    NotExcited {
        /// What.
        what: String,
    },
    /// A falling map.
    #[error(
        "the rotor turns slower for larger commands ({command:.3} rad/s per unit): are command and rotor of the same motor?"
    )]
    Falling {
        /// rad/s per command unit.
        command: f64,
    },
}
