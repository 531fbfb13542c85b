//! The flights of the folder as the page lists them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use diagnosis::workflow::{FlightsOfOneKind, LoadedFlight, Observer, Reading};
use model::{Model, Vehicle};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::numbers;

/// What a flight is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Use {
    /// Fitted on.
    Train,
    /// Held out, to judge by.
    Validate,
    /// Flown later: has the craft changed since?
    Later,
    /// Left out.
    None,
}

/// A file with one flight, or a log with one or more.
#[derive(Clone)]
pub(super) struct FlightFile {
    pub(super) path: PathBuf,
    pub(super) name: String,
    pub(super) used: Use,
    /// Its flights, or why there are none.
    pub(super) flights: Arc<Result<Vec<LoadedFlight>, String>>,
    /// All that flies of those flights of which parts are chosen.
    pub(super) whole: Arc<Vec<LoadedFlight>>,
    /// What the page shows of it, drawn once.
    summary: Value,
}

/// Points of a sparkline.
const SPARK: usize = 120;

impl FlightFile {
    /// Reads and checks a file; faults that commands refuse are told, so that they can be looked at.
    pub(super) fn read(path: &Path, vehicle: &Vehicle, used: Use, observer: &dyn Observer) -> Self {
        let reading = Reading { accept_faults: true, ..Reading::default() };
        let (flights, whole) = FlightsOfOneKind::read_used_and_whole(path, vehicle, reading, observer);
        let flights = flights.map(|all| all.flights).map_err(|error| report::error_line(&error.to_string()));
        Self::of(path, vehicle, used, flights, whole)
    }

    /// A file that is not read, and why.
    pub(super) fn unread(path: &Path, vehicle: &Vehicle, why: &str) -> Self {
        Self::of(path, vehicle, Use::None, Err(report::error_line(why)), Vec::new())
    }

    fn of(
        path: &Path,
        vehicle: &Vehicle,
        used: Use,
        flights: Result<Vec<LoadedFlight>, String>,
        whole: Vec<LoadedFlight>,
    ) -> Self {
        let summary = summary(&flights, &whole, vehicle);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Self { path: path.to_owned(), name, used, flights: flights.into(), whole: whole.into(), summary }
    }

    /// Its flights: those that can be used, and those that could be without the parts that are chosen.
    pub(super) fn known(&self) -> impl Iterator<Item = &LoadedFlight> {
        self.flights.iter().flatten().chain(self.whole.iter())
    }

    /// Whether it can be used at all.
    pub(super) fn is_usable(&self) -> bool {
        self.flights.is_ok()
    }

    /// What the page shows.
    pub(super) fn entry(&self) -> Value {
        let mut entry = self.summary.clone();
        entry["name"] = json!(self.name);
        entry["set"] = json!(if self.is_usable() { self.used } else { Use::None });
        entry
    }
}

fn summary(flights: &Result<Vec<LoadedFlight>, String>, whole: &[LoadedFlight], vehicle: &Vehicle) -> Value {
    let flights = match flights {
        Ok(flights) => flights,
        Err(why) => {
            let chosen: Vec<Value> = whole.iter().map(|flight| used(flight, &[], Some(flight))).collect();
            return json!({
                "problem": why, "flights": [], "faults": [], "columns": [], "used": chosen, "height": [], "battery": [],
            });
        }
    };
    let adjust = Model::new(vehicle.clone()).adjustments();
    let (mut height, mut battery) = (Vec::new(), Vec::new());
    let whole = |name: &str| whole.iter().find(|flight| flight.prepared.name == name);
    for flight in flights {
        let LoadedFlight { prepared, .. } = whole(&flight.prepared.name).unwrap_or(flight);
        let seen = prepared.conditions(vehicle, &adjust);
        let [_, _, down] = &seen.position_ned_m;
        height.extend(seen.time_s.iter().copied().zip(down.iter().map(|z| -z)));
        if prepared.has_voltage {
            battery.extend(seen.time_s.iter().copied().zip(seen.battery_v.iter().copied()));
        }
    }
    let parts = flights.iter().flat_map(|flight| flight.taken.parts.iter());
    let of_use = |flight: &LoadedFlight| used(flight, &flight.taken.parts, whole(&flight.prepared.name));
    let period_s = flights.iter().map(|flight| flight.prepared.period_s).fold(0.0, f64::max);
    json!({
        "problem": null,
        "flights": flights.iter().map(|flight| flight.prepared.name.as_str()).collect::<Vec<_>>(),
        "duration_s": parts.map(|[from, to]| to - from).sum::<f64>(),
        "rate_hz": 1.0 / period_s,
        "rows": flights.iter().map(|flight| flight.prepared.rows()).sum::<usize>(),
        "columns": columns(flights),
        "used": flights.iter().map(of_use).collect::<Vec<_>>(),
        "faults": flights.iter().flat_map(faults).collect::<Vec<_>>(),
        "height": numbers::thinned(&height, SPARK),
        "battery": numbers::thinned(&battery, SPARK),
    })
}

/// Which parts of a flight are used and which fly, first and last times, s.
fn used(flight: &LoadedFlight, parts: &[[f64; 2]], whole: Option<&LoadedFlight>) -> Value {
    json!({
        "flight": flight.prepared.name,
        "parts": parts,
        "flown": whole.unwrap_or(flight).taken.parts,
        "chosen": whole.is_some(),
    })
}

/// What is wrong with a flight, and where in it.
fn faults(flight: &LoadedFlight) -> impl Iterator<Item = Value> {
    flight.faults.iter().map(|fault| {
        json!({
            "flight": flight.prepared.name,
            "severity": fault.severity,
            "sentence": report::plain_line(&fault.sentence),
            "places": fault.places_s,
        })
    })
}

/// What was measured in all of the flights.
fn columns(flights: &[LoadedFlight]) -> Vec<&'static str> {
    let all = |has: fn(&sysid::Prepared) -> bool| flights.iter().all(|flight| has(&flight.prepared));
    let asked = [
        ("position", all(|flight| flight.has_position)),
        ("logged velocity", all(|flight| flight.has_logged_velocity)),
        ("accelerometer", all(|flight| flight.force_target == sysid::ForceTarget::Imu)),
        ("motor commands", all(|flight| flight.has_commands)),
        ("rotor speeds", all(sysid::Prepared::has_rotor_speeds)),
        ("battery voltage", all(|flight| flight.has_voltage)),
    ];
    asked.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect()
}
