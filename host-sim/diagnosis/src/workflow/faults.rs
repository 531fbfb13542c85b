//! Faults of flights, vehicle files and fits, each with the files it is about.

use model::{Effect, FlightRole, Model, Vehicle};
use sysid::checks::overlap;
use sysid::checks::vehicle::{self, Likeness};
use sysid::{Fault, FaultKind, Prepared, Severity};

use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::{LoadedFlight, Reading, prepared};

/// A fault and whose it is: a file, several files, or a vehicle.
#[derive(Debug, Clone)]
pub struct Listed {
    /// Files or vehicle, for people.
    pub whose: String,
    /// The fault.
    pub fault: Fault,
}

/// What was found so far; it grows while a command works.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    listed: Vec<Listed>,
    withdrawn: Vec<String>,
}

/// Flights that are named one by one; of more, the rest is counted.
const NAMED: usize = 5;

impl Faults {
    /// All of them, in the order in which they were found.
    pub fn listed(&self) -> &[Listed] {
        &self.listed
    }

    /// Warnings that an effect explains which has joined the model, one sentence each.
    pub fn withdrawn(&self) -> &[String] {
        &self.withdrawn
    }

    /// The faults alone.
    pub fn all(&self) -> Vec<Fault> {
        self.listed.iter().map(|listed| listed.fault.clone()).collect()
    }

    pub(crate) fn add(&mut self, whose: impl Into<String>, fault: Fault) {
        self.listed.push(Listed { whose: whose.into(), fault });
    }

    /// Takes back that the clocks of `flights` wander: with `effect` in the model they do not.
    pub(crate) fn withdraw_wandering(&mut self, flights: &[String], effect: Effect) {
        let is_settled = |listed: &Listed| {
            listed.fault.kind == FaultKind::WanderingClock && flights.contains(&listed.whose)
        };
        self.listed.retain(|listed| !is_settled(listed));
        self.withdrawn.push(format!(
            "{}: without {effect}, the rotor clock seems to wander; {effect} explains it, so this warning is withdrawn",
            flights.join(", ")
        ));
    }

    /// Faults of the flights one by one and of the vehicle file by itself. One that makes every conclusion wrong is an error.
    pub(crate) fn add_of_flights<'a>(
        &mut self,
        flights: impl IntoIterator<Item = &'a LoadedFlight>,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<(), WorkflowError> {
        for flight in flights {
            for fault in &flight.faults {
                if fault.severity == Severity::Refused && !reading.accept_faults {
                    let (path, sentence) = (flight.path.clone(), fault.sentence.clone());
                    return Err(WorkflowError::Faulty { path, sentence });
                }
                self.add(flight.path.display().to_string(), fault.clone());
            }
        }
        if let Some(fault) = vehicle::of_vehicle(vehicle) {
            self.add(&vehicle.name, fault);
        }
        Ok(())
    }

    /// Too few flights, and flights to judge by that are pieces of those to fit on.
    pub(crate) fn add_of_sets(
        &mut self,
        train: &[LoadedFlight],
        validate: &[LoadedFlight],
        reading: Reading,
    ) -> Result<(), WorkflowError> {
        for again in validate {
            let shares = |first: &&LoadedFlight| overlap::share_samples(&first.prepared, &again.prepared);
            let Some(first) = train.iter().find(shares) else { continue };
            let sentence = format!(
                "has samples of {} in it (a copy in another format, or a piece of it), and a flight that was fitted on cannot judge \
                 the fit; give another flight",
                first.path.display()
            );
            if !reading.accept_faults {
                return Err(WorkflowError::Faulty { path: again.path.clone(), sentence });
            }
            let flight = Some(again.prepared.name.clone());
            let (kind, severity) = (FaultKind::SharedSamples, Severity::Refused);
            self.add(again.path.display().to_string(), Fault { kind, severity, flight, sentence });
        }
        for fault in vehicle::of_set(&prepared(train), &prepared(validate)) {
            self.add("flights", fault);
        }
        Ok(())
    }

    /// Flights to judge by that the model was fitted on.
    pub(crate) fn add_of_fitted(&mut self, model: &Model, flights: &[LoadedFlight]) {
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
            self.add(flight.path.display().to_string(), fault);
        }
    }

    /// Flights that are not those of the model's vehicle.
    pub(crate) fn add_of_likeness(&mut self, model: &Model, flights: &[&LoadedFlight], likeness: Likeness) {
        let prepared: Vec<&Prepared> = flights.iter().map(|f| &f.prepared).collect();
        let differences = vehicle::differences(model, &prepared, likeness);
        if differences.is_empty() {
            return;
        }
        let sentence = format!(
            "these flights do not look like {}\u{2019}s: {}; use the model and vehicle file of the craft that flew",
            model.vehicle.name,
            differences.join(", ")
        );
        let fault = Fault::of_all(FaultKind::OtherVehicle, Severity::Warning, sentence);
        self.add(listed(flights.iter().copied()), fault);
    }
}

/// "A.csv, B.csv", with the folders the user gave.
pub(crate) fn listed<'a>(flights: impl IntoIterator<Item = &'a LoadedFlight>) -> String {
    let mut names: Vec<String> = flights.into_iter().map(|f| f.path.display().to_string()).collect();
    let more = names.len().saturating_sub(NAMED);
    names.truncate(NAMED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    names.join(", ") + &rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_wandering_of_the_flights_that_an_effect_explains_is_withdrawn() {
        let mut faults = Faults::default();
        for (file, kind) in [
            ("A.csv", FaultKind::WanderingClock),
            ("A.csv", FaultKind::TrackerJump),
            ("B.csv", FaultKind::WanderingClock),
        ] {
            faults.add(file, Fault::of_all(kind, Severity::Warning, "something"));
        }
        faults.withdraw_wandering(&["A.csv".into()], Effect::FlappingMoment);
        let left: Vec<(&str, FaultKind)> =
            faults.listed().iter().map(|listed| (listed.whose.as_str(), listed.fault.kind)).collect();
        assert_eq!(left, [("A.csv", FaultKind::TrackerJump), ("B.csv", FaultKind::WanderingClock)]);
        let [sentence] = faults.withdrawn() else { panic!("one sentence") };
        assert!(
            sentence.starts_with("A.csv: ") && sentence.contains("flapping-moment explains it"),
            "{sentence}"
        );
    }
}
