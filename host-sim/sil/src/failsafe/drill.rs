//! Failsafe drills: for each rule of the supervisor a flight that sets it off, and one that just
//! does not.
//!
//! Each is flown in hover, in a climb and in a pattern, with noise. The fault begins when the craft
//! hovers, climbs fastest and is on its way between two way-points. Times are those after the
//! beginning of the fault; the limits are the project's (what other autopilots promise), plus one
//! tick where a limit falls on one.

use control::{Condition, Conditions, Config, Request};
use model::{Effect, frames};
use nalgebra::Vector3;
use proto::State;

use crate::craft::{Fault, FaultKind, NoiseModel};
use crate::flight::{FlightPlan, Recording, Row, Script, SilError, StepAxis, StepCommand, fly_and_ask};
use crate::scenarios::{Scenario, Settings};

/// The flights in which each drill is flown, and when its fault begins, s.
const FLIGHTS: [(&str, f64); 3] = [("hover", 3.0), ("climb", 3.0), ("pattern", 9.0)];
/// How long a drill goes on after its fault, s: landing from 1.5 m at 0.3 m/s takes 5 s, and one
/// more until the craft is sure of it.
const AFTER_S: f64 = 10.0;

/// How the craft has to respond to a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExpectedResponse {
    /// Not at all: the pilot's command is flown to the end.
    Flies,
    /// The rule is set off, and these states are gone to in this order, each within so many s of
    /// the beginning of the fault. In the last one the flight ends; a landing may end on the floor.
    Goes(&'static [(State, f64)]),
    /// As `Goes`, but what comes of it in the end is left to physics: the craft cannot be held any more.
    GoesAndMayCrash(&'static [(State, f64)]),
    /// As `GoesAndMayCrash`, and it is this motor, 0 to 3, that is said to have failed; or the motors are off
    /// within the time of the last state: under gains that let the craft tumble, it is cut before the rule's
    /// time is over.
    NamesOrIsCut(u8, &'static [(State, f64)]),
    /// Whichever rule notices it first, the craft lands or its motors are off within so many s.
    LandsOrIsCut(f64),
    /// These states and this end, likewise, but the rule is not set off: milder ones are.
    Short(&'static [(State, f64)]),
    /// The rule is not set off; others may be, and the craft flies, holds or lands, but is not cut.
    Survives,
}

/// A fault, and how the craft has to respond.
#[derive(Debug, Clone, Copy)]
pub struct Drill {
    /// What happens, in words.
    pub name: &'static str,
    /// The rule that it is about.
    pub rule: Condition,
    /// How the craft has to respond.
    pub expected: ExpectedResponse,
    /// How far the craft may drift meanwhile, m.
    pub within_m: f64,
    /// How fast the craft may sink or climb without poses, m/s.
    pub blind_m_s: f64,
    /// What happens at the drill's moment.
    pub(super) causes: &'static [Cause],
}

/// How the craft responded in one flight of a drill.
#[derive(Debug, Clone, PartialEq)]
pub struct DrillResult {
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
    /// The motor that the craft says has failed, 0 to 3.
    pub failed_motor: Option<u8>,
    /// How far the craft was at most from where it was taken out of the pilot's hands, in hold and
    /// landing, horizontally, m.
    pub drift_m: f64,
    /// How fast it sank or climbed at most in hold and landing without poses, m/s.
    pub speed_m_s: f64,
    /// Whether all of that is what was expected.
    pub holds: bool,
}

/// What happens in a drill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cause {
    /// A fault that lasts so many s from the drill's moment on.
    Fault(FaultKind, f64),
    /// A fault that begins so many s after the drill's moment, and lasts so many s.
    Later(f64, FaultKind, f64),
    /// A fault that comes again and again: first `first_s` after the drill's moment.
    Repeated { kind: FaultKind, first_s: f64, every_s: f64, times: u32, for_s: f64 },
    /// A box around the start, so wide to each side in m, from the beginning of the flight on.
    Fence(f64),
    /// Everything 1 m higher, in a cage that allows it: time to tumble before the floor.
    Higher,
    /// A law that cannot fly without a gyro.
    NeedsGyro,
    /// The craft's clock wraps at the drill's moment.
    ClockWraps,
    /// The craft is so much heavier than the model of its gains, kg.
    Heavier(f64),
    /// The craft stands on the floor; the ground asks to arm at the drill's moment, and the pilot takes
    /// off so many s after it.
    WaitsArmed(f64),
    /// A table of this height in m is under the whole flight.
    Table(f64),
}

impl Cause {
    /// Puts it into a plan whose moment is `at_s`.
    fn apply(self, plan: &mut FlightPlan, at_s: f64) {
        let mut add = |kind, from_s, for_s| plan.faults.push(Fault { kind, from_s, for_s });
        match self {
            Self::Fault(kind, for_s) => add(kind, at_s, for_s),
            Self::Later(later_s, kind, for_s) => add(kind, at_s + later_s, for_s),
            Self::Repeated { kind, first_s, every_s, times, for_s } => {
                (0..times).for_each(|k| add(kind, at_s + first_s + every_s * f64::from(k), for_s));
            }
            Self::Fence(half_m) => fence_around_start(plan, half_m),
            Self::Higher => higher(plan),
            Self::NeedsGyro => {
                use control::gains::{Complement, GyroFusion};
                let fusion = GyroFusion { corner_rad_s: 5.0, complement: Complement::Exact };
                plan.config.estimation.gyro = Some(fusion);
            }
            Self::WaitsArmed(for_s) => {
                add(FaultKind::Asks(Request::Arm), at_s, 0.01);
                add(FaultKind::CutOff, 0.0, at_s + for_s);
                plan.on_the_floor = true;
                plan.duration_s += 2.0;
            }
            Self::Heavier(by_kg) => plan.model.set(Effect::MassChange, &[by_kg]),
            Self::Table(height_m) => plan.floor_m = Some(-height_m),
            Self::ClockWraps => plan.clock_us = 0_u32.wrapping_sub((at_s * 1e6) as u32),
        }
    }
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

impl Drill {
    /// The plan of one flight of it under these gains, and when its fault begins, s.
    pub fn plan(&self, flight: usize, seed: u64, config: &Config) -> (FlightPlan, f64) {
        let (name, at_s) = FLIGHTS[flight % FLIGHTS.len()];
        let noise = Some(NoiseModel::default());
        let flown = Settings { config: Some(*config), noise, seed, ..Settings::default() };
        let mut plan = match name {
            "pattern" => Scenario::Pattern.plan(&flown),
            "climb" => {
                let step = StepCommand { axis: StepAxis::Z, size: -0.5, at_s: at_s - 0.5 };
                let script = Script::Step(step);
                FlightPlan { script, noise, seed, config: *config, ..FlightPlan::thesis() }
            }
            _ => FlightPlan { noise, seed, config: *config, ..FlightPlan::thesis() },
        };
        plan.duration_s = at_s + AFTER_S;
        plan.floor_m = Some(0.0);
        self.causes.iter().for_each(|cause| cause.apply(&mut plan, at_s));
        (plan, at_s)
    }

    /// Flies it over hover, climb and pattern under these gains with one seed.
    ///
    /// # Errors
    /// A plan that cannot be flown.
    pub fn fly(&self, seed: u64, config: &Config) -> Result<Vec<DrillResult>, SilError> {
        (0..FLIGHTS.len())
            .map(|k| {
                let (plan, at_s) = self.plan(k, seed, config);
                let (recording, failed_motor) = fly_and_ask(&plan)?;
                Ok(self.judge(FLIGHTS[k].0, &plan, (&recording, failed_motor), at_s))
            })
            .collect()
    }

    fn judge(
        &self,
        flight: &'static str,
        plan: &FlightPlan,
        (recording, failed_motor): (&Recording, Option<u8>),
        at_s: f64,
    ) -> DrillResult {
        let begin = (at_s / recording.period_s).round() as usize;
        // A box that is too small is so from the start.
        let from_start = self.rule == Condition::OutsideFence && plan.faults.is_empty();
        let begin = if from_start { 0 } else { begin };
        let after_s = |row: usize| (row as f64 - begin as f64) * recording.period_s;
        let rows = recording.rows.iter().enumerate();
        let flagged = |bits| Conditions::from_bits(bits).has(self.rule);
        let flagged_s =
            rows.clone().find(|(_, row)| flagged(row.supervision.conditions)).map(|(k, _)| after_s(k));
        let (mut states, mut reasons) = (Vec::new(), Vec::new());
        let mut last = if plan.on_the_floor { State::Disarmed } else { State::Flying };
        for (k, row) in rows {
            if row.supervision.state != last {
                last = row.supervision.state;
                states.push((last, after_s(k)));
                reasons.push(Conditions::from_bits(row.supervision.conditions));
            }
        }
        let (drift_m, speed_m_s) = (drift_m(&recording.rows), blind_speed_m_s(&recording.rows));
        let is_found = flagged_s.is_some_and(|s| s >= 0.0);
        let goes_and_ends = |expected| in_order(&states, expected) && ends_well(&states, expected);
        let is_as_expected = match self.expected {
            ExpectedResponse::Flies => states.is_empty(),
            ExpectedResponse::Goes(expected) => is_found && goes_and_ends(expected),
            ExpectedResponse::GoesAndMayCrash(expected) => is_found && in_order(&states, expected),
            ExpectedResponse::NamesOrIsCut(motor, expected) => {
                let is_named = failed_motor == Some(motor) && is_found && in_order(&states, expected);
                let by_s = expected.last().map_or(0.0, |(_, by_s)| *by_s);
                is_named || in_order(&states, &[(State::Cut, by_s)])
            }
            ExpectedResponse::LandsOrIsCut(by_s) => {
                [State::Land, State::Cut].into_iter().any(|end| in_order(&states, &[(end, by_s)]))
            }
            ExpectedResponse::Short(expected) => flagged_s.is_none() && goes_and_ends(expected),
            ExpectedResponse::Survives => {
                flagged_s.is_none() && in_order(&states, &[]) && states.iter().all(|(s, _)| *s != State::Cut)
            }
        };
        let holds = is_as_expected
            && recording.complete
            && drift_m <= self.within_m
            && speed_m_s <= self.blind_m_s
            && stands_down_on_the_floor(&recording.rows, plan.floor_m);
        let seed = plan.seed;
        DrillResult { flight, seed, flagged_s, states, reasons, failed_motor, drift_m, speed_m_s, holds }
    }
}

/// A craft that disarms by itself stands: in the air it would fall.
fn stands_down_on_the_floor(rows: &[Row], floor_m: Option<f64>) -> bool {
    rows.windows(2).all(|pair| {
        let [before, after] = pair else { return true };
        let asked = Conditions::from_bits(after.supervision.conditions).has(Condition::DisarmRequested);
        let stands_down =
            before.supervision.state != State::Disarmed && after.supervision.state == State::Disarmed;
        let height_m = floor_m.map_or(0.0, |floor_m| floor_m - f64::from(after.truth.position_m[2]));
        !stands_down || asked || height_m < 0.05
    })
}

/// Is it in the supervisor's hands?
fn supervised(row: &Row) -> bool {
    matches!(row.supervision.state, State::Hold | State::Land)
}

/// How fast the craft sinks or climbs at most where nobody sees its height, in hold and landing, m/s.
fn blind_speed_m_s(rows: &[Row]) -> f64 {
    let vertical = |row: &Row| {
        let velocity = Vector3::from(row.truth.velocity_m_s.map(f64::from));
        let body = frames::dcm_from_quaternion(&row.truth.attitude.map(f64::from).into());
        body.tr_mul(&velocity).z.abs()
    };
    let blind = |row: &&Row| Conditions::from_bits(row.supervision.conditions).has(Condition::PoseLate);
    rows.iter().filter(|row| supervised(row)).filter(blind).map(vertical).fold(0.0, f64::max)
}

/// How far the craft goes in hold and landing from where each began, at most, horizontally, m.
fn drift_m(rows: &[Row]) -> f64 {
    let place = |row: &Row| [row.truth.position_m[0], row.truth.position_m[1]].map(f64::from);
    let stretches = rows.split(|row| !supervised(row));
    let of_stretch = |stretch: &[Row]| {
        let [x0, y0] = stretch.first().map_or([0.0; 2], place);
        stretch.iter().map(place).fold(0.0_f64, |most, [x, y]| most.max((x - x0).hypot(y - y0)))
    };
    stretches.map(of_stretch).fold(0.0, f64::max)
}

/// Does the craft go through the expected states in their order, none before the fault, each in
/// time?
fn in_order(states: &[(State, f64)], expected: &[(State, f64)]) -> bool {
    let mut rest = states.iter();
    states.iter().all(|(_, at_s)| *at_s >= 0.0)
        && expected
            .iter()
            .all(|(wanted, by_s)| rest.any(|(state, at_s)| state == wanted && *at_s <= by_s + 1e-6))
}

/// Is the craft in the last of the expected states when the flight is over, or on the floor after a landing?
fn ends_well(states: &[(State, f64)], expected: &[(State, f64)]) -> bool {
    let last = |states: &[(State, f64)]| states.last().map(|(state, _)| *state);
    let (is, wanted) = (last(states), last(expected));
    is == wanted || (wanted, is) == (Some(State::Land), Some(State::Disarmed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use State::{Cut, Disarmed, Flying, Hold, Land};

    #[test]
    fn a_flight_ends_as_expected_or_on_the_floor_after_a_landing() {
        let held = [(Hold, 0.5), (Flying, 1.0)];
        assert!(ends_well(&held, &held));
        assert!(!ends_well(&[(Hold, 0.5), (Flying, 1.0), (Land, 3.0)], &held), "and lands all the same");
        assert!(!ends_well(&[(Hold, 0.5)], &held));
        let lands = [(Land, 0.5)];
        assert!(ends_well(&lands, &lands) && ends_well(&[(Land, 0.5), (Disarmed, 7.0)], &lands));
        assert!(!ends_well(&[(Land, 0.5), (Cut, 1.0)], &lands), "a crash");
        assert!(!ends_well(&[(Land, 0.5), (Flying, 1.0)], &lands));
    }

    #[test]
    fn states_count_in_order_in_time_and_after_the_fault() {
        let expected = [(Hold, 0.5), (Land, 2.0)];
        assert!(in_order(&[(Hold, 0.5), (Land, 1.9)], &expected));
        assert!(in_order(&[(Hold, 0.1), (Flying, 0.3), (Land, 1.9)], &expected), "more than expected");
        assert!(!in_order(&[(Land, 0.1), (Hold, 0.2)], &expected), "the other way round");
        assert!(!in_order(&[(Hold, 0.6), (Land, 1.9)], &expected), "too late");
        assert!(!in_order(&[(Hold, -0.1), (Land, 1.9)], &expected), "before the fault");
        assert!(!in_order(&[(Hold, 0.1)], &expected), "not all");
    }

    #[test]
    fn repeated_faults_come_at_their_interval() {
        let mut plan = FlightPlan::thesis();
        let kind = FaultKind::LinkSilent;
        Cause::Repeated { kind, first_s: 1.0, every_s: 0.5, times: 3, for_s: 0.2 }.apply(&mut plan, 2.0);
        let times: Vec<f64> = plan.faults.iter().map(|fault| fault.from_s).collect();
        assert_eq!(times, [3.0, 3.5, 4.0]);
        assert!(plan.faults.iter().all(|fault| fault.for_s == 0.2));
    }
}
