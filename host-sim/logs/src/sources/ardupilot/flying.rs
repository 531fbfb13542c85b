//! When the craft flew, and when its estimator was not sure of itself.

use crate::log::Log;
use crate::recording::{Recording, Signal, Span};

use super::rows::Rows;
use crate::spans::{both, joined, length_s, where_holds, widened};

/// Events: armed, disarmed, landed, off the ground, heading of the estimator reset.
const ARMED: f64 = 10.0;
const DISARMED: f64 = 11.0;
const LANDED: f64 = 18.0;
const NOT_LANDED: f64 = 28.0;
const YAW_RESET: f64 = 62.0;
/// Motors that are slower for less than this still carry a craft that falls, s.
const SHORT_IDLE_S: f64 = 1.0;
/// Before and after a jump of the estimate, s.
const JUMP_S: Span = [0.2, 0.4];

/// When the craft was off the ground, s: as it says, and its motors above idle.
pub(super) fn airborne(log: &Log, commands: Option<&Signal<4>>, range: Span) -> Vec<Span> {
    let said = said_to_fly(log);
    let Some(commands) = commands else { return said.unwrap_or_default() };
    // A little above the command of motors that just turn.
    let idle =
        log.parameters.get("MOT_SPIN_MIN").copied().filter(|idle| (0.0..0.5).contains(idle)).unwrap_or(0.15)
            + 0.02;
    let least = range[0] + idle * (range[1] - range[0]);
    let mean = |row: usize| commands.values.iter().map(|motor| motor[row]).sum::<f64>() / 4.0;
    let up = where_holds(&commands.t, |row| mean(row) > least, SHORT_IDLE_S);
    match said {
        Some(said) => both(&said, &up),
        None => up,
    }
}

/// From leaving the ground to landing; from arming where the log does not tell when it left. None without events.
fn said_to_fly(log: &Log) -> Option<Vec<Span>> {
    let rows = Rows::of(log.table("EV")?, |_| true);
    let events: Vec<(f64, f64)> = rows.t.iter().copied().zip(rows.column("Id")?).collect();
    let start = if events.iter().any(|(_, id)| *id == NOT_LANDED) { NOT_LANDED } else { ARMED };
    let ends = |id: f64| id == LANDED || id == DISARMED;
    let mut since = None;
    let mut spans = Vec::new();
    let relevant = events.iter().filter(|(_, id)| *id == start || ends(*id));
    for (index, &(t, id)) in relevant.enumerate() {
        if ends(id) {
            // A log that begins in the air.
            let from = since.take().or((index == 0).then_some(f64::NEG_INFINITY));
            spans.extend(from.map(|from| [from, t]));
        } else {
            since.get_or_insert(t);
        }
    }
    spans.extend(since.map(|since| [since, f64::INFINITY]));
    (!spans.is_empty()).then(|| joined(spans))
}

/// The table of an estimator's health.
fn health<'log>(log: &'log Log, estimator: &str) -> Option<Rows<'log>> {
    log.table(&format!("{}4", estimator.trim_end_matches('1'))).map(Rows::first_instance)
}

/// When the estimate was not to be trusted, s: faults, attitude lost, GPS glitches, measurements rejected, jumps.
/// The second list is when the attitude was not.
pub(super) fn untrusted(log: &Log, estimator: &str) -> [Vec<Span>; 2] {
    let (mut spans, mut of_attitude) = (Vec::new(), Vec::new());
    if let Some(rows) = health(log, estimator) {
        let column = |name: &str| rows.column(name).unwrap_or_else(|| vec![0.0; rows.t.len()]);
        let (status, faults) = (rows.column("SS"), column("FS"));
        let ratios = ["SV", "SP", "SH"].map(column);
        // Two of velocity, position and height rejected.
        let rejects = |row: usize| ratios.iter().filter(|ratio| ratio[row] >= 1.0).count() >= 2;
        let status = |row: usize| status.as_ref().map(|status| Status(status[row] as u64));
        let lost = |row: usize| status(row).is_some_and(Status::attitude_is_lost) || faults[row] != 0.0;
        let bad = |row: usize| status(row).is_some_and(Status::glitches) || lost(row) || rejects(row);
        of_attitude.extend(widened(&where_holds(&rows.t, lost, SHORT_IDLE_S), JUMP_S));
        spans.extend(widened(&where_holds(&rows.t, bad, SHORT_IDLE_S), JUMP_S));
        // What the estimator added to its position since the row before.
        for offset in
            [rows.column("OFN"), rows.column("OFE").or_else(|| rows.column("EFE"))].into_iter().flatten()
        {
            let jumps = offset.windows(2).zip(rows.t.windows(2)).filter(|(offset, _)| offset[0] != offset[1]);
            spans.extend(jumps.map(|(_, t)| [t[0], t[1]]));
        }
    }
    let turned = turns(log);
    of_attitude.extend(&turned);
    spans.extend(turned);
    spans.extend(of_errors(log));
    [joined(spans), joined(of_attitude)]
}

/// When the attitude jumped: the heading was reset, or another core took over.
fn turns(log: &Log) -> Vec<Span> {
    const EKF_PRIMARY: f64 = 24.0;
    let when = |table: &str, column: &str, value: f64| -> Vec<Span> {
        let Some(rows) = log.table(table).map(|table| Rows::of(table, |_| true)) else { return Vec::new() };
        let values = rows.column(column).unwrap_or_default();
        let found = rows.t.iter().zip(values).filter(|(_, of_row)| *of_row == value);
        found.map(|(&t, _)| [t, t]).collect()
    };
    widened(&[when("EV", "Id", YAW_RESET), when("ERR", "Subsys", EKF_PRIMARY)].concat(), JUMP_S)
}

/// What errors say of the estimate.
fn of_errors(log: &Log) -> Vec<Span> {
    const CRASH_CHECK: f64 = 12.0;
    const EKF_CHECK: f64 = 16.0;
    let mut spans = Vec::new();
    let errors = log.table("ERR").map(|table| Rows::of(table, |_| true));
    let Some((rows, [subsystems, codes])) =
        errors.and_then(|rows| rows.group(["Subsys", "ECode"]).map(|group| (rows, group)))
    else {
        return spans;
    };
    let mut since = None;
    for ((&t, subsystem), code) in rows.t.iter().zip(subsystems).zip(codes) {
        if code > 0.0 && (subsystem == EKF_CHECK || subsystem == CRASH_CHECK) {
            since.get_or_insert(t);
        } else if subsystem == EKF_CHECK {
            spans.extend(since.take().map(|since| [since, t]));
        }
    }
    spans.extend(since.map(|since| [since, f64::INFINITY]));
    spans
}

/// What the estimator says of its solution, a bit each.
#[derive(Clone, Copy)]
struct Status(u64);

impl Status {
    fn bit(self, bit: u32) -> bool {
        self.0 >> bit & 1 == 1
    }

    fn attitude_is_lost(self) -> bool {
        !self.bit(0)
    }

    /// GPS is used, and glitches.
    fn glitches(self) -> bool {
        self.bit(13) && self.bit(14)
    }

    /// Nothing holds the position: no horizontal velocity, or the position is taken to stand still.
    fn is_blind(self) -> bool {
        !self.bit(1) || self.bit(7)
    }
}

/// Takes position and velocity out where nothing measured them for most of the flight, else does not trust
/// those stretches.
pub(super) fn drop_blind_position(log: &Log, estimator: &str, recording: &mut Recording) {
    let Some(rows) = health(log, estimator) else { return };
    let Some(status) = rows.column("SS") else { return };
    let blind = where_holds(&rows.t, |row| Status(status[row] as u64).is_blind(), SHORT_IDLE_S);
    let flown = recording.airborne.clone();
    if blind.is_empty() {
        return;
    }
    if length_s(&both(&blind, &flown)) > 0.5 * length_s(&flown) {
        recording.signals.position = None;
        recording.signals.velocity = None;
        recording.limits.push(
            "position and velocity were measured by nothing (no GPS, beacons or flow): only what the IMU shows can \
                 be fitted".into(),
        );
    } else {
        let spans = recording.untrusted.drain(..).chain(widened(&blind, JUMP_S)).collect();
        recording.untrusted = joined(spans);
    }
}
