//! Flights that are watched for a crash, and whether one was to be expected of physics.

use std::fmt;

use control::supervision_limits::Fence;
use design::plant::{TrimTarget, equilibrium, hover_nearby};
use model::Plant;
use proto::State;

use super::crash::{Crash, Watch};
use crate::craft::FaultKind;
use crate::flight::{FlightPlan, Recording, Row, SilError, fly_side_by_side};

/// What the optimiser leaves of the derivatives' squares where there is an equilibrium, SI squared.
const BALANCED: f64 = 1e-6;

/// What two equilibria of a craft at rest may differ by in what they ask of a motor, with much to spare, command units.
const SPARE: f64 = 1.0;

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
    let even_v = lowest_v(plan, &[plan.battery.hover_speed_rad_s; 4]);
    let target = TrimTarget { battery_v: Some(even_v), ..TrimTarget::default() };
    let [_, greatest] = plan.config.command_range;
    // Nearly every craft hovers near level with much to spare, and nobody asks by how much: the search for the last digits is for others.
    if hover_nearby(&plan.model, &target).is_some_and(|rotor| asked(plan, &rotor) < greatest - SPARE) {
        return None;
    }
    let Some(hover) = equilibrium(&plan.model, &target).ok().filter(|hover| hover.cost < BALANCED) else {
        return Some(Impossible::NoEquilibrium);
    };
    let (asked, lowest_v) = (asked(plan, &hover.rotor_rad_s), lowest_v(plan, &hover.rotor_rad_s));
    (asked > greatest).then_some(Impossible::TooWeak { asked, greatest, lowest_v })
}

/// The lowest voltage of the flight of a plan with these rotor speeds, V.
fn lowest_v(plan: &FlightPlan, rotor_rad_s: &[f64; 4]) -> f64 {
    plan.battery.voltage_v(plan.duration_s, rotor_rad_s)
}

/// The most that these rotor speeds ask of a motor at the lowest voltage, command units.
fn asked(plan: &FlightPlan, rotor_rad_s: &[f64; 4]) -> f64 {
    let commands = Plant::new(&plan.model).command_for(rotor_rad_s, lowest_v(plan, rotor_rad_s));
    commands.into_iter().fold(f64::NEG_INFINITY, f64::max) + weakness(plan)
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
pub type Crashed = Option<(Crash, f64)>;

/// Who looks at many flights side by side, each by its number.
pub trait Observer {
    /// What is made of a flight.
    type Made;

    /// A tick of a flight.
    fn tick(&mut self, number: usize, row: &Row);

    /// The end of a flight, when its last tick was seen.
    fn end(&mut self, number: usize, crash: Crashed) -> Self::Made;
}

/// Flies plans to their ends or crashes, side by side: each as if it was alone, to the bit, but many take less time together. There are
/// walls unless the supervisor has no fence. What comes of each is an error where its plan or configuration cannot be flown.
pub fn until_crash<O: Observer>(plans: &[&FlightPlan], observer: &mut O) -> Vec<Result<O::Made, SilError>> {
    let begun = |plan: &&FlightPlan| {
        let watch = Watch::new(plan.config.sample_time_s, -plan.start_m[2], State::Flying);
        let caged = plan.config.supervision.fence != Fence::NONE;
        (watch.with_tracker_off(tracker_off_m(plan)).with_walls(caged), 0_u32)
    };
    let mut watches: Vec<(Watch, u32)> = plans.iter().map(begun).collect();
    let mut all: Vec<Option<O::Made>> = plans.iter().map(|_| None).collect();
    let results = fly_side_by_side(plans, |number, row| {
        observer.tick(number, row);
        let (watch, tick) = &mut watches[number];
        let position_m = row.truth.position_m.map(f64::from);
        let crash = watch.look(position_m, row.supervision.state, row.supervision.conditions);
        let crash = crash.map(|crash| (crash, f64::from(*tick) * plans[number].config.sample_time_s));
        let goes_on = crash.is_none();
        if !goes_on || *tick == plans[number].ticks() {
            all[number] = Some(observer.end(number, crash));
        }
        *tick += 1;
        goes_on
    });
    // Every flight that can be flown has a last tick; one without would end here.
    let mut made =
        |(number, own): (usize, Option<O::Made>)| own.unwrap_or_else(|| observer.end(number, None));
    results
        .into_iter()
        .zip(all.into_iter().enumerate())
        .map(|(result, own)| result.map(|()| made(own)))
        .collect()
}

/// A flight that was watched.
#[derive(Debug, Clone)]
pub struct Watched {
    /// Every tick, to its end or its crash.
    pub recording: Recording,
    /// How it crashed, and after how many s.
    pub crash: Option<(Crash, f64)>,
}

/// Flies plans as [`until_crash`] does, and records them. Of each flight, by its number, `make` makes what is wanted of it when it ends,
/// and gives back rows, its own or none, whose memory a later flight has: fresh memory for rows costs more than a fast flight's plant.
pub fn fly_watched<T>(
    plans: &[&FlightPlan],
    make: impl FnMut(usize, Watched) -> (T, Vec<Row>),
) -> Vec<Result<T, SilError>> {
    let rows = plans.iter().map(|_| Vec::new()).collect();
    until_crash(plans, &mut Recorder { plans, rows, free: Vec::new(), make })
}

/// Records flights.
struct Recorder<'a, F> {
    plans: &'a [&'a FlightPlan],
    /// Of each flight, while it lasts.
    rows: Vec<Vec<Row>>,
    /// Memory that nobody uses now.
    free: Vec<Vec<Row>>,
    make: F,
}

impl<T, F: FnMut(usize, Watched) -> (T, Vec<Row>)> Observer for Recorder<'_, F> {
    type Made = T;

    #[inline]
    fn tick(&mut self, number: usize, row: &Row) {
        let rows = &mut self.rows[number];
        if rows.is_empty() {
            *rows = self.free.pop().unwrap_or_default();
            rows.clear();
            rows.reserve_exact(self.plans[number].ticks() as usize + 1);
        }
        rows.push(*row);
    }

    fn end(&mut self, number: usize, crash: Crashed) -> T {
        let rows = std::mem::take(&mut self.rows[number]);
        let period_s = self.plans[number].config.sample_time_s;
        let recording = Recording { rows, period_s, complete: crash.is_none() };
        let (made, rows) = (self.make)(number, Watched { recording, crash });
        self.free.push(rows);
        made
    }
}
