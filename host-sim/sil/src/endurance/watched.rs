//! Flights that are watched for a crash, and whether one was to be expected of physics.

use std::fmt;

use control::supervision_limits::Fence;
use design::plant::{TrimTarget, equilibrium};
use model::Plant;
use proto::State;

use super::crash::{Crash, Watch};
use crate::craft::FaultKind;
use crate::flight::{FlightPlan, Recording, Row, SilError, fly_side_by_side};

/// What the optimiser leaves of the derivatives' squares where there is an equilibrium, SI squared.
const BALANCED: f64 = 1e-6;

/// Why a craft cannot hover in its air, whoever flies it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Impossible {
    /// Nothing balances its forces and moments.
    NoEquilibrium,
    /// A motor would have to do more than it can.
    TooWeak {
        /// What it is asked for, command units.
        asked: f64,
        /// The most that there is.
        greatest: f64,
        /// At the lowest voltage of the flight, V.
        lowest_v: f64,
    },
}

impl fmt::Display for Impossible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoEquilibrium => f.write_str("it has no equilibrium"),
            Self::TooWeak { asked, greatest, lowest_v } => {
                write!(f, "hovering asks a motor for {asked:.0} of {greatest:.0} at {lowest_v:.2} V")
            }
        }
    }
}

/// Why the craft of a plan cannot hover in its air, whoever flies it; nothing where it can.
pub fn impossible(plan: &FlightPlan) -> Option<Impossible> {
    let lowest_v = |rotor_rad_s: &[f64; 4]| plan.battery.voltage_v(plan.duration_s, rotor_rad_s);
    let battery_v = lowest_v(&[plan.battery.hover_speed_rad_s; 4]);
    let target = TrimTarget { battery_v: Some(battery_v), ..TrimTarget::default() };
    let Some(hover) = equilibrium(&plan.model, &target).ok().filter(|hover| hover.cost < BALANCED) else {
        return Some(Impossible::NoEquilibrium);
    };
    let lowest_v = lowest_v(&hover.rotor_rad_s);
    let commands = Plant::new(&plan.model).command_for(&hover.rotor_rad_s, lowest_v);
    let asked = commands.into_iter().fold(f64::NEG_INFINITY, f64::max) + weakness(plan);
    let [_, greatest] = plan.config.command_range;
    (asked > greatest).then_some(Impossible::TooWeak { asked, greatest, lowest_v })
}

/// [`impossible`] of one flight after the other: the same craft under the same conditions is judged once, whatever gains fly it.
#[derive(Debug, Default)]
pub struct Feasibility {
    last: Option<(FlightPlan, Option<Impossible>)>,
}

impl Feasibility {
    /// As [`impossible`].
    pub fn impossible(&mut self, plan: &FlightPlan) -> Option<Impossible> {
        let conditions = |plan: &FlightPlan| (plan.battery, plan.duration_s, plan.config.command_range);
        let is_alike = |own: &FlightPlan| {
            conditions(own) == conditions(plan) && own.faults == plan.faults && own.model == plan.model
        };
        if let Some((_, why)) = self.last.as_ref().filter(|(own, _)| is_alike(own)) {
            return *why;
        }
        let why = impossible(plan);
        self.last = Some((plan.clone(), why));
        why
    }
}

/// By how much the faults of a plan weaken a motor, command units.
fn weakness(plan: &FlightPlan) -> f64 {
    let of = |kind| match kind {
        FaultKind::MotorsWeak(by) | FaultKind::MotorWeak(_, by) => f64::from(by),
        _ => 0.0,
    };
    plan.faults.iter().map(|fault| of(fault.kind)).sum()
}

/// How far off the faults of a plan let the tracker see the craft, m.
fn tracker_off_m(plan: &FlightPlan) -> [f64; 3] {
    let of = |kind| match kind {
        FaultKind::PoseShifted(by) => Some(by.map(f64::from)),
        _ => None,
    };
    plan.faults.iter().find_map(|fault| of(fault.kind)).unwrap_or_default()
}

/// How a flight crashed, and after how many s.
type Crashed = Option<(Crash, f64)>;

/// Flies plans to their ends or crashes, side by side, and shows each tick of each, by its number. There are walls unless the supervisor
/// has no fence. What comes of each is an error where its plan or configuration cannot be flown.
pub(super) fn until_crash(
    plans: &[&FlightPlan],
    mut see: impl FnMut(usize, &Row),
) -> Vec<Result<Crashed, SilError>> {
    let begun = |plan: &&FlightPlan| {
        let watch = Watch::new(plan.config.sample_time_s, -plan.start_m[2], State::Flying);
        let caged = plan.config.supervision.fence != Fence::NONE;
        (watch.with_tracker_off(tracker_off_m(plan)).with_walls(caged), 0_u32)
    };
    let mut watches: Vec<(Watch, u32)> = plans.iter().map(begun).collect();
    let mut crashes: Vec<Crashed> = vec![None; plans.len()];
    let results = fly_side_by_side(plans, |number, row| {
        see(number, row);
        let (watch, tick) = &mut watches[number];
        let position_m = row.truth.position_m.map(f64::from);
        let crash = watch.look(position_m, row.supervision.state, row.supervision.conditions);
        crashes[number] = crash.map(|crash| (crash, f64::from(*tick) * plans[number].config.sample_time_s));
        *tick += 1;
        crashes[number].is_none()
    });
    results.into_iter().zip(crashes).map(|(result, crash)| result.map(|()| crash)).collect()
}

/// A flight that was watched.
#[derive(Debug, Clone)]
pub struct Watched {
    /// Every tick, to its end or its crash.
    pub recording: Recording,
    /// How it crashed, and after how many s.
    pub crash: Option<(Crash, f64)>,
}

/// Flies plans to their ends or crashes: each as if it was alone, to the bit, but many take less time together. What comes of each is an
/// error where its plan or configuration cannot be flown.
pub fn fly_watched(plans: &[&FlightPlan]) -> Vec<Result<Watched, SilError>> {
    let room = |plan: &&FlightPlan| Vec::with_capacity(plan.ticks() as usize + 1);
    let mut rows: Vec<Vec<Row>> = plans.iter().map(room).collect();
    let crashes = until_crash(plans, |number, row| rows[number].push(*row));
    let flown = plans.iter().zip(rows).zip(crashes);
    let watched = flown.map(|((plan, rows), crash)| {
        let crash = crash?;
        let recording = Recording { rows, period_s: plan.config.sample_time_s, complete: crash.is_none() };
        Ok(Watched { recording, crash })
    });
    watched.collect()
}
