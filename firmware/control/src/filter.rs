//! Filters.
use serde::{Deserialize, Serialize};

/// Where the gain of a filter with a zero at the origin is matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GainRule {
    /// As MATLAB's `c2d(..., 'matched')`: equal gain at the real frequency `s = 0.1/Ts`.
    Matlab,
    /// Equal slope at DC, so that a derivative filter measures slow rates exactly.
    Slope,
}
