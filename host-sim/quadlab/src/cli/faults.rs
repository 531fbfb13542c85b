//! Faults of flights, vehicle files and fits: told on standard error, in JSON and on pages, or refused.

use std::cell::RefCell;

use model::{FlightRole, Model, Vehicle};
use serde::Serialize;
use sysid::checks::clocks::Clocks;
use sysid::checks::overlap;
use sysid::checks::vehicle::{self, Likeness};
use sysid::{Fault, FaultKind, Severity};

use crate::cli::flights::{FlightsError, Loaded, Sets};
use crate::cli::output::Outcome;

/// What is done about faults.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct FaultOptions {
    /// Go on with flights whose axes, signs or motors are recognised as wrong; the results will be wrong, too
    #[arg(long)]
    pub(crate) accept_faults: bool,
}

/// How flights are read.
#[derive(Clone, Copy, Default)]
pub(crate) struct Reading {
    /// Nothing but one document on standard output, no progress.
    pub(crate) json: bool,
    /// Tell what would be refused.
    pub(crate) accept_faults: bool,
}

impl FaultOptions {
    /// With these options.
    pub(crate) fn reading(self, json: bool) -> Reading {
        Reading { json, accept_faults: self.accept_faults }
    }
}

/// What was found so far, each with the files it is about; it grows while a command works.
#[derive(Default)]
pub(crate) struct Faults(RefCell<Vec<(String, Fault)>>);

impl Faults {
    /// All of them.
    pub(crate) fn all(&self) -> Vec<Fault> {
        self.0.borrow().iter().map(|(_, fault)| fault.clone()).collect()
    }

    /// Warns on standard error. For the end of a command: one that is refused says why in one line and nothing else.
    pub(crate) fn warn(&self) {
        for (whose, fault) in self.0.borrow().iter().filter(|(_, f)| f.severity != Severity::Note) {
            eprintln!("warning: {whose}: {}", fault.sentence);
        }
    }

    fn tell(&self, whose: &str, fault: Fault) {
        self.0.borrow_mut().push((whose.into(), fault));
    }

    /// Faults of the flights one by one and of the vehicle file by itself. One that makes every conclusion wrong is an error.
    pub(crate) fn of_flights<'a>(
        &self,
        flights: impl IntoIterator<Item = &'a Loaded>,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<(), FlightsError> {
        for flight in flights {
            for fault in &flight.faults {
                if fault.severity == Severity::Refused && !reading.accept_faults {
                    let (path, sentence) = (flight.path.clone(), fault.sentence.clone());
                    return Err(FlightsError::Faulty { path, sentence });
                }
                self.tell(&flight.path.display().to_string(), fault.clone());
            }
        }
        if let Some(fault) = vehicle::of_vehicle(vehicle) {
            self.tell(&vehicle.name, fault);
        }
        Ok(())
    }

    /// Too few flights, and flights to judge by that are pieces of those to fit on.
    pub(crate) fn of_sets(&self, sets: &Sets, reading: Reading) -> Result<(), FlightsError> {
        for again in &sets.validate {
            let Some(first) =
                sets.train.iter().find(|first| overlap::share_samples(&first.prepared, &again.prepared))
            else {
                continue;
            };
            let sentence = format!(
                "has samples of {} in it (a copy in another format, or a piece of it), and a flight that was fitted on cannot judge \
                 the fit; give another flight",
                first.path.display()
            );
            if !reading.accept_faults {
                return Err(FlightsError::Faulty { path: again.path.clone(), sentence });
            }
            let flight = Some(again.prepared.name.clone());
            let (kind, severity) = (FaultKind::SharedSamples, Severity::Refused);
            self.tell(&again.path.display().to_string(), Fault { kind, severity, flight, sentence });
        }
        for fault in vehicle::of_set(&sets.train(), &sets.validate()) {
            self.tell("flights", fault);
        }
        Ok(())
    }

    /// Flights to judge by that the model was fitted on.
    pub(crate) fn of_fitted<'a>(&self, model: &Model, flights: impl IntoIterator<Item = &'a Loaded>) {
        let Some(record) = &model.fit else { return };
        for flight in flights {
            let fitted =
                record.flights.iter().any(|f| f.role == FlightRole::Train && f.sha256 == flight.sha256);
            if !fitted {
                continue;
            }
            let fault = Fault {
                kind: FaultKind::FittedOn,
                severity: Severity::Warning,
                flight: Some(flight.prepared.name.clone()),
                sentence: "the model was fitted to this flight, so its errors here are too small".into(),
            };
            self.tell(&flight.path.display().to_string(), fault);
        }
    }

    /// Flights that are not those of the model's vehicle.
    pub(crate) fn of_likeness<'a>(
        &self,
        model: &Model,
        flights: impl IntoIterator<Item = &'a Loaded>,
        likeness: Likeness,
    ) {
        let flights: Vec<&Loaded> = flights.into_iter().collect();
        let prepared: Vec<_> = flights.iter().map(|f| &f.prepared).collect();
        let differences = vehicle::differences(model, &prepared, likeness);
        if differences.is_empty() {
            return;
        }
        let sentence = format!(
            "these flights do not look like {}\u{2019}s: {}; use the model and vehicle file of the craft that flew",
            model.vehicle.name,
            differences.join(", ")
        );
        self.tell(&listed(flights), Fault::of_all(FaultKind::OtherVehicle, Severity::Warning, sentence));
    }

    /// What a fitted model says of its vehicle file and of the flights it was fitted on and judged by.
    pub(crate) fn of_fit(&self, model: &Model, sets: &Sets) {
        let logged = sets.train.iter().all(|f| f.prepared.has_rotor_speeds());
        for fault in vehicle::of_fit(model, logged) {
            self.tell(&listed(&sets.train), fault);
        }
        let judged: Vec<_> = sets.validate();
        let differences = vehicle::differences(model, &judged, Likeness::SAME);
        if !differences.is_empty() {
            let sentence = format!(
                "these flights look like those of another vehicle than {}: against the fit, {}; judge a model by flights of the same \
                 craft",
                listed(&sets.train),
                differences.join(", ")
            );
            let fault = Fault::of_all(FaultKind::OtherVehicle, Severity::Warning, sentence);
            self.tell(&listed(&sets.validate), fault);
        }
    }
}

/// Flights that are named one by one; of more, the rest is counted.
const NAMED: usize = 5;

/// "A.csv, B.csv", with the folders the user gave.
fn listed<'a>(flights: impl IntoIterator<Item = &'a Loaded>) -> String {
    let mut names: Vec<String> = flights.into_iter().map(|f| f.path.display().to_string()).collect();
    let more = names.len().saturating_sub(NAMED);
    names.truncate(NAMED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    names.join(", ") + &rest
}

/// A document with the faults and the clocks of the flights it is about.
#[derive(Serialize)]
struct WithFaults<'a, T> {
    #[serde(flatten)]
    document: &'a T,
    faults: Vec<Fault>,
    clocks: Vec<ClockEntry<'a>>,
}

#[derive(Serialize)]
struct ClockEntry<'a> {
    flight: &'a str,
    #[serde(flatten)]
    clocks: Clocks,
}

/// The JSON of a command, with what is wrong with its flights.
pub(crate) fn json<'a>(
    document: &impl Serialize,
    flights: impl IntoIterator<Item = &'a Loaded>,
    faults: &Faults,
) -> anyhow::Result<Outcome> {
    faults.warn();
    let entry = |flight: &'a Loaded| ClockEntry { flight: &flight.prepared.name, clocks: flight.clocks };
    let clocks = flights.into_iter().map(entry).collect();
    Outcome::json(&WithFaults { document, faults: faults.all(), clocks })
}
