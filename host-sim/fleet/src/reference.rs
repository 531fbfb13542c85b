//! The model about which all flights of a craft are looked at.
//!
//! It holds what a fit from normal equations cannot move: the lag of the motors, dead times, winds, and the clock that offsets of
//! flights are counted from. It is `model.toml` in the craft's folder where there is one, else the basic model identified from a few
//! of its flights, spread over all of them. It is made once and stays while flights come and go, unless the craft changed between two
//! of these flights ([`crate::sides`]).

use std::path::{Path, PathBuf};

use diagnosis::workflow::{
    FlightSets, FlightsOfOneKind, LoadedFlight, Observer, Progress, Silent, identify, sha256,
};
use model::Model;
use sysid::Severity;

use crate::equations::{Columns, Parameter};
use crate::error::{FleetError, one_line};
use crate::layout::{Craft, Fleet, READING};
use crate::row::Row;

/// Flights that a reference is identified from, and files that are tried for them.
const FLIGHTS: usize = 6;
const TRIED: usize = 30;
/// Of so many flights one is held out.
const HELD_OUT: usize = 3;
/// A change of how flights are prepared and kept is a new number: all are read again.
const PREPARATION: &str = "2";

/// A reference model.
#[derive(Debug, Clone)]
pub struct Reference {
    /// The model.
    pub model: Model,
    /// What flights have columns for about it.
    pub columns: Columns,
    /// Of vehicle file, model and the way flights are prepared.
    pub(crate) context: String,
}

impl Reference {
    /// From the text that is kept.
    pub(crate) fn of_text(text: &str, craft: &Craft, path: &Path) -> Result<Self, FleetError> {
        let model = Model::parse(text, path).map_err(|why| FleetError::content(path, why))?;
        let columns = Columns::about(&model);
        let names: Vec<String> = columns.parameters.iter().map(Parameter::name).collect();
        let context = context(craft, &format!("{text}\n{}", names.join(" ")));
        Ok(Self { model, columns, context })
    }

    /// Identifies one from a few flights of a craft: of all that are not excluded, or `among` some that are known.
    ///
    /// # Errors
    /// A sentence: why these flights give no model.
    pub(crate) fn identified(
        fleet: &Fleet,
        craft: &Craft,
        among: Option<&[&Row]>,
        observer: &dyn Observer,
    ) -> Result<String, String> {
        let activity = format!("{}: a first model", craft.name);
        observer.progress(Progress { activity: &activity, steps: None });
        let mut flights: Vec<LoadedFlight> = Vec::new();
        for path in spread(&files(fleet, craft, among)).into_iter().take(TRIED) {
            if observer.is_cancelled() {
                return Err(FleetError::Cancelled.to_string());
            }
            let paths = [path.clone()];
            let Ok(read) = FlightsOfOneKind::read(&paths, &craft.vehicle, READING, &Silent) else { continue };
            let file = fleet.relative(path);
            let is_asked = |flight: &LoadedFlight| {
                among.is_none_or(|rows| {
                    rows.iter().any(|row| row.file == file && row.name == flight.prepared.name)
                })
            };
            let good = |flight: &LoadedFlight| {
                is_good(flight)
                    && is_asked(flight)
                    && flights.iter().all(|known| known.sha256 != flight.sha256)
            };
            let read: Vec<LoadedFlight> = read.flights.into_iter().filter(good).collect();
            flights.extend(read);
            if flights.len() >= FLIGHTS {
                break;
            }
        }
        let mut sets = sets_of(flights, craft)?;
        let found = identify(&craft.vehicle, &[], &mut sets, None, &Silent);
        found.map(|found| found.model.to_toml()).map_err(one_line)
    }
}

/// The files to look for flights in.
fn files(fleet: &Fleet, craft: &Craft, among: Option<&[&Row]>) -> Vec<PathBuf> {
    match among {
        None => {
            let is_used = |path: &&PathBuf| !fleet.settings.excludes(&fleet.relative(path));
            craft.files.iter().filter(is_used).cloned().collect()
        }
        Some(rows) => {
            let mut files: Vec<PathBuf> = rows.iter().map(|row| fleet.folder.join(&row.file)).collect();
            files.dedup();
            files
        }
    }
}

/// Whether conclusions from a flight are right.
pub(crate) fn is_good(flight: &LoadedFlight) -> bool {
    flight.faults.iter().all(|fault| fault.severity != Severity::Refused)
}

/// Flights to fit on and to judge by.
pub(crate) fn sets_of(flights: Vec<LoadedFlight>, craft: &Craft) -> Result<FlightSets, String> {
    if let [only] = &flights[..] {
        let paths = [only.path.clone()];
        return FlightSets::split(&paths, &craft.vehicle, READING, &Silent).map_err(one_line);
    }
    if flights.is_empty() {
        return Err("none of its flights can be used".into());
    }
    let last = flights.len() - 1;
    let is_held_out = |k: usize| k % HELD_OUT == HELD_OUT - 1 || last < HELD_OUT - 1 && k == last;
    let (mut train, mut validate) = (Vec::new(), Vec::new());
    for (k, flight) in flights.into_iter().enumerate() {
        if is_held_out(k) { validate.push(flight) } else { train.push(flight) }
    }
    FlightSets::from_loaded(train, validate, &craft.vehicle, READING).map_err(one_line)
}

/// What rows of a craft depend on beside their file.
pub(crate) fn context(craft: &Craft, reference: &str) -> String {
    let vehicle = sha256(&craft.vehicle_bytes);
    sha256(format!("{PREPARATION}\n{vehicle}\n{reference}").as_bytes())
}

/// The files in an order in which the first few are spread over all of them.
fn spread(files: &[PathBuf]) -> Vec<&PathBuf> {
    let count = files.len();
    let mut order: Vec<usize> = (0..FLIGHTS).map(|k| (2 * k + 1) * count / (2 * FLIGHTS)).collect();
    order.extend(0..count);
    let mut taken = vec![false; count];
    let first_time = |k: &usize| *k < count && !std::mem::replace(&mut taken[*k], true);
    order.into_iter().filter(first_time).map(|k| &files[k]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_files_are_spread_over_all_and_none_comes_twice() {
        let files: Vec<PathBuf> = (0..60).map(|k| format!("{k:02}.csv").into()).collect();
        let order = spread(&files);
        let first: Vec<&str> = order[..FLIGHTS].iter().map(|path| path.to_str().unwrap()).collect();
        assert_eq!(first, ["05.csv", "15.csv", "25.csv", "35.csv", "45.csv", "55.csv"]);
        assert_eq!(order.len(), 60);
        assert_eq!(spread(&files[..2]).len(), 2);
        assert!(spread(&[]).is_empty());
    }
}
