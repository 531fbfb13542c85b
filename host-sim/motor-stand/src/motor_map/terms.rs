//! The maps that are compared, by their terms. (4.10) has command, voltage and a constant.

/// Terms of a map besides the constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Terms {
    Command,
    Voltage,
    Product,
    Quadratic,
}

impl Terms {
    pub(super) const ALL: [Self; 4] = [Self::Command, Self::Voltage, Self::Product, Self::Quadratic];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::Voltage => "command, voltage",
            Self::Product => "command, voltage, command x voltage",
            Self::Quadratic => "command, voltage, command^2",
        }
    }

    /// The map it has one term more than.
    pub(super) const fn against(self) -> Option<Self> {
        match self {
            Self::Command => None,
            Self::Voltage => Some(Self::Command),
            Self::Product | Self::Quadratic => Some(Self::Voltage),
        }
    }

    pub(super) fn of(self, command: f64, volts: f64) -> Vec<f64> {
        match self {
            Self::Command => vec![command, 1.0],
            Self::Voltage => vec![command, volts, 1.0],
            Self::Product => vec![command, volts, command * volts, 1.0],
            Self::Quadratic => vec![command, volts, command * command, 1.0],
        }
    }
}
