//! Trim.

/// Trim of a flight.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Trim {
    /// u v w in m/s^2, p q r in rad/s^2.
    pub value: [f64; 6],
}
