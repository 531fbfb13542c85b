//! Constant winds of the flights' own, put aside while the flights are in others.

use nalgebra::Vector3;

use crate::finding::EffectFinding;

/// A wind of each flight, training flights first, NED m/s.
pub(crate) struct Winds(pub(crate) Vec<Vector3<f64>>);

/// An effect that the winds reveal that the flights are in.
pub(crate) struct Revealed {
    /// Its evidence against the winds that the flights have without it.
    pub(crate) finding: EffectFinding,
    /// Those.
    pub(crate) without: Winds,
}
