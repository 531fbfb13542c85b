//! What stands in for columns that were not logged.

use crate::columns::Column;

/// A group of columns that was not logged, and what its values are instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StandIn {
    /// Angles of the logged quaternion: nothing is lost.
    AnglesOfQuaternion,
    /// Angles of gyro and accelerometer: they drift.
    AnglesOfGyro,
    /// Rates of the attitude.
    RatesOfAttitude,
    /// Rotor speeds in the place of commands.
    RotorSpeeds,
    /// A constant in the place of the voltage.
    ConstantVoltage,
    /// No position: little that depends on place or speed can be told.
    NoPosition,
    /// A height and no position.
    HeightOnly,
}

impl StandIn {
    /// The columns that are not the log's own.
    pub const fn columns(self) -> &'static [Column] {
        use Column::*;
        match self {
            Self::AnglesOfQuaternion | Self::AnglesOfGyro => &[Phi, Theta, Psi],
            Self::RatesOfAttitude => &[P, Q, R],
            Self::RotorSpeeds => &[Cmd1, Cmd2, Cmd3, Cmd4],
            Self::ConstantVoltage => &[Vbat],
            Self::NoPosition => &[X, Y, Z],
            Self::HeightOnly => &[X, Y],
        }
    }

    /// Whether it leaves little known of the speed through the air.
    pub const fn hides_speed(self) -> bool {
        matches!(self, Self::NoPosition | Self::HeightOnly)
    }

    /// What cannot be told without them, for people; nothing where nothing is lost.
    pub const fn sentence(self) -> Option<&'static str> {
        match self {
            Self::AnglesOfQuaternion => None,
            Self::AnglesOfGyro => Some(
                "no attitude: it is integrated from the gyro and held level by the accelerometer, so it is uncertain by degrees in turns, and drag fitted to it comes out low, in simulated flights by up to a third; \
                 log the attitude",
            ),
            Self::RatesOfAttitude => Some(
                "no gyro: the rates are the derivative of the attitude, which blurs fast rotation; log p, q, r",
            ),
            Self::RotorSpeeds => Some(
                "no motor commands: the rotor speeds stand in for them, so delays between command and motor cannot be seen; log cmd1 to cmd4",
            ),
            Self::ConstantVoltage => Some(
                "no battery voltage: effects of a sagging battery cannot be told apart from other slow changes; log vbat",
            ),
            Self::NoPosition => Some(
                "no position: the accelerometer gives the speed only over spans of a second, enough for drag along the body axes; wind and what depends on height, place or speed cannot be identified; log x, y, z",
            ),
            Self::HeightOnly => Some(
                "height but no horizontal position: the accelerometer gives the speed only over spans of a second, enough for drag along the body axes; wind and what depends on speed cannot be identified; log x and y",
            ),
        }
    }
}
