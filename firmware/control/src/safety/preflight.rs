//! Preflight checks: what has to be good before the craft can be armed, as one bit each.

/// What has to be good before the craft can be armed; one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Preflight(u16);

impl Preflight {
    /// Good command frames come.
    pub const LINK: u16 = 1;
    /// Good poses come.
    pub const POSE: u16 = 1 << 1;
    /// Good gyro samples come and agree with the poses.
    pub const IMU: u16 = 1 << 2;
    /// The voltage is above the warning level.
    pub const BATTERY: u16 = 1 << 3;
    /// The craft stands level.
    pub const LEVEL: u16 = 1 << 4;
    /// The craft is inside the box.
    pub const INSIDE: u16 = 1 << 5;
    /// Clock and loop keep time.
    pub const TIMING: u16 = 1 << 6;
    /// The controller has no fault.
    pub const CONTROLLER: u16 = 1 << 7;
    /// The program says that its outputs work and that its own checks passed.
    pub const OUTPUTS: u16 = 1 << 8;
    /// The pilot's command is cut-off: arming alone does not take off.
    pub const IDLE: u16 = 1 << 9;
    /// No motor has failed; one each. A disarm request on the ground takes note of one that has.
    pub const MOTORS: [u16; 4] = [1 << 10, 1 << 11, 1 << 12, 1 << 13];
    /// All of them.
    pub const ALL: Self = Self((1 << 14) - 1);

    /// Each check with its name, in the order of the bits.
    pub const NAMES: [(u16, &'static str); 14] = [
        (Self::LINK, "link"),
        (Self::POSE, "pose"),
        (Self::IMU, "IMU"),
        (Self::BATTERY, "battery"),
        (Self::LEVEL, "level"),
        (Self::INSIDE, "inside the fence"),
        (Self::TIMING, "timing"),
        (Self::CONTROLLER, "controller"),
        (Self::OUTPUTS, "outputs"),
        (Self::IDLE, "idle command"),
        (Self::MOTORS[0], "motor 1"),
        (Self::MOTORS[1], "motor 2"),
        (Self::MOTORS[2], "motor 3"),
        (Self::MOTORS[3], "motor 4"),
    ];

    /// Names of the checks that are not good.
    pub fn missing(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.0 & bit == 0).map(|(_, name)| name)
    }

    /// The set with these bits.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits & Self::ALL.0)
    }

    /// One bit a check that is good.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// May the craft be armed?
    pub const fn ready(self) -> bool {
        self.0 == Self::ALL.0
    }

    /// Records the result of a check.
    pub(crate) fn note(&mut self, check: u16, good: bool) {
        if good {
            self.0 |= check;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_has_a_name() {
        let bits = Preflight::NAMES.iter().fold(0, |bits, (bit, _)| bits | bit);
        assert_eq!((bits, Preflight::ALL.missing().count()), (Preflight::ALL.bits(), 0));
        assert_eq!(Preflight::from_bits(!Preflight::IMU).missing().collect::<Vec<_>>(), ["IMU"]);
    }

    /// All rows of the arming matrix: it arms on the last one only.
    #[test]
    fn the_arming_matrix() {
        let ready: Vec<u16> = (0..1 << 14).filter(|bits| Preflight::from_bits(*bits).ready()).collect();
        assert_eq!(ready, [(1 << 14) - 1]);
    }
}
