//! Parameters that change while the log is written: what is used of them holds from one change to the next.

use std::collections::BTreeMap;

use crate::log::Log;
use crate::recording::Span;
use crate::spans::both;

/// Beginnings of the names of parameters that say where motors are and what their commands mean.
const USED: [&str; 4] = ["CA_", "PWM_", "UAVCAN_EC_FUNC", "SYS_AUTOSTART"];
/// More parts of a flight are no tuning but damage.
const MOST: usize = 16;

/// A part of the log in which the parameters that are used stay as they are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Epoch {
    /// From when to when, s.
    pub(super) span: Span,
    /// The parameters.
    pub(super) parameters: BTreeMap<String, f64>,
    /// What was set at its beginning, a sentence each.
    changes: Vec<String>,
}

/// The parts of the log in which the craft flies with the same parameters; and what changed between them, a sentence each.
/// What is set before take-off holds for the flight and needs no part of its own.
pub(super) fn epochs(log: &Log, airborne: &[Span]) -> Result<(Vec<Epoch>, Vec<String>), String> {
    let all = between_changes(log);
    let (mut flown, mut notes): (Vec<Epoch>, Vec<String>) = (Vec::new(), Vec::new());
    let mut since = Vec::new();
    for epoch in all {
        since.extend(epoch.changes.iter().cloned());
        if both(airborne, &[epoch.span]).is_empty() {
            continue;
        }
        // Since the flight before; what was set before the first one is no change of anything.
        let told = std::mem::take(&mut since);
        if !flown.is_empty() {
            notes.extend(told);
        }
        flown.push(epoch);
    }
    if flown.len() > MOST {
        return Err(format!(
            "has its motors' parameters (CA_, PWM_) set anew {} times in flight: they cannot be relied on; \
             fly with fixed ones",
            flown.len() - 1
        ));
    }
    Ok((flown, notes))
}

fn between_changes(log: &Log) -> Vec<Epoch> {
    let mut epochs = vec![Epoch {
        span: [f64::NEG_INFINITY, f64::INFINITY],
        parameters: log.parameters.clone(),
        changes: Vec::new(),
    }];
    for change in &log.changes {
        let Some(now) = epochs.last_mut() else { break };
        let before = now.parameters.get(&change.name).copied();
        if !USED.iter().any(|start| change.name.starts_with(start)) || before == Some(change.value) {
            continue;
        }
        let was = before.map_or("not set".into(), |before| before.to_string());
        let (name, time_s, value) = (&change.name, change.time_s, change.value);
        let said = format!(
            "{name} was set from {was} to {value} at {time_s:.1} s: what is flown from then on is another flight, read with the \
             new value; the vehicle file has the first one"
        );
        if time_s > now.span[0] {
            now.span[1] = time_s;
            let mut next = now.clone();
            (next.span, next.changes) = ([time_s, f64::INFINITY], Vec::new());
            epochs.push(next);
        }
        if let Some(now) = epochs.last_mut() {
            now.parameters.insert(name.clone(), value);
            now.changes.push(said);
        }
    }
    epochs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Format;
    use crate::log::ParameterChange;

    fn changed(changes: &[(f64, &str, f64)]) -> Log {
        let mut log = Log::new(Format::Ulog);
        log.parameters.insert("PWM_MIN".into(), 1000.0);
        let one =
            |&(time_s, name, value): &(f64, &str, f64)| ParameterChange { time_s, name: name.into(), value };
        log.changes = changes.iter().map(one).collect();
        log
    }

    #[test]
    fn what_is_set_before_take_off_holds_and_what_is_set_in_flight_splits_it() {
        let log = changed(&[
            (3.0, "PWM_MIN", 1100.0),
            (12.0, "MC_ROLLRATE_P", 0.2),
            (15.0, "PWM_MIN", 1100.0),
            (20.0, "PWM_MIN", 1150.0),
            (20.0, "PWM_MAX", 1900.0),
            (50.0, "PWM_MIN", 1000.0),
        ]);
        let (epochs, notes) = epochs(&log, &[[10.0, 40.0]]).unwrap();
        assert_eq!(epochs.iter().map(|e| e.span).collect::<Vec<_>>(), [[3.0, 20.0], [20.0, 50.0]]);
        let of = |k: usize, name: &str| epochs[k].parameters.get(name).copied();
        assert_eq!((of(0, "PWM_MIN"), of(0, "PWM_MAX")), (Some(1100.0), None));
        assert_eq!((of(1, "PWM_MIN"), of(1, "PWM_MAX")), (Some(1150.0), Some(1900.0)));
        assert!(notes[0].starts_with("PWM_MIN was set from 1100 to 1150 at 20.0 s"), "{notes:?}");
    }

    #[test]
    fn parameters_that_never_rest_are_refused() {
        let changes: Vec<(f64, &str, f64)> =
            (0..40).map(|k| (f64::from(k), "PWM_MIN", f64::from(k))).collect();
        assert!(epochs(&changed(&changes), &[[0.0, 100.0]]).unwrap_err().contains("set anew 39 times"));
    }
}
