//! When the craft was armed and flew.

use crate::log::Log;
use crate::recording::Span;
use crate::spans::{both, joined};

use super::rows::Rows;
use super::topics::topic;

/// When the craft was armed, s; empty where it never was, none where the log does not say.
pub(super) fn armed(log: &Log) -> Option<Vec<Span>> {
    const ARMED: [(&str, &str, f64); 2] =
        [("vehicle_status", "arming_state", 2.0), ("actuator_armed", "armed", 1.0)];
    let mut said = None;
    for (name, column, value) in ARMED {
        let spans = states(log, name, column, |state| state == value);
        if said.as_ref().is_none_or(Vec::is_empty) {
            said = spans.or(said);
        }
    }
    said
}

/// When the craft was armed and not on the ground, s, within a span of the log.
pub(super) fn airborne(log: &Log, [first, last]: Span) -> Vec<Span> {
    let whole = || vec![[first, last]];
    let armed = armed(log).unwrap_or_else(whole);
    let off_ground =
        states(log, "vehicle_land_detected", "landed", |landed| landed == 0.0).unwrap_or_else(whole);
    both(&both(&armed, &off_ground), &whole())
}

/// When a state held. It holds from its row on, the first one from the beginning, the last one to the end.
fn states(log: &Log, name: &str, column: &str, holds: impl Fn(f64) -> bool) -> Option<Vec<Span>> {
    let table = topic(log, name)?;
    let rows = Rows::of_events(table);
    let values = rows.pick(table.column(column)?);
    let mut times = rows.times_s();
    *times.first_mut()? = f64::NEG_INFINITY;
    times.push(f64::INFINITY);
    let held = values.iter().zip(times.windows(2)).filter(|(value, _)| holds(**value));
    Some(joined(held.map(|(_, pair)| [pair[0], pair[1]]).collect()))
}
