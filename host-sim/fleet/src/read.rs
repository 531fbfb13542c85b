//! A file read once: what is kept of each of its flights.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use diagnosis::workflow::{LoadedFlight, WorkflowError};
use model::{Group, Vehicle};
use sysid::{Fault, FaultKind, Prepared, Reference as Clock, Severity};

use crate::equations::{AxisEquations, Equations};
use crate::error::{one_line, without_path};
use crate::layout::READING;
use crate::reference::Reference;
use crate::row::{LoggerFault, Row, State};
use crate::when;

/// The rows of a file's flights, without where the file lies. `reference` is the craft's, where it has one.
pub(crate) fn rows(
    bytes: Vec<u8>,
    path: &Path,
    vehicle: &Vehicle,
    reference: Option<&Reference>,
) -> Vec<Row> {
    // A log that the readers cannot cope with is that log's matter, and not the fleet's.
    let read = || read(bytes, path, vehicle, reference);
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| {
        let why = "the program failed on this file, which is a defect of the program: please report it";
        vec![Row::without_flight(State::NotReadable, why.into())]
    })
}

fn read(bytes: Vec<u8>, path: &Path, vehicle: &Vehicle, reference: Option<&Reference>) -> Vec<Row> {
    let (flights, import) = match LoadedFlight::all_of_bytes(bytes, path, vehicle, READING) {
        Ok(read) => read,
        Err(why) => return vec![Row::without_flight(State::NotReadable, without_path(path, &one_line(why)))],
    };
    let began = |part: usize| {
        let import = import.as_ref()?;
        Some(when::of_log(import, import.flights.get(part)?.span[0])?.unix_s)
    };
    let row = |(part, flight): (usize, Result<LoadedFlight, WorkflowError>)| {
        let mut row = match flight {
            Ok(flight) => of_flight(flight, reference),
            Err(why) => Row::without_flight(State::Refused, without_path(path, &one_line(why))),
        };
        (row.part, row.logged_unix_s) = (part, began(part));
        row
    };
    flights.into_iter().enumerate().map(row).collect()
}

fn of_flight(flight: LoadedFlight, reference: Option<&Reference>) -> Row {
    let LoadedFlight { mut prepared, faults, taken, .. } = flight;
    let kept = faults.iter().map(|fault| LoggerFault {
        kind: fault.kind.id().into(),
        severity: fault.severity,
        sentence: fault.sentence.clone(),
    });
    let refused = faults.iter().find(|fault| fault.severity == Severity::Refused);
    let mut row = match (refused, reference) {
        (Some(fault), _) => Row::without_flight(State::Refused, fault.sentence.clone()),
        (None, None) => Row::without_flight(State::NoModel, "the craft has no model".into()),
        (None, Some(_)) => Row::without_flight(State::Used, String::new()),
    };
    row.faults = kept.collect();
    row.name.clone_from(&prepared.name);
    row.parts_s = taken.parts.concat();
    row.airborne_s = taken.parts.iter().map(|[from, to]| to - from).sum();
    row.period_s = prepared.period_s;
    if let (State::Used, Some(Reference { model, columns, .. })) = (row.state, reference) {
        let delay_s = model.fit.as_ref().and_then(|fit| fit.rotor_delay_s);
        sysid::align_to(model, &mut [&mut prepared], Clock::Model(delay_s));
        row.late_s = prepared.alignment.as_ref().map_or(f64::NAN, |alignment| alignment.late_s);
        row.equations = Equations::of(&prepared, model, columns);
        if faults.iter().any(no_rotation) {
            let rotation = Group::Rotation.axes();
            rotation.for_each(|axis| row.equations.axes[axis.index()] = AxisEquations::default());
        }
    }
    let volts = || prepared.stretches.iter().flat_map(|stretch| &stretch.battery_v);
    if prepared.has_voltage {
        row.mean_v = prepared.mean_battery_v();
        row.lowest_v = volts().copied().fold(f64::INFINITY, f64::min);
    }
    if prepared.has_commands {
        (row.motor_shares, row.mean_command) = shares(&prepared);
    }
    row
}

/// Whether a fault says that no rotation can be fitted to a flight.
fn no_rotation(fault: &Fault) -> bool {
    fault.kind == FaultKind::WanderingClock && fault.severity != Severity::Note
}

/// Each motor's part of the mean command, and that.
fn shares(flight: &Prepared) -> ([f64; 4], f64) {
    let samples: usize = flight.stretches.iter().map(|stretch| stretch.time_s.len()).sum();
    let mean = |motor: usize| {
        let all = flight.stretches.iter().flat_map(|stretch| &stretch.command[motor]);
        all.sum::<f64>() / samples.max(1) as f64
    };
    let means = [0, 1, 2, 3].map(mean);
    let all = means.iter().sum::<f64>() / 4.0;
    (means.map(|own| own / all), all)
}
