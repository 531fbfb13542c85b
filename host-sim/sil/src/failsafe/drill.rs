//! Failsafe drills: for each rule of the supervisor a flight that sets it off, and one that just does not.
//!
//! Each is flown in hover, in a climb and in a pattern, with noise. The fault begins when the craft hovers, climbs fastest and
//! is on its way between two way-points. Times are those after the beginning of the fault; the limits are the project's
//! (what other autopilots promise), plus one tick where a limit falls on one.

use control::{Condition, Conditions, Request};
use proto::State;

use crate::craft::{Fault, FaultKind, NoiseModel};
use crate::flight::{FlightPlan, Recording, Script, SilError, Step, StepAxis, fly};
use crate::scenarios::{Scenario, Settings};

/// What the drills are flown over, and when the fault begins, s.
const FLIGHTS: [(&str, f64); 3] = [("hover", 3.0), ("climb", 3.0), ("pattern", 9.0)];
/// How long a drill goes on after its fault, s: landing from 1.5 m at 0.3 m/s takes 5 s.
const AFTER_S: f64 = 8.0;

/// What has to come of a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Expected {
    /// Nothing: the pilot's command is flown to the end.
    Flies,
    /// The rule is set off, and these states are gone to in this order, each within so many s of the beginning of the fault.
    Goes(&'static [(State, f64)]),
    /// These states, likewise, but the rule is not set off: milder ones are.
    Short(&'static [(State, f64)]),
}

/// A fault, and what has to come of it.
#[derive(Debug, Clone, Copy)]
pub struct Drill {
    /// What happens, in words.
    pub name: &'static str,
    /// The rule that it is about.
    pub rule: Condition,
    /// What has to come of it.
    pub expected: Expected,
    /// Makes it happen at this time, s.
    inject: fn(&mut FlightPlan, f64),
}

/// What came of a drill.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Over which flight.
    pub flight: &'static str,
    /// Seed of its noise.
    pub seed: u64,
    /// When the condition of the rule was there first, s after the beginning of the fault.
    pub flagged_s: Option<f64>,
    /// Each state that was gone to, and when, s after the beginning of the fault.
    pub states: Vec<(State, f64)>,
    /// What was found in those ticks.
    pub reasons: Vec<Conditions>,
    /// How far from where it was when the fault began the craft was at most while its motors ran, horizontally, m.
    pub drift_m: f64,
    /// Whether that is what was expected.
    pub holds: bool,
}

fn once(plan: &mut FlightPlan, kind: FaultKind, from_s: f64, for_s: f64) {
    plan.faults.push(Fault { kind, from_s, for_s });
}

/// To the end of the flight.
const ALWAYS_S: f64 = 1e6;

/// All drills: what sets a rule off stands before what just does not.
pub fn drills() -> Vec<Drill> {
    use Condition as C;
    use Expected::{Flies, Goes, Short};
    use FaultKind as K;
    use State::{Cut, Disarmed, Flying, Hold, Land};
    let mut list = Vec::new();
    let mut add = |rule, name, expected, inject| list.push(Drill { name, rule, expected, inject });

    add(
        C::LinkLate,
        "commands silent for 0.6 s, then back",
        Goes(&[(Hold, 0.51), (Flying, 1.15)]),
        |p, t| {
            once(p, K::LinkSilent, t, 0.6);
        },
    );
    add(C::LinkLate, "commands silent for 0.49 s", Flies, |p, t| once(p, K::LinkSilent, t, 0.49));
    add(C::LinkLate, "commands that are no numbers", Goes(&[(Hold, 0.51), (Land, 2.0)]), |p, t| {
        once(p, K::LinkGarbage, t, ALWAYS_S);
    });
    add(
        C::LinkLost,
        "commands silent for good",
        Goes(&[(Hold, 0.51), (Land, 2.0), (Disarmed, 8.0)]),
        |p, t| {
            once(p, K::LinkSilent, t, ALWAYS_S);
        },
    );
    add(C::LinkLost, "commands silent for 1.88 s", Short(&[(Hold, 0.51), (Flying, 2.42)]), |p, t| {
        once(p, K::LinkSilent, t, 1.88);
    });
    add(
        C::LinkLate,
        "one command frame every 0.4 s after a silence",
        Goes(&[(Hold, 0.51), (Land, 20.0)]),
        |p, t| {
            once(p, K::LinkSilent, t, 0.8);
            for k in 0..30 {
                once(p, K::LinkSilent, t + 0.81 + 0.4 * f64::from(k), 0.39);
            }
            // It lands when the silence has lasted; here single frames keep it in hold.
            once(p, K::LinkSilent, t + 4.0, ALWAYS_S);
        },
    );
    add(C::PoseLate, "poses silent for 0.06 s", Goes(&[(Hold, 0.1), (Flying, 0.3)]), |p, t| {
        once(p, K::PoseSilent, t, 0.06);
    });
    add(C::PoseLate, "poses silent for 0.04 s", Flies, |p, t| once(p, K::PoseSilent, t, 0.04));
    add(
        C::PoseLost,
        "poses silent for 0.45 s",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Disarmed, 8.0)]),
        |p, t| {
            once(p, K::PoseSilent, t, 0.45);
        },
    );
    add(C::PoseLost, "poses silent for 0.38 s", Short(&[(Hold, 0.1), (Flying, 0.6)]), |p, t| {
        once(p, K::PoseSilent, t, 0.38);
    });
    add(C::PoseGone, "poses silent for good", Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]), |p, t| {
        once(p, K::PoseSilent, t, ALWAYS_S);
    });
    add(
        C::PoseGone,
        "poses silent for 1.85 s",
        Short(&[(Hold, 0.1), (Land, 0.5), (Disarmed, 8.0)]),
        |p, t| {
            once(p, K::PoseSilent, t, 1.85);
        },
    );
    add(C::PoseFrozen, "the same pose for good", Goes(&[(Hold, 0.13), (Land, 0.5), (Cut, 2.0)]), |p, t| {
        once(p, K::PoseFrozen, t, ALWAYS_S);
    });
    add(C::PoseFrozen, "the same pose twice more", Flies, |p, t| once(p, K::PoseFrozen, t, 0.02));
    add(C::PoseJumped, "poses 0.6 m away for good", Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]), |p, t| {
        once(p, K::PoseShifted([0.6, 0.0, 0.0]), t, ALWAYS_S);
    });
    add(C::PoseJumped, "one pose 0.6 m away", Flies, |p, t| {
        once(p, K::PoseShifted([0.6, 0.0, 0.0]), t, 0.01)
    });
    add(C::PoseJumped, "poses 5 cm away for good", Flies, |p, t| {
        once(p, K::PoseShifted([0.05, 0.0, 0.0]), t, ALWAYS_S)
    });
    add(
        C::PoseJumped,
        "heading turned by 180 degrees",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        |p, t| {
            once(p, K::PoseTurned(std::f32::consts::PI), t, ALWAYS_S);
        },
    );
    add(C::PoseJumped, "heading turned by 5 degrees", Flies, |p, t| {
        once(p, K::PoseTurned(0.087), t, ALWAYS_S)
    });
    add(
        C::OutsideFence,
        "positions that are no numbers",
        Goes(&[(Hold, 0.1), (Land, 0.5), (Cut, 2.0)]),
        |p, t| {
            once(p, K::PoseNotANumber, t, ALWAYS_S);
        },
    );
    add(C::OutsideFence, "positions that are no numbers for 0.04 s", Flies, |p, t| {
        once(p, K::PoseNotANumber, t, 0.04);
    });
    add(
        C::OutsideFence,
        "a box that ends 0.1 m off for good",
        Goes(&[(Land, 0.5), (Disarmed, 8.0)]),
        |p, _| {
            fence_around_start(p, -0.1);
        },
    );
    add(C::OutsideFence, "a box with the whole flight inside", Flies, |p, _| fence_around_start(p, 3.0));
    add(C::ImuLate, "gyro missing for good", Goes(&[(Land, 0.1), (Disarmed, 8.0)]), |p, t| {
        once(p, K::ImuMissing, t, ALWAYS_S);
    });
    add(C::ImuLate, "gyro missing for two ticks", Flies, |p, t| once(p, K::ImuMissing, t, 0.02));
    add(C::ImuLate, "gyro says nonsense", Goes(&[(Land, 0.1)]), |p, t| once(p, K::ImuGarbage, t, ALWAYS_S));
    add(C::ImuStuck, "the same gyro sample for good", Goes(&[(Land, 0.11)]), |p, t| {
        once(p, K::ImuStuck, t, ALWAYS_S);
    });
    add(C::ImuStuck, "the same gyro sample eight times more", Flies, |p, t| once(p, K::ImuStuck, t, 0.08));
    add(C::ImuDisagrees, "gyro off by 1.5 rad/s", Goes(&[(Land, 0.1)]), |p, t| {
        once(p, K::ImuBiased(1.5), t, ALWAYS_S);
    });
    add(C::ImuDisagrees, "gyro off by 0.15 rad/s", Flies, |p, t| once(p, K::ImuBiased(0.15), t, ALWAYS_S));
    add(
        C::ImuGone,
        "gyro missing for good, under a law that needs it",
        Goes(&[(Land, 0.1), (Cut, 0.2)]),
        |p, t| {
            needs_gyro(p);
            once(p, K::ImuMissing, t, ALWAYS_S);
        },
    );
    add(
        C::ImuGone,
        "gyro missing for 0.15 s, under a law that needs it",
        Short(&[(Land, 0.1), (Disarmed, 8.0)]),
        |p, t| {
            needs_gyro(p);
            once(p, K::ImuMissing, t, 0.15);
        },
    );
    add(C::ImuGone, "poses and gyro silent", Goes(&[(Land, 0.1), (Cut, 0.2)]), |p, t| {
        once(p, K::PoseSilent, t, ALWAYS_S);
        once(p, K::ImuMissing, t, ALWAYS_S);
    });
    add(C::BatteryLow, "10.5 V for good: warned, flown on", Flies, |p, t| {
        once(p, K::VoltageLower(0.6), t, ALWAYS_S);
    });
    add(C::BatteryCritical, "10.2 V for good", Goes(&[(Land, 1.1), (Disarmed, 8.0)]), |p, t| {
        once(p, K::VoltageLower(0.9), t, ALWAYS_S);
    });
    add(C::BatteryCritical, "10.2 V for 0.5 s", Flies, |p, t| once(p, K::VoltageLower(0.9), t, 0.5));
    add(C::BatteryEmpty, "9.8 V for good", Goes(&[(Land, 1.1), (Disarmed, 5.5)]), |p, t| {
        once(p, K::VoltageLower(1.3), t, ALWAYS_S);
    });
    add(C::BatteryEmpty, "9.8 V for 0.9 s", Flies, |p, t| once(p, K::VoltageLower(1.3), t, 0.9));
    add(C::BatteryCritical, "a voltage that is no number", Goes(&[(Land, 1.1)]), |p, t| {
        once(p, K::VoltageNotANumber, t, ALWAYS_S);
    });
    add(C::Tilted, "motor 1 dead, from 1 m higher", Goes(&[(Cut, 1.0)]), |p, t| {
        higher(p);
        once(p, K::MotorDead(0), t, ALWAYS_S);
    });
    add(C::Tilted, "motor 1 dead for 0.02 s", Flies, |p, t| once(p, K::MotorDead(0), t, 0.02));
    add(C::ThrustLost, "motors 310 us weak", Goes(&[(Land, 3.0)]), |p, t| {
        once(p, K::MotorsWeak(310.0), t, ALWAYS_S);
    });
    add(C::ThrustLost, "motors 150 us weak", Flies, |p, t| once(p, K::MotorsWeak(150.0), t, ALWAYS_S));
    add(C::ClockJumped, "clock 5 s ahead", Goes(&[(Land, 0.02), (Disarmed, 8.0)]), |p, t| {
        once(p, K::ClockOff(5_000_000), t, ALWAYS_S);
    });
    add(C::ClockJumped, "clock 1 h back", Goes(&[(Land, 0.02)]), |p, t| {
        once(p, K::ClockOff(0_u32.wrapping_sub(3_600_000_000)), t, ALWAYS_S);
    });
    add(C::ClockJumped, "clock wraps in the middle", Flies, |p, t| {
        p.clock_us = 0_u32.wrapping_sub((t * 1e6) as u32);
    });
    add(C::LoopOverrun, "loop stalls for 12 ticks", Goes(&[(Land, 0.2)]), |p, t| {
        once(p, K::LoopStalled, t, 0.12)
    });
    add(C::LoopOverrun, "loop stalls for 2 ticks", Flies, |p, t| once(p, K::LoopStalled, t, 0.02));
    add(C::LandRequested, "the ground asks to land", Goes(&[(Land, 0.02), (Disarmed, 8.0)]), |p, t| {
        once(p, K::Asks(Request::Land), t, 0.01);
    });
    add(C::ArmRequested, "the ground asks to arm in flight", Flies, |p, t| {
        once(p, K::Asks(Request::Arm), t, 0.01);
    });
    add(C::CutRequested, "the ground cuts the motors", Goes(&[(Cut, 0.02)]), |p, t| {
        once(p, K::Asks(Request::Cut), t, 0.01);
    });
    add(C::CutRequested, "the command is cut-off, once", Goes(&[(Cut, 0.02)]), |p, t| {
        once(p, K::CutOff, t, 0.01)
    });
    add(C::DisarmRequested, "the ground disarms", Goes(&[(Disarmed, 0.02)]), |p, t| {
        once(p, K::Asks(Request::Disarm), t, 0.01);
    });
    list
}

/// The box around the start, so wide to each side, from the beginning of the flight on.
fn fence_around_start(plan: &mut FlightPlan, half_m: f64) {
    let fence = &mut plan.config.supervision.fence;
    let [x, _, _] = plan.start_m;
    fence.x_m = if half_m > 0.0 { [x - half_m, x + half_m] } else { [x - half_m, x + 3.0] };
}

/// Everything 1 m higher, in a cage that allows it: time to tumble before the floor.
fn higher(plan: &mut FlightPlan) {
    plan.config.position_limits.z_m[0] -= 1.0;
    plan.config.supervision.fence.z_m[0] -= 1.0;
    plan.start_m[2] -= 1.0;
    if let Script::Waypoints { list, .. } = &mut plan.script {
        list.iter_mut().for_each(|waypoint| waypoint.position_m[2] -= 1.0);
    }
}

fn needs_gyro(plan: &mut FlightPlan) {
    use control::gains::{Complement, GyroFusion};
    plan.config.estimation.gyro = Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::Exact });
}

impl Drill {
    /// The plan of one flight of it, and when its fault begins, s.
    pub fn plan(&self, flight: usize, seed: u64) -> (FlightPlan, f64) {
        let (name, at_s) = FLIGHTS[flight % FLIGHTS.len()];
        let noise = Some(NoiseModel::default());
        let mut plan = match name {
            "pattern" => Scenario::Pattern.plan(&Settings { noise, seed, ..Settings::default() }),
            "climb" => {
                let step = Step { axis: StepAxis::Z, size: -0.5, at_s: at_s - 0.5 };
                FlightPlan { script: Script::Step(step), noise, seed, ..FlightPlan::thesis() }
            }
            _ => FlightPlan { noise, seed, ..FlightPlan::thesis() },
        };
        plan.duration_s = at_s + AFTER_S;
        (self.inject)(&mut plan, at_s);
        (plan, at_s)
    }

    /// Flies it over hover, climb and pattern with one seed.
    ///
    /// # Errors
    /// A plan that cannot be flown.
    pub fn fly(&self, seed: u64) -> Result<Vec<Found>, SilError> {
        (0..FLIGHTS.len())
            .map(|k| {
                let (plan, at_s) = self.plan(k, seed);
                Ok(self.judge(FLIGHTS[k].0, seed, &fly(&plan)?, at_s))
            })
            .collect()
    }

    fn judge(&self, flight: &'static str, seed: u64, recording: &Recording, at_s: f64) -> Found {
        let begin = (at_s / recording.period_s).round() as usize;
        // A box that is too small is so from the start.
        let from_start = self.rule == Condition::OutsideFence && self.plan(0, seed).0.faults.is_empty();
        let begin = if from_start { 0 } else { begin };
        let after_s = |row: usize| (row as f64 - begin as f64) * recording.period_s;
        let rows = recording.rows.iter().enumerate();
        let flagged = |bits| Conditions::from_bits(bits).has(self.rule);
        let flagged_s =
            rows.clone().find(|(_, row)| flagged(row.supervision.conditions)).map(|(k, _)| after_s(k));
        let (mut states, mut reasons) = (Vec::new(), Vec::new());
        let mut last = State::Flying;
        for (k, row) in rows {
            if row.supervision.state != last {
                last = row.supervision.state;
                states.push((last, after_s(k)));
                reasons.push(Conditions::from_bits(row.supervision.conditions));
            }
        }
        let place = |k: usize| {
            recording.rows.get(k).map_or([0.0; 2], |row| [row.truth.position_m[0], row.truth.position_m[1]])
        };
        let [x0, y0] = place(begin);
        let runs = |row: &&crate::flight::Row| !matches!(row.supervision.state, State::Cut | State::Disarmed);
        let drift_m = recording.rows.iter().skip(begin).take_while(runs).fold(0.0_f64, |most, row| {
            let [x, y, _] = row.truth.position_m;
            most.max(f64::from(x - x0).hypot(f64::from(y - y0)))
        });
        let holds = match self.expected {
            Expected::Flies => states.is_empty() && recording.complete,
            Expected::Goes(expected) => flagged_s.is_some_and(|s| s >= 0.0) && in_order(&states, expected),
            Expected::Short(expected) => flagged_s.is_none() && in_order(&states, expected),
        };
        Found { flight, seed, flagged_s, states, reasons, drift_m, holds }
    }
}

/// Are the expected states gone to in their order, none before the fault and each in time?
fn in_order(states: &[(State, f64)], expected: &[(State, f64)]) -> bool {
    let mut rest = states.iter();
    states.iter().all(|(_, at_s)| *at_s >= 0.0)
        && expected
            .iter()
            .all(|(wanted, by_s)| rest.any(|(state, at_s)| state == wanted && *at_s <= by_s + 1e-6))
}

/// The drills of one seed as a table: what happens, the rule, what came of it in each flight.
///
/// # Errors
/// A plan that cannot be flown.
pub fn table(seed: u64) -> Result<(String, bool), SilError> {
    use std::fmt::Write as _;
    let (mut text, mut all) = (String::new(), true);
    for drill in drills() {
        let _ = writeln!(text, "{} [{:?}]", drill.name, drill.rule);
        for found in drill.fly(seed)? {
            all &= found.holds;
            let went: Vec<String> = found
                .states
                .iter()
                .zip(&found.reasons)
                .map(|((state, at_s), reasons)| {
                    let reasons: Vec<String> = reasons.iter().map(|reason| format!("{reason:?}")).collect();
                    format!(
                        "{state:?} {at_s:.2} s ({})",
                        if reasons.is_empty() { "all good".into() } else { reasons.join(" ") }
                    )
                })
                .collect();
            let went = if went.is_empty() { "flies on".to_owned() } else { went.join(", ") };
            let flagged = found.flagged_s.map_or("not flagged".to_owned(), |s| format!("flagged {s:.2} s"));
            let verdict = if found.holds { "" } else { "  NOT AS EXPECTED" };
            let _ = writeln!(
                text,
                "  {:8} {flagged:15} {went}; drift {:.2} m{verdict}",
                found.flight, found.drift_m
            );
        }
    }
    Ok((text, all))
}
