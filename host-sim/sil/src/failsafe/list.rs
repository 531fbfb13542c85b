//! All drills, as a table.

use control::{Condition as C, Request};
use proto::State::{Armed, Cut, Disarmed, Flying, Hold, Land};

use super::drill::Cause::{
    ClockWraps, Fault, Fence, Heavier, Higher, Later, NeedsGyro, Repeated, Table, WaitsArmed,
};
use super::drill::ExpectedResponse::{
    Flies, Goes, GoesAndMayCrash, LandsOrIsCut, NamesOrIsCut, Short, Survives,
};
use super::drill::{Cause, Drill, ExpectedResponse};
use crate::craft::FaultKind as K;

/// To the end of the flight.
const ALWAYS_S: f64 = 1e6;

/// How far a craft drifts at most, m, if nothing else is said.
const NEAR_M: f64 = 1.0;

/// How far without poses, m: at up to 0.6 m/s, for 1.9 s and until poses count again.
const BLIND_M: f64 = 1.6;

/// How fast a craft may sink or climb in the 0.9 s in which it does not see its height, m/s.
const BLIND_M_S: f64 = 0.7;

const fn drill(rule: C, name: &'static str, expected: ExpectedResponse, causes: &'static [Cause]) -> Drill {
    Drill { name, rule, expected, within_m: NEAR_M, blind_m_s: f64::INFINITY, causes }
}

impl Drill {
    const fn within(self, within_m: f64) -> Self {
        Self { within_m, ..self }
    }

    const fn blind_at_most(self, blind_m_s: f64) -> Self {
        Self { blind_m_s, ..self }
    }
}

/// All drills: what sets a rule off stands before what just does not.
const DRILLS: &[Drill] = &[
    drill(
        C::LinkLate,
        "commands silent for 0.6 s, then back",
        Goes(&[(Hold, 0.51), (Flying, 1.15)]),
        &[Fault(K::LinkSilent, 0.6)],
    ),
    drill(C::LinkLate, "commands silent for 0.49 s", Flies, &[Fault(K::LinkSilent, 0.49)]),
    drill(
        C::LinkLate,
        "commands that are no numbers",
        Goes(&[(Hold, 0.51), (Land, 2.0)]),
        &[Fault(K::LinkGarbage, ALWAYS_S)],
    ),
    drill(
        C::LinkLost,
        "commands silent for good",
        Goes(&[(Hold, 0.51), (Land, 2.0), (Disarmed, 10.0)]),
        &[Fault(K::LinkSilent, ALWAYS_S)],
    ),
    drill(
        C::LinkLost,
        "commands silent for 1.88 s",
        Short(&[(Hold, 0.51), (Flying, 2.42)]),
        &[Fault(K::LinkSilent, 1.88)],
    ),
    drill(
        C::LinkLate,
        "one command frame every 0.4 s after a silence",
        Goes(&[(Hold, 0.51), (Land, 20.0)]),
        &[
            Fault(K::LinkSilent, 0.8),
            Repeated { kind: K::LinkSilent, first_s: 0.81, every_s: 0.4, times: 30, for_s: 0.39 },
            Later(4.0, K::LinkSilent, ALWAYS_S),
        ],
    ),
    drill(
        C::PoseLate,
        "poses silent for 0.06 s",
        Goes(&[(Hold, 0.1), (Flying, 0.3)]),
        &[Fault(K::PoseSilent, 0.06)],
    ),
    drill(C::PoseLate, "poses silent for 0.04 s", Flies, &[Fault(K::PoseSilent, 0.04)]),
    drill(
        C::PoseLost,
        "poses silent for 0.45 s",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Disarmed, 10.0)]),
        &[Fault(K::PoseSilent, 0.45)],
    ),
    drill(
        C::PoseLost,
        "poses silent for 0.38 s",
        Short(&[(Hold, 0.1), (Flying, 0.6)]),
        &[Fault(K::PoseSilent, 0.38)],
    ),
    drill(
        C::PoseGone,
        "poses silent for good",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        &[Fault(K::PoseSilent, ALWAYS_S)],
    )
    .within(BLIND_M),
    drill(
        C::PoseGone,
        "poses silent for 1.85 s",
        Short(&[(Hold, 0.1), (Land, 0.5), (Disarmed, 10.0)]),
        &[Fault(K::PoseSilent, 1.85)],
    )
    .within(BLIND_M),
    drill(
        C::PoseLost,
        "poses silent for 0.9 s, with a craft 0.15 kg heavier than its model",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Disarmed, 10.0)]),
        &[Heavier(0.15), Fault(K::PoseSilent, 0.9)],
    )
    .within(BLIND_M)
    .blind_at_most(BLIND_M_S),
    drill(
        C::PoseLost,
        "poses silent for 0.9 s, with a craft 0.15 kg lighter than its model",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Disarmed, 10.0)]),
        &[Heavier(-0.15), Fault(K::PoseSilent, 0.9)],
    )
    .within(BLIND_M)
    .blind_at_most(BLIND_M_S),
    drill(
        C::PoseOld,
        "poses 0.2 s late for good",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        &[Fault(K::PoseOld(200_000), ALWAYS_S)],
    )
    .within(BLIND_M),
    drill(
        C::PoseOld,
        "poses 0.14 s late for good",
        Short(&[(Hold, 0.1), (Flying, 0.5)]),
        &[Fault(K::PoseOld(140_000), ALWAYS_S)],
    ),
    drill(
        C::PoseOld,
        "poses 0.14 s late for good, with a craft 0.15 kg heavier than its model",
        Short(&[(Hold, 0.1), (Flying, 0.5)]),
        &[Heavier(0.15), Fault(K::PoseOld(140_000), ALWAYS_S)],
    ),
    drill(
        C::PoseOld,
        "poses 0.14 s late for good, with a craft 0.15 kg lighter than its model",
        Short(&[(Hold, 0.1), (Flying, 0.5)]),
        &[Heavier(-0.15), Fault(K::PoseOld(140_000), ALWAYS_S)],
    ),
    drill(
        C::BatteryCritical,
        "10.2 V for good, with poses 0.14 s late",
        Goes(&[(Hold, 0.1), (Flying, 0.5), (Land, 1.6)]),
        &[Fault(K::PoseOld(140_000), ALWAYS_S), Later(0.5, K::VoltageLower(0.9), ALWAYS_S)],
    ),
    drill(
        C::PoseFrozen,
        "the same pose for good",
        Goes(&[(Hold, 0.13), (Land, 0.5), (Cut, 2.0)]),
        &[Fault(K::PoseFrozen, ALWAYS_S)],
    )
    .within(BLIND_M),
    drill(C::PoseFrozen, "the same pose twice more", Flies, &[Fault(K::PoseFrozen, 0.02)]),
    drill(
        C::PoseJumped,
        "poses 0.6 m away for good: believed",
        Goes(&[(Hold, 0.1), (Flying, 0.3)]),
        &[Fault(K::PoseShifted([0.6, 0.0, 0.0]), ALWAYS_S)],
    ),
    drill(
        C::PoseJumped,
        "poses 0.8 m away for 0.3 s after a silence",
        Goes(&[(Hold, 0.1), (Flying, 0.8)]),
        &[Fault(K::PoseSilent, 0.12), Later(0.12, K::PoseShifted([0.0, 0.8, 0.0]), 0.3)],
    ),
    drill(
        C::PoseJumped,
        "poses 0.8 m away and back every 0.05 s: not believed",
        Goes(&[(Hold, 0.1), (Flying, 2.2)]),
        &[Repeated {
            kind: K::PoseShifted([0.8, 0.0, 0.0]),
            first_s: 0.0,
            every_s: 0.1,
            times: 20,
            for_s: 0.05,
        }],
    )
    .within(BLIND_M),
    drill(C::PoseJumped, "one pose 0.6 m away", Flies, &[Fault(K::PoseShifted([0.6, 0.0, 0.0]), 0.01)]),
    drill(
        C::PoseJumped,
        "poses 5 cm away for good",
        Flies,
        &[Fault(K::PoseShifted([0.05, 0.0, 0.0]), ALWAYS_S)],
    ),
    drill(
        C::PoseJumped,
        "heading turned by 180 degrees",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        &[Fault(K::PoseTurned(std::f32::consts::PI), ALWAYS_S)],
    )
    .within(BLIND_M),
    drill(
        C::PoseJumped,
        "two markers exchanged: turned by 90 degrees and 0.1 m off",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        &[
            Fault(K::PoseTurned(std::f32::consts::FRAC_PI_2), ALWAYS_S),
            Fault(K::PoseShifted([0.1, 0.0, 0.0]), ALWAYS_S),
        ],
    )
    .within(BLIND_M),
    drill(C::PoseJumped, "heading turned by 5 degrees", Flies, &[Fault(K::PoseTurned(0.087), ALWAYS_S)]),
    drill(
        C::OutsideFence,
        "positions that are no numbers",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        &[Fault(K::PoseNotANumber, ALWAYS_S)],
    )
    .within(BLIND_M),
    drill(
        C::OutsideFence,
        "positions that are no numbers for 0.04 s",
        Flies,
        &[Fault(K::PoseNotANumber, 0.04)],
    ),
    drill(
        C::OutsideFence,
        "a box that ends 0.1 m off for good",
        Goes(&[(Land, 0.5), (Disarmed, 10.0)]),
        &[Fence(-0.1)],
    ),
    drill(C::OutsideFence, "a box with the whole flight inside", Flies, &[Fence(3.0)]),
    drill(
        C::ImuLate,
        "gyro missing for good",
        Goes(&[(Land, 0.1), (Disarmed, 10.0)]),
        &[Fault(K::ImuMissing, ALWAYS_S)],
    ),
    drill(C::ImuLate, "gyro missing for two ticks", Flies, &[Fault(K::ImuMissing, 0.02)]),
    drill(C::ImuLate, "gyro says nonsense", Goes(&[(Land, 0.1)]), &[Fault(K::ImuGarbage, ALWAYS_S)]),
    drill(
        C::ImuStuck,
        "the same gyro sample for good",
        Goes(&[(Land, 0.11)]),
        &[Fault(K::ImuStuck, ALWAYS_S)],
    ),
    drill(C::ImuStuck, "the same gyro sample eight times more", Flies, &[Fault(K::ImuStuck, 0.08)]),
    drill(
        C::ImuDisagrees,
        "gyro off by 1.5 rad/s",
        Goes(&[(Land, 0.1)]),
        &[Fault(K::ImuBiased(1.5), ALWAYS_S)],
    ),
    drill(C::ImuDisagrees, "gyro off by 0.15 rad/s", Flies, &[Fault(K::ImuBiased(0.15), ALWAYS_S)]),
    drill(
        C::Vibrating,
        "gyro shaken by 1 rad/s",
        Goes(&[(Land, 0.5)]),
        &[Fault(K::ImuShaken(1.0), ALWAYS_S)],
    ),
    drill(C::Vibrating, "gyro shaken by 0.5 rad/s", Flies, &[Fault(K::ImuShaken(0.5), ALWAYS_S)]),
    drill(
        C::ImuGone,
        "gyro missing for good, under a law that needs it",
        Goes(&[(Land, 0.1), (Cut, 0.2)]),
        &[NeedsGyro, Fault(K::ImuMissing, ALWAYS_S)],
    ),
    drill(
        C::ImuGone,
        "gyro missing for 0.15 s, under a law that needs it",
        Short(&[(Land, 0.1), (Disarmed, 10.0)]),
        &[NeedsGyro, Fault(K::ImuMissing, 0.15)],
    ),
    drill(
        C::ImuGone,
        "poses and gyro silent",
        Goes(&[(Land, 0.1), (Cut, 0.2)]),
        &[Fault(K::PoseSilent, ALWAYS_S), Fault(K::ImuMissing, ALWAYS_S)],
    ),
    drill(
        C::BatteryLow,
        "10.5 V for good: warned, flown on",
        Flies,
        &[Fault(K::VoltageLower(0.6), ALWAYS_S)],
    ),
    drill(
        C::BatteryCritical,
        "10.2 V for good",
        Goes(&[(Land, 1.1), (Disarmed, 10.0)]),
        &[Fault(K::VoltageLower(0.9), ALWAYS_S)],
    ),
    drill(C::BatteryCritical, "10.2 V for 0.5 s", Flies, &[Fault(K::VoltageLower(0.9), 0.5)]),
    drill(
        C::BatteryEmpty,
        "9.8 V for good",
        Goes(&[(Land, 1.1), (Disarmed, 5.5)]),
        &[Fault(K::VoltageLower(1.3), ALWAYS_S)],
    ),
    drill(C::BatteryEmpty, "9.8 V for 0.9 s", Flies, &[Fault(K::VoltageLower(1.3), 0.9)]),
    drill(
        C::BatteryCritical,
        "a voltage that is no number",
        Goes(&[(Land, 1.1)]),
        &[Fault(K::VoltageNotANumber, ALWAYS_S)],
    ),
    drill(
        C::Tilted,
        "the craft hangs tilted by 1.2 rad",
        Goes(&[(Cut, 1.0)]),
        &[Fault(K::Hangs(1.2), ALWAYS_S)],
    ),
    drill(C::Tilted, "motor 1 dead for 0.02 s", Flies, &[Fault(K::MotorDead(0), 0.02)]),
    drill(
        C::Crashed,
        "the craft hangs tilted by 0.6 rad",
        Goes(&[(Cut, 0.7)]),
        &[Fault(K::Hangs(0.6), ALWAYS_S)],
    ),
    // Let go again, it is somewhere else; hover and climb are flown without a place to go back to.
    drill(C::Crashed, "the craft hangs tilted by 0.6 rad for 0.3 s", Survives, &[Fault(K::Hangs(0.6), 0.3)])
        .within(2.5),
    drill(
        C::ImuDisagrees,
        "motor 1 dead, from 1 m higher",
        Goes(&[(Land, 0.5), (Cut, 1.0)]),
        &[Higher, Fault(K::MotorDead(0), ALWAYS_S)],
    ),
    drill(
        C::MotorFailed,
        "motor 3 350 us weak",
        NamesOrIsCut(2, &[(Land, 1.5)]),
        &[Fault(K::MotorWeak(2, 350.0), ALWAYS_S)],
    )
    .within(2.5),
    drill(
        // Nothing is at its end, so nobody knows which motor it is; and three motors hold no place.
        C::MotorFailed,
        "motor 3 goes on as it did, whatever it is told",
        LandsOrIsCut(9.0),
        &[Fault(K::MotorStuck(2), ALWAYS_S)],
    )
    .within(8.0),
    drill(C::MotorFailed, "motor 3 100 us weak", Survives, &[Fault(K::MotorWeak(2, 100.0), ALWAYS_S)])
        .within(2.0),
    drill(
        // At their end all four turn the craft no more: under gains that know no end it tumbles.
        C::ThrustLost,
        "motors 310 us weak",
        GoesAndMayCrash(&[(Land, 3.0)]),
        &[Fault(K::MotorsWeak(310.0), ALWAYS_S)],
    ),
    drill(C::ThrustLost, "motors 150 us weak", Flies, &[Fault(K::MotorsWeak(150.0), ALWAYS_S)]),
    drill(
        C::ClockJumped,
        "clock 5 s ahead",
        Goes(&[(Land, 0.02), (Disarmed, 10.0)]),
        &[Fault(K::ClockOff(5_000_000), ALWAYS_S)],
    ),
    drill(
        C::ClockJumped,
        "clock 1 h back",
        Goes(&[(Land, 0.02)]),
        &[Fault(K::ClockOff(0_u32.wrapping_sub(3_600_000_000)), ALWAYS_S)],
    ),
    drill(C::ClockJumped, "clock wraps in the middle", Flies, &[ClockWraps]),
    drill(C::LoopOverrun, "loop stalls for 12 ticks", Goes(&[(Land, 0.2)]), &[Fault(K::LoopStalled, 0.12)]),
    drill(C::LoopOverrun, "loop stalls for 50 ticks", Goes(&[(Land, 0.52)]), &[Fault(K::LoopStalled, 0.5)]),
    drill(C::LoopOverrun, "loop stalls for 5 ticks", Flies, &[Fault(K::LoopStalled, 0.05)]),
    drill(C::LoopOverrun, "loop stalls for 2 ticks", Flies, &[Fault(K::LoopStalled, 0.02)]),
    drill(C::LoopOverrun, "loop stalls for 1 tick", Flies, &[Fault(K::LoopStalled, 0.01)]),
    drill(
        // Three motors hold no place, but land slower than a fall.
        C::OutputsFailed,
        "output 1 takes no command any more",
        GoesAndMayCrash(&[(Land, 0.06)]),
        &[Fault(K::OutputDead(0), ALWAYS_S)],
    )
    .within(5.0),
    drill(C::OutputsFailed, "output 1 misses four commands", Flies, &[Fault(K::OutputDead(0), 0.04)]),
    drill(
        C::LandRequested,
        "the ground asks to land",
        Goes(&[(Land, 0.02), (Disarmed, 10.0)]),
        &[Fault(K::Asks(Request::Land), 0.01)],
    ),
    drill(
        C::Landed,
        "the ground asks to land on a table",
        Goes(&[(Land, 0.02), (Disarmed, 10.0)]),
        &[Table(0.3), Fault(K::Asks(Request::Land), 0.01)],
    ),
    drill(
        C::Landed,
        "poses of the floor in a landing, one at a time",
        Goes(&[(Land, 0.02), (Disarmed, 10.0)]),
        &[
            Fault(K::Asks(Request::Land), 0.01),
            Repeated {
                kind: K::PoseShifted([0.0, 0.0, 0.45]),
                first_s: 1.0,
                every_s: 0.3,
                times: 12,
                for_s: 0.01,
            },
        ],
    ),
    drill(
        C::IdleForLong,
        "armed, and nobody takes off",
        Goes(&[(Armed, 0.01), (Disarmed, 10.02)]),
        &[WaitsArmed(100.0)],
    ),
    drill(
        C::IdleForLong,
        "armed, and taken off after 9.9 s",
        Short(&[(Armed, 0.01), (Flying, 9.91)]),
        &[WaitsArmed(9.9)],
    ),
    drill(C::ArmRequested, "the ground asks to arm in flight", Flies, &[Fault(K::Asks(Request::Arm), 0.01)]),
    drill(
        C::CutRequested,
        "the ground cuts the motors",
        Goes(&[(Cut, 0.02)]),
        &[Fault(K::Asks(Request::Cut), 0.01)],
    ),
    drill(C::CutRequested, "the command is cut-off, once", Goes(&[(Cut, 0.02)]), &[Fault(K::CutOff, 0.01)]),
    drill(
        C::DisarmRequested,
        "the ground disarms",
        Goes(&[(Disarmed, 0.02)]),
        &[Fault(K::Asks(Request::Disarm), 0.01)],
    ),
];

/// All drills: what sets a rule off stands before what just does not.
pub fn drills() -> &'static [Drill] {
    DRILLS
}
