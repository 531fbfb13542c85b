//! Flights that are watched for a crash, and whether one was to be expected of physics.

use std::fmt;

use control::supervision_limits::Fence;
use design::plant::{TrimTarget, equilibrium};
use model::Plant;
use proto::State;

use super::crash::{Crash, Watch};
use crate::craft::FaultKind;
use crate::flight::{ClosedLoop, FlightPlan, Row, SilError};

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

/// By how much the faults of a plan weaken a motor, command units.
fn weakness(plan: &FlightPlan) -> f64 {
    let of = |kind| match kind {
        FaultKind::MotorsWeak(by) | FaultKind::MotorWeak(_, by) => f64::from(by),
        _ => 0.0,
    };
    plan.faults.iter().map(|fault| of(fault.kind)).sum()
}

/// How far off the faults of a plan let the tracker see the craft, m.
pub(super) fn tracker_off_m(plan: &FlightPlan) -> [f64; 3] {
    let of = |kind| match kind {
        FaultKind::PoseShifted(by) => Some(by.map(f64::from)),
        _ => None,
    };
    plan.faults.iter().find_map(|fault| of(fault.kind)).unwrap_or_default()
}

/// Flies a plan to its end or its crash, and shows each tick; how it crashed, and after how many s. There are walls unless the
/// supervisor has no fence.
///
/// # Errors
/// A plan or configuration that cannot be flown.
pub(super) fn until_crash(
    plan: &FlightPlan,
    tracker_off_m: [f64; 3],
    mut see: impl FnMut(&Row),
) -> Result<Option<(Crash, f64)>, SilError> {
    let period_s = plan.config.sample_time_s;
    let mut flight = ClosedLoop::in_process(plan)?;
    let watch = Watch::new(period_s, -plan.start_m[2], State::Flying);
    let caged = plan.config.supervision.fence != Fence::NONE;
    let mut watch = watch.with_tracker_off(tracker_off_m).with_walls(caged);
    for tick in 0..=plan.ticks() {
        let row = flight.step()?;
        see(&row);
        let position_m = row.truth.position_m.map(f64::from);
        if let Some(crash) = watch.look(position_m, row.supervision.state, row.supervision.conditions) {
            return Ok(Some((crash, f64::from(tick) * period_s)));
        }
    }
    Ok(None)
}

/// A flight that was watched.
#[derive(Debug, Clone)]
pub struct Watched {
    /// Every tick, to its end or its crash.
    pub recording: crate::flight::Recording,
    /// How it crashed, and after how many s.
    pub crash: Option<(Crash, f64)>,
}

/// Flies a plan to its end or its crash.
///
/// # Errors
/// A plan or configuration that cannot be flown.
pub fn fly_watched(plan: &FlightPlan) -> Result<Watched, SilError> {
    let mut rows = Vec::with_capacity(plan.ticks() as usize + 1);
    let crash = until_crash(plan, tracker_off_m(plan), |row| rows.push(*row))?;
    let recording =
        crate::flight::Recording { rows, period_s: plan.config.sample_time_s, complete: crash.is_none() };
    Ok(Watched { recording, crash })
}
