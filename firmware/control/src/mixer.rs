//! Mixing.

/// Directions in which an axis could not be followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Directions {
    /// More was asked for than there is.
    pub high: bool,
    /// Less was asked for than there is.
    pub low: bool,
}

/// What the motors refused, per axis and direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Refused {
    /// Thrust (upwards positive).
    pub thrust: Directions,
    /// Roll torque.
    pub roll: Directions,
    /// Pitch torque.
    pub pitch: Directions,
    /// Yaw torque.
    pub yaw: Directions,
}
