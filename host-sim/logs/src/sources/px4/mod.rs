//! PX4's topics as quantities. Frames are quadlab's own already: north-east-down, front-right-down, SI.

mod electrics;
mod geometry;
mod limits;
mod mixer;
mod motion;
mod motors;
mod refusal;
mod rows;
mod spans;
mod surroundings;

use std::path::Path;

use crate::error::LogError;
use crate::log::{Log, Table};
use crate::recording::Recording;

/// Finds the quantities of a PX4 log.
pub(crate) fn record(log: &Log, path: &Path) -> Result<Recording, LogError> {
    quantities(log).map_err(|reason| LogError::Refused { path: path.into(), reason })
}

fn quantities(log: &Log) -> Result<Recording, String> {
    refusal::check(log)?;
    let layout = geometry::layout(&log.parameters)?;
    let mut recording = Recording::default();
    recording.signals.attitude = motion::attitude(log, &mut recording.notes);
    let Some([first, last]) = recording.signals.attitude.as_ref().and_then(|signal| ends(&signal.t)) else {
        return Err(refusal::no_attitude(log));
    };
    recording.airborne = spans::airborne(log, [first, last]);
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

/// The lowest instance of a topic that has rows.
fn topic<'a>(log: &'a Log, name: &str) -> Option<&'a Table> {
    instances(log, name).next()
}

/// All instances of a topic, in the order of the log.
fn instances<'a>(log: &'a Log, name: &str) -> impl Iterator<Item = &'a Table> {
    let mut tables: Vec<_> =
        log.tables.iter().filter(|table| topic_of(table) == name && table.rows > 0).collect();
    tables.sort_by_key(|table| instance_of(table));
    tables.into_iter()
}

/// The topic of a table: its name without the instance.
fn topic_of(table: &Table) -> &str {
    table.name.split_once('[').map_or(table.name.as_str(), |(topic, _)| topic)
}

fn instance_of(table: &Table) -> u8 {
    let instance =
        table.name.split_once('[').and_then(|(_, instance)| instance.trim_end_matches(']').parse().ok());
    instance.unwrap_or(0)
}

/// What the log knows that tells crafts apart: PX4 has no name for them.
fn name(log: &Log) -> Option<String> {
    let board = log.information.get("ver_hw")?;
    Some(match log.parameters.get("SYS_AUTOSTART") {
        Some(airframe) => format!("{board} airframe {airframe}"),
        None => board.clone(),
    })
}
