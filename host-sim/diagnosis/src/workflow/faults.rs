//! Faults of flights, vehicle files and fits, each with the files it is about.

use model::{Effect, FlightRole, GROUPS, Group, Model, NotIdentified, Vehicle};
use sysid::checks::overlap;
use sysid::checks::under_sampled;
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

    /// What flights with such faults do not determine.
    pub(crate) fn not_identified(&self) -> Vec<NotIdentified> {
        let told = self.listed.iter().filter(|listed| listed.fault.severity != Severity::Note);
        let mut all: Vec<NotIdentified> = Vec::new();
        for unknown in told.flat_map(|listed| not_determined(listed.fault.kind)) {
            // One reason of many flights is told once.
            if !all.contains(&unknown) {
                all.push(unknown);
            }
        }
        all
    }

    /// Whether there is one of a kind, other than a note.
    pub fn has(&self, kind: FaultKind) -> bool {
        self.listed.iter().any(|l| l.fault.kind == kind && l.fault.severity != Severity::Note)
    }

    /// Adds a fault, once: a fit that is made again finds the same.
    pub(crate) fn add(&mut self, whose: impl Into<String>, fault: Fault) {
        let whose = whose.into();
        if !self.listed.iter().any(|known| known.whose == whose && known.fault == fault) {
            self.listed.push(Listed { whose, fault });
        }
    }

    /// Takes back what was said of one kind.
    pub(crate) fn withdraw(&mut self, kind: FaultKind) {
        self.listed.retain(|listed| listed.fault.kind != kind);
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
                    let apply = fault.mend.as_ref().map_or("", |_| "; --apply writes it into columns.toml");
                    let (path, sentence) = (flight.path.clone(), format!("{}{apply}", fault.sentence));
                    return Err(WorkflowError::Faulty { path, sentence });
                }
                self.add(flight.path.display().to_string(), fault.clone());
            }
        }
        for fault in vehicle::of_vehicle(vehicle).into_iter().chain(vehicle::unmeasured(vehicle)) {
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
            self.add(
                again.path.display().to_string(),
                Fault { flight, ..Fault::of_all(kind, severity, sentence) },
            );
        }
        self.add_of_commands(train.iter().chain(validate));
        for fault in vehicle::of_set(&prepared(train), &prepared(validate)) {
            self.add("flights", fault);
        }
        Ok(())
    }

    /// Commands that were logged less often than they were given.
    pub(crate) fn add_of_commands<'a>(&mut self, flights: impl Iterator<Item = &'a LoadedFlight>) {
        let thinnings: Vec<_> = flights.map(|flight| flight.thinning).collect();
        if let Some(sentence) = under_sampled::of_flights(&thinnings) {
            self.add("flights", Fault::of_all(FaultKind::UnderSampled, Severity::Warning, sentence));
        }
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
            let sentence = "the model was fitted to this flight, so its errors here are too small";
            let fault = Fault {
                flight: Some(flight.prepared.name.clone()),
                ..Fault::of_all(FaultKind::FittedOn, Severity::Warning, sentence)
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

/// What flights with a fault do not determine; nothing for a fault that leaves them an answer. Commands between the logged
/// ones turn the craft to and fro, and move it a little.
fn not_determined(kind: FaultKind) -> Vec<NotIdentified> {
    let of = |group: Group| NotIdentified {
        leaves_findings: group == Group::Translation,
        ..NotIdentified::of_group(
            group,
            "the motor commands look under-sampled (see the warnings)".into(),
            "log at least as fast as the commands change",
        )
    };
    match kind {
        FaultKind::UnderSampled => GROUPS.map(of).to_vec(),
        FaultKind::NoPosition => vec![NotIdentified {
            leaves_findings: true,
            ..NotIdentified::of_group(
                Group::Translation,
                "no position is logged, so the speed is known only over spans of a second".into(),
                "log x, y and z, from motion capture or from the estimator on board",
            )
        }],
        _ => Vec::new(),
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
    use model::{Effect, FitRecord, FlightRecord};

    use super::*;
    use crate::testing::{loaded, truth};

    const STRICT: Reading = Reading { accept_faults: false, window_s: None, whole: false };
    const LENIENT: Reading = Reading { accept_faults: true, window_s: None, whole: false };

    #[test]
    fn five_flights_are_named_and_more_are_counted() {
        let mut flights = loaded([1]);
        let name = |k: usize| format!("{k}.csv");
        while flights.len() < 7 {
            let first = &flights[0];
            let (path, sha256) = (name(flights.len()).into(), String::new());
            let (prepared, clocks) = (first.prepared.clone(), first.clocks);
            let (faults, taken) = (Vec::new(), sysid::Taken::default());
            flights.push(LoadedFlight { path, sha256, prepared, faults, clocks, taken, thinning: None });
        }
        assert_eq!(listed(&flights[1..6]), "1.csv, 2.csv, 3.csv, 4.csv, 5.csv");
        assert_eq!(listed(&flights), "flight-1.csv, 1.csv, 2.csv, 3.csv, 4.csv and 2 more");
        assert_eq!(listed(&flights[..0]), "");
    }

    #[test]
    fn a_fault_that_would_make_conclusions_wrong_stops_unless_it_is_accepted() {
        let mut flights = loaded([1]);
        let fault = |severity| Fault::of_all(FaultKind::WrongFrame, severity, "z points up");
        flights[0].faults = vec![fault(Severity::Warning), fault(Severity::Refused)];
        let vehicle = truth().vehicle;
        let refused = Faults::default().add_of_flights(&flights, &vehicle, STRICT).unwrap_err();
        assert_eq!(refused.to_string(), "flight-1.csv: z points up (or --accept-faults to go on regardless)");
        let mut faults = Faults::default();
        faults.add_of_flights(&flights, &vehicle, LENIENT).unwrap();
        let told: Vec<_> = faults.listed().iter().map(|l| (l.whose.as_str(), l.fault.severity)).collect();
        assert_eq!(told, [("flight-1.csv", Severity::Warning), ("flight-1.csv", Severity::Refused)]);
    }

    #[test]
    fn a_doubtful_vehicle_file_is_named_by_the_vehicle() {
        let mut vehicle = truth().vehicle;
        vehicle.rotor_radius *= 2.0;
        let mut faults = Faults::default();
        faults.add_of_flights(&[], &vehicle, STRICT).unwrap();
        assert_eq!(faults.listed()[0].whose, vehicle.name);
        assert_eq!(faults.all()[0].kind, FaultKind::ImplausibleVehicle);
    }

    #[test]
    fn a_flight_to_judge_by_that_was_fitted_on_under_another_name_is_refused() {
        let (train, mut validate) = (loaded([1, 2]), loaded([2]));
        validate[0].path = "copy.csv".into();
        let refused = Faults::default().add_of_sets(&train, &validate, STRICT).unwrap_err();
        assert!(refused.to_string().starts_with("copy.csv: has samples of flight-2.csv in it"), "{refused}");
        let mut faults = Faults::default();
        faults.add_of_sets(&train, &validate, LENIENT).unwrap();
        assert_eq!(faults.all()[0].kind, FaultKind::SharedSamples);
        let mut faults = Faults::default();
        faults.add_of_sets(&train, &loaded([3]), STRICT).unwrap();
        assert!(faults.all().iter().all(|fault| fault.kind == FaultKind::TooFewFlights));
    }

    #[test]
    fn a_flight_is_known_again_by_its_content_where_it_was_fitted_on() {
        let flights = loaded([1, 2]);
        let mut model = truth();
        let mut faults = Faults::default();
        faults.add_of_fitted(&model, &flights);
        let record = |flight: &LoadedFlight, role| FlightRecord {
            name: "other name".into(),
            sha256: flight.sha256.clone(),
            role,
            samples: 1,
            wind_m_s: None,
        };
        model.fit = Some(FitRecord {
            flights: vec![record(&flights[0], FlightRole::Validate), record(&flights[1], FlightRole::Train)],
            ..FitRecord::default()
        });
        faults.add_of_fitted(&model, &flights);
        let told: Vec<&str> = faults.listed().iter().map(|l| l.whose.as_str()).collect();
        assert_eq!(told, ["flight-2.csv"]);
        assert_eq!(faults.all()[0].kind, FaultKind::FittedOn);
    }

    #[test]
    fn only_a_fault_that_leaves_no_answer_leaves_anything_unidentified() {
        let mut faults = Faults::default();
        for kind in [FaultKind::TrackerJump, FaultKind::SaturatedCommands, FaultKind::ClockOffset] {
            faults.add("A.csv", Fault::of_all(kind, Severity::Warning, "something"));
            assert_eq!(not_determined(kind), []);
        }
        assert_eq!(faults.not_identified(), []);
        faults.add("A.csv", Fault::of_all(FaultKind::UnderSampled, Severity::Warning, "something"));
        let told: Vec<_> = faults.not_identified().iter().map(|u| (u.group, u.leaves_findings)).collect();
        assert_eq!(told, [(Group::Translation, true), (Group::Rotation, false)]);
    }

    #[test]
    fn flights_of_another_craft_are_told_together() {
        let flights = loaded([1, 2]);
        let all: Vec<&LoadedFlight> = flights.iter().collect();
        let mut faults = Faults::default();
        faults.add_of_likeness(&truth(), &all, Likeness::SAME);
        assert!(faults.listed().is_empty());
        let mut model = truth();
        let thrust = truth().term(Effect::Thrust).unwrap().coefficients[0].value;
        model.set(Effect::Thrust, &[0.5 * thrust]);
        faults.add_of_likeness(&model, &all, Likeness::SAME);
        assert_eq!(faults.listed()[0].whose, "flight-1.csv, flight-2.csv");
        let sentence = &faults.all()[0].sentence;
        let (begins, ends) = (
            "these flights do not look like F330 (thesis)\u{2019}s: the thrust is 10",
            " % above the model's; use the model and vehicle file of the craft that flew",
        );
        assert!(sentence.starts_with(begins) && sentence.ends_with(ends), "{sentence}");
    }

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
