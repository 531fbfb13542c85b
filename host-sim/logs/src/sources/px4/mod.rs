//! PX4's topics as quantities. Frames are quadlab's own already: north-east-down, front-right-down, SI.

mod electrics;
mod epochs;
mod geometry;
mod limits;
mod mixer;
mod motion;
mod motors;
mod refusal;
mod rows;
mod spans;
mod surroundings;
mod topics;

use std::path::Path;

use crate::error::LogError;
use crate::log::Log;
use crate::recording::{Recording, Span};
use crate::spans::{both, joined};

/// All of a log.
const ALWAYS: Span = [f64::NEG_INFINITY, f64::INFINITY];

/// Finds the quantities of a PX4 log: one recording, or one for each value that a parameter has in flight.
pub(crate) fn record(log: &Log, path: &Path) -> Result<Vec<Recording>, LogError> {
    recordings(log).map_err(|reason| LogError::Refused { path: path.into(), reason })
}

fn recordings(log: &Log) -> Result<Vec<Recording>, String> {
    refusal::check(log)?;
    if log.changes.is_empty() {
        return Ok(vec![quantities(log, ALWAYS)?]);
    }
    let attitude = motion::attitude(log, &mut Vec::new());
    let Some(ends) = attitude.as_ref().and_then(|signal| ends(&signal.t)) else {
        return Err(refusal::no_attitude(log));
    };
    let (epochs, notes) = epochs::epochs(log, &spans::airborne(log, ends))?;
    if epochs.iter().all(|epoch| epoch.parameters == log.parameters) {
        return Ok(vec![quantities(log, ALWAYS)?]);
    }
    let mut log = log.clone();
    let mut recordings = Vec::new();
    for epoch in epochs {
        log.parameters = epoch.parameters;
        let mut recording = quantities(&log, epoch.span)?;
        recording.notes.extend(notes.iter().cloned());
        recordings.push(recording);
    }
    Ok(recordings)
}

/// The quantities of what is flown within a part of the log.
fn quantities(log: &Log, part: Span) -> Result<Recording, String> {
    let layout = geometry::layout(&log.parameters)?;
    let mut recording = Recording::default();
    recording.signals.attitude = motion::attitude(log, &mut recording.notes);
    let Some([first, last]) = recording.signals.attitude.as_ref().and_then(|signal| ends(&signal.t)) else {
        return Err(refusal::no_attitude(log));
    };
    recording.airborne = both(&spans::airborne(log, [first, last]), &[part]);
    recording.dropouts = joined(log.losses.dropout_spans_s.clone());
    if recording.airborne.is_empty() {
        return Err(
            "was armed but never left the ground (vehicle_land_detected): there is no flight in it".into()
        );
    }
    motion::position_and_velocity(log, &mut recording);
    recording.signals.rates = motion::rates(log, &mut recording.notes);
    recording.signals.specific_force = motion::specific_force(log, &mut recording.notes);
    motors::commands(log, &layout, &mut recording);
    recording.signals.rotor_speed = motors::rotor_speed(log, &layout, &mut recording.notes);
    electrics::voltage(log, &mut recording);
    recording.hints.name = name(log);
    recording.hints.cells = electrics::cells(log);
    recording.hints.spin = Some(layout.spin);
    recording.hints.rotor_positions_m = layout.positions_m;
    recording.hints.air_density = surroundings::air_density(log);
    recording.hints.gravity = surroundings::gravity(log);
    limits::add(&mut recording);
    Ok(recording)
}

/// First and last of a list.
fn ends(t: &[f64]) -> Option<[f64; 2]> {
    Some([*t.first()?, *t.last()?])
}

/// What the log knows that tells crafts apart: PX4 has no name for them.
fn name(log: &Log) -> Option<String> {
    let board = log.information.get("ver_hw")?;
    Some(match log.parameters.get("SYS_AUTOSTART") {
        Some(airframe) => format!("{board} airframe {airframe}"),
        None => board.clone(),
    })
}
