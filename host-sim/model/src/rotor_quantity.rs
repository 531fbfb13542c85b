//! What stands for the speed of a rotor in the equations.

/// What stands for the speed of a rotor in the equations: units of everything that contains it depend on that.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RotorQuantity {
    /// Its speed in rad/s, from a motor map or as logged.
    #[default]
    Speed,
    /// Its command, where the motor map is to be identified. Its unit is called "cmd": one of the vehicle file's command
    /// units, whatever they are.
    Command,
}

impl RotorQuantity {
    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Speed => "rad/s",
            Self::Command => "cmd",
        }
    }

    /// The unit of something that is in `ordinary` with rotor speeds, and with commands in another unit where they
    /// make a difference.
    pub(crate) fn choose(self, ordinary: &'static str, in_commands: Option<&'static str>) -> &'static str {
        match self {
            Self::Speed => ordinary,
            Self::Command => in_commands.unwrap_or(ordinary),
        }
    }
}
