//! Which loop, and how it is looked at.
//!
//! Every loop is written so that a positive output moves its variable up. Altitude takes thrust
//! away for z (down), and a positive pitch pushes along -x; both are turned round here, as they are
//! in the law.

use crate::plant::{CHANNELS, ChannelId};

/// A loop of the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LoopName {
    /// Roll angle.
    Roll,
    /// Pitch angle.
    Pitch,
    /// Yaw angle.
    Yaw,
    /// Altitude (inertial z).
    Z,
    /// Position along x, around pitch.
    X,
    /// Position along y, around roll.
    Y,
}

/// All loops, inner before outer.
pub const LOOPS: [LoopName; 6] =
    [LoopName::Roll, LoopName::Pitch, LoopName::Yaw, LoopName::Z, LoopName::X, LoopName::Y];

impl LoopName {
    /// The word for it in JSON and on pages.
    pub const fn name(self) -> &'static str {
        self.channel().name
    }

    /// The channel from the actuator to what the loop controls.
    pub const fn channel(self) -> ChannelId {
        CHANNELS[self as usize]
    }

    /// The inner loop that an outer one goes around.
    pub const fn inner(self) -> Self {
        match self {
            Self::X => Self::Pitch,
            Self::Y => Self::Roll,
            other => other,
        }
    }

    /// Whether this is a position loop around an attitude loop.
    pub const fn is_outer(self) -> bool {
        matches!(self, Self::X | Self::Y)
    }

    /// Unit of what it controls.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Roll | Self::Pitch | Self::Yaw => "rad",
            Self::Z | Self::X | Self::Y => "m",
        }
    }

    /// +1 where more of the actuator moves the controlled variable up.
    pub(super) const fn sign(self) -> f64 {
        match self {
            Self::Z | Self::X => -1.0,
            _ => 1.0,
        }
    }
}

impl std::fmt::Display for LoopName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// How the loops are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// As the thesis designs: continuous, without delay.
    Continuous,
    /// As the law flies, with a pose that is this many samples old.
    Sampled {
        /// Age of the pose, samples.
        delay_samples: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{INPUTS, STATES};

    /// The order of [`LOOPS`] is that of the channels: each loop finds its own input and output,
    /// (5.17) to (5.22).
    #[test]
    fn each_loop_has_its_own_channel() {
        let of = |name: LoopName| (name.name(), INPUTS[name.channel().input], STATES[name.channel().output]);
        let expected = [
            ("roll", "tau_phi", "phi"),
            ("pitch", "tau_theta", "theta"),
            ("yaw", "tau_psi", "psi"),
            ("z", "T_Z", "z_e"),
            ("x", "tau_theta", "x_e"),
            ("y", "tau_phi", "y_e"),
        ];
        assert_eq!(LOOPS.map(of), expected);
    }
}
