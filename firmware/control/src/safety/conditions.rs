//! Conditions: what the detectors can find, as one bit each, and sets of them.

/// Something that may change the state of the craft. What each one does is the table in
/// [`state_machine`](crate::safety::state_machine).
///
/// The number is the bit in [`Conditions`], in telemetry and in logs: it never changes its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Condition {
    /// The pilot asks to arm, and every preflight check is good.
    ArmRequested = 0,
    /// A command without cut-off has come.
    FlightRequested = 1,
    /// The pilot asks to disarm.
    DisarmRequested = 2,
    /// The pilot asks to land.
    LandRequested = 3,
    /// The pilot asks to stop the motors until disarmed.
    CutRequested = 4,
    /// The craft has landed.
    Landed = 5,
    /// No good command frame for a while, or good ones again, but not for long enough.
    LinkLate = 6,
    /// No good command frame for long.
    LinkLost = 7,
    /// No good pose for longer than the craft may coast.
    PoseLate = 8,
    /// No good pose for so long that the craft has to go down.
    PoseLost = 9,
    /// No good pose for so long that the craft must not fly any more.
    PoseGone = 10,
    /// Poses come, always the same one. They count as missing.
    PoseFrozen = 11,
    /// A pose came that the craft cannot have flown to. It counts as missing.
    PoseJumped = 12,
    /// No plausible sample of the gyro for some ticks.
    ImuLate = 13,
    /// The gyro repeats one sample again and again.
    ImuStuck = 14,
    /// The gyro and the motion capture contradict each other about the body rates.
    ImuDisagrees = 15,
    /// The gyro has been unusable for long, and the craft cannot do without it.
    ImuGone = 16,
    /// The voltage is under the warning level.
    BatteryLow = 17,
    /// The voltage is under the level at which to land.
    BatteryCritical = 18,
    /// The voltage is under the level at which to land at once.
    BatteryEmpty = 19,
    /// Tilted beyond the limit.
    Tilted = 20,
    /// Outside the box, or a position that is not a number.
    OutsideFence = 21,
    /// The motors are asked for more than they have while the craft is level and sinks.
    ThrustLost = 22,
    /// The clock stood still, went back or leapt.
    ClockJumped = 23,
    /// The loop was late too often or too much.
    LoopOverrun = 24,
    /// The controller had a result that is not a number.
    NotANumber = 25,
    /// The program's outputs do not take the motor commands.
    OutputsFailed = 26,
    /// The craft has been armed for long and nothing was flown.
    IdleForLong = 27,
    /// The craft is tilted away from where it wants to be and does not turn: it lies, or hangs.
    Crashed = 28,
    /// One motor is asked for all it has, and the others are not: it is lost, or weak. Which one is
    /// a preflight check.
    MotorFailed = 29,
    /// The gyro shivers: a propeller is broken, or something is loose.
    Vibrating = 30,
    /// A pose came that was taken too long ago. It counts as missing.
    PoseOld = 31,
}

impl Condition {
    /// All, in the order of their bits.
    pub const ALL: [Self; 32] = [
        Self::ArmRequested,
        Self::FlightRequested,
        Self::DisarmRequested,
        Self::LandRequested,
        Self::CutRequested,
        Self::Landed,
        Self::LinkLate,
        Self::LinkLost,
        Self::PoseLate,
        Self::PoseLost,
        Self::PoseGone,
        Self::PoseFrozen,
        Self::PoseJumped,
        Self::ImuLate,
        Self::ImuStuck,
        Self::ImuDisagrees,
        Self::ImuGone,
        Self::BatteryLow,
        Self::BatteryCritical,
        Self::BatteryEmpty,
        Self::Tilted,
        Self::OutsideFence,
        Self::ThrustLost,
        Self::ClockJumped,
        Self::LoopOverrun,
        Self::NotANumber,
        Self::OutputsFailed,
        Self::IdleForLong,
        Self::Crashed,
        Self::MotorFailed,
        Self::Vibrating,
        Self::PoseOld,
    ];

    /// The name that people read.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ArmRequested => "arm requested",
            Self::FlightRequested => "flight requested",
            Self::DisarmRequested => "disarm requested",
            Self::LandRequested => "landing requested",
            Self::CutRequested => "cut requested",
            Self::Landed => "landed",
            Self::LinkLate => "link late",
            Self::LinkLost => "link lost",
            Self::PoseLate => "pose late",
            Self::PoseLost => "pose lost",
            Self::PoseGone => "pose gone",
            Self::PoseFrozen => "pose frozen",
            Self::PoseJumped => "pose jumped",
            Self::ImuLate => "IMU late",
            Self::ImuStuck => "IMU stuck",
            Self::ImuDisagrees => "IMU and motion capture disagree",
            Self::ImuGone => "IMU gone",
            Self::BatteryLow => "battery low",
            Self::BatteryCritical => "battery critical",
            Self::BatteryEmpty => "battery empty",
            Self::Tilted => "tilted",
            Self::OutsideFence => "outside the fence",
            Self::ThrustLost => "thrust lost",
            Self::ClockJumped => "clock jumped",
            Self::LoopOverrun => "loop overrun",
            Self::NotANumber => "result not a number",
            Self::OutputsFailed => "outputs failed",
            Self::IdleForLong => "idle for long",
            Self::Crashed => "crashed",
            Self::MotorFailed => "motor failed",
            Self::Vibrating => "vibration",
            Self::PoseOld => "pose old",
        }
    }

    /// Is it a request, or the end of one? The others are faults.
    pub const fn is_asked_for(self) -> bool {
        (self as u8) <= Self::Landed as u8
    }

    /// Its bit.
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }
}

/// A set of [`Condition`]s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Conditions(u32);

impl Conditions {
    /// None.
    pub const NONE: Self = Self(0);

    /// The set with these bits; bits that mean nothing are left out.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits & (u32::MAX >> (32 - Condition::ALL.len())))
    }

    /// One bit a condition.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Is it in the set?
    pub const fn has(self, condition: Condition) -> bool {
        self.0 & condition.bit() != 0
    }

    /// Puts a condition in, if it is raised.
    #[inline]
    pub(crate) fn note(&mut self, condition: Condition, raised: bool) {
        self.0 |= u32::from(raised) << condition as u8;
    }

    /// The conditions in the set, in the order of their bits.
    pub fn iter(self) -> impl Iterator<Item = Condition> {
        Condition::ALL.into_iter().filter(move |condition| self.has(*condition))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_positions_in_the_list() {
        for (k, condition) in Condition::ALL.into_iter().enumerate() {
            assert_eq!(condition.bit(), 1 << k);
            let mut set = Conditions::NONE;
            set.note(condition, true);
            assert_eq!(set.iter().collect::<Vec<_>>(), [condition]);
        }
        assert_eq!(Conditions::from_bits(u32::MAX).iter().count(), Condition::ALL.len());
    }

    /// What is no fault is what somebody asks for, and its end.
    #[test]
    fn what_is_asked_for_is_no_fault() {
        use Condition::{
            ArmRequested, CutRequested, DisarmRequested, FlightRequested, LandRequested, Landed,
        };
        let asked_for = [ArmRequested, FlightRequested, DisarmRequested, LandRequested, CutRequested, Landed];
        for condition in Condition::ALL {
            assert_eq!(condition.is_asked_for(), asked_for.contains(&condition), "{condition:?}");
        }
    }

    #[test]
    fn each_condition_has_a_name_of_its_own() {
        let mut names: Vec<_> = Condition::ALL.iter().map(|condition| condition.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), Condition::ALL.len());
    }
}
