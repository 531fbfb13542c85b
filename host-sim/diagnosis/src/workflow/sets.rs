//! Flights to fit on and flights to judge by: two kinds that cannot be taken for each other.

use std::path::{Path, PathBuf};

use flights::Flight;
use model::{Effect, Model, Vehicle};
use sysid::checks::vehicle::{self, Likeness};
use sysid::{Fault, FaultKind, FitError, Prepared, RotorComparison, Severity, WideSwing};

use crate::observer::Observer;
use crate::workflow::error::WorkflowError;
use crate::workflow::faults::{Faults, listed};
use crate::workflow::loaded::{
    LoadedFlight, Reading, Source, leave_out_undefined, load_all, names, prepared,
};
use crate::workflow::split::split;
use crate::workflow::winds::Revealed;

/// Flights to fit on.
pub struct TrainingFlights(pub(crate) Vec<LoadedFlight>);

/// Flights to judge by, none of which is fitted on.
pub struct HeldOutFlights(pub(crate) Vec<LoadedFlight>);

/// Flights to fit on and flights to judge by.
pub struct FlightSets {
    /// Flights to fit on.
    pub training: TrainingFlights,
    /// Flights to judge by.
    pub held_out: HeldOutFlights,
    /// What is wrong with them, and with the vehicle file and fits as far as they have come.
    pub faults: Faults,
    /// What the winds that the flights are in bring to light.
    pub(crate) revealed: Option<Revealed>,
}

/// Flights that a model is held against.
pub struct FlightsOfOneKind {
    /// The flights.
    pub flights: Vec<LoadedFlight>,
    /// What is wrong with them.
    pub faults: Faults,
}

impl TrainingFlights {
    /// The flights with their files and faults.
    pub fn loaded(&self) -> &[LoadedFlight] {
        &self.0
    }

    /// The flights as identification takes them.
    pub fn prepared(&self) -> Vec<&Prepared> {
        prepared(&self.0)
    }
}

impl HeldOutFlights {
    /// The flights with their files and faults.
    pub fn loaded(&self) -> &[LoadedFlight] {
        &self.0
    }

    /// The flights as identification takes them.
    pub fn prepared(&self) -> Vec<&Prepared> {
        prepared(&self.0)
    }
}

impl FlightSets {
    /// Reads the files of both sets; none may be in both or twice in one.
    pub fn read(
        train: &[PathBuf],
        validate: &[PathBuf],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let mut all = Source::of_files(train, vehicle, observer)?;
        let training = all.len();
        all.extend(Source::of_files(validate, vehicle, observer)?);
        Self::load(&all, training, vehicle, reading, observer)
    }

    /// Reads files and splits them (`split.rs`).
    pub fn split(
        paths: &[PathBuf],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let (train, validate) = split(Source::of_files(paths, vehicle, observer)?, vehicle)?;
        let training = train.len();
        let all: Vec<Source<'_>> = train.into_iter().chain(validate).collect();
        Self::load(&all, training, vehicle, reading, observer)
    }

    /// Which flights are fitted on and which are to judge by, for people.
    pub fn split_sentence(&self) -> String {
        let names = |flights: &[LoadedFlight]| -> String {
            flights.iter().map(|flight| flight.prepared.name.as_str()).collect::<Vec<_>>().join(", ")
        };
        format!("split: fitted on {}; held out: {}", names(&self.training.0), names(&self.held_out.0))
    }

    /// Takes flights that are already in memory.
    pub fn from_flights(
        train: &[Flight],
        validate: &[Flight],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let all: Vec<Source<'_>> = train.iter().chain(validate).map(Source::Memory).collect();
        Self::load(&all, train.len(), vehicle, reading, observer)
    }

    fn load(
        sources: &[Source<'_>],
        training: usize,
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let mut train = load_all(sources, vehicle, reading, observer)?;
        let validate = train.split_off(training);
        Self::from_loaded(train, validate, vehicle, reading)
    }

    /// Takes flights that have been read already, as they were read.
    pub fn from_loaded(
        mut train: Vec<LoadedFlight>,
        validate: Vec<LoadedFlight>,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<Self, WorkflowError> {
        let training = train.len();
        train.extend(validate);
        if let Some((first, again)) = repeated(&train) {
            let in_both_sets = first < training && again >= training;
            return Err(given_twice(&train, first, again, in_both_sets));
        }
        let validate = train.split_off(training);
        let mut faults = Faults::default();
        faults.add_of_flights(train.iter().chain(&validate), vehicle, reading)?;
        faults.add_of_sets(&train, &validate, reading)?;
        Ok(Self {
            training: TrainingFlights(train),
            held_out: HeldOutFlights(validate),
            faults,
            revealed: None,
        })
    }

    /// All flights, those to fit on first.
    pub fn all(&self) -> impl Iterator<Item = &LoadedFlight> {
        self.training.0.iter().chain(&self.held_out.0)
    }

    /// The training flights as identification takes them.
    pub fn train(&self) -> Vec<&Prepared> {
        self.training.prepared()
    }

    /// The held-out flights as identification takes them.
    pub fn validate(&self) -> Vec<&Prepared> {
        self.held_out.prepared()
    }

    /// The rotors of a model against each other by all flights, where its coefficients tell.
    pub(crate) fn compare_rotors(&self, model: &Model) -> Option<RotorComparison> {
        sysid::compare_rotors(model, &[self.train(), self.validate()].concat())
    }

    /// Leaves out the samples at which a formula of `effects` or of the model's own has no finite value.
    pub(crate) fn leave_out_undefined(
        &mut self,
        model: &Model,
        effects: &[Effect],
        observer: &dyn Observer,
    ) -> Result<(), WorkflowError> {
        leave_out_undefined(&mut self.training.0, model, effects, observer)?;
        leave_out_undefined(&mut self.held_out.0, model, effects, observer)
    }

    /// What a fitted model says of its vehicle file and of the flights it was fitted on and judged by.
    pub(crate) fn add_faults_of_fit(&mut self, model: &Model) {
        let train = listed(&self.training.0);
        for fault in vehicle::of_fit(model) {
            self.faults.add(&train, fault);
        }
        let differences = vehicle::differences(model, &prepared(&self.held_out.0), Likeness::SAME);
        if !differences.is_empty() {
            let sentence = format!(
                "these flights look like those of another vehicle than {train}: against the fit, {}; judge a model by flights of the \
                 same craft",
                differences.join(", ")
            );
            let fault = Fault::of_all(FaultKind::OtherVehicle, Severity::Warning, sentence);
            self.faults.add(listed(&self.held_out.0), fault);
        }
        for flight in self.training.0.iter().chain(&self.held_out.0) {
            if let Some(fault) = vehicle::upside_down(model, &flight.prepared) {
                self.faults.add(flight.path.display().to_string(), fault);
            }
        }
        self.add_wide_swings(model);
    }

    /// Flights in which the load of a model swings too wide to be predicted.
    pub(crate) fn add_wide_swings(&mut self, model: &Model) {
        for flight in self.training.0.iter().chain(&self.held_out.0) {
            if let Some(swing) = WideSwing::too_wide(&flight.prepared, model) {
                self.faults.add(flight.path.display().to_string(), wide_swing(&flight.prepared, swing));
            }
        }
    }

    /// An error of a fit with the flights it was about.
    pub(crate) fn blame(&self, why: FitError) -> WorkflowError {
        WorkflowError::Fit { flights: names(&self.training.0), why }
    }
}

/// Says of a flight that the load of a model swings too wide in it.
fn wide_swing(flight: &Prepared, swing: WideSwing) -> Fault {
    let sentence = format!(
        "the load swings up to {:.0} degrees from the vertical, too wide to predict: a fit leaves this flight out if others remain, and \
         its errors say little about the model; fly more gently",
        swing.widest_deg
    );
    Fault {
        flight: Some(flight.name.clone()),
        ..Fault::of_all(FaultKind::WideSwing, Severity::Warning, sentence)
    }
}

impl FlightsOfOneKind {
    /// Reads files; none may be given twice.
    pub fn read(
        paths: &[PathBuf],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        Self::load(&Source::of_files(paths, vehicle, observer)?, vehicle, reading, observer)
    }

    /// Reads a file once for its flights as they are used, and for all that flies of those of which parts are chosen.
    pub fn read_used_and_whole(
        path: &Path,
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> (Result<Self, WorkflowError>, Vec<LoadedFlight>) {
        let mut sources = match Source::of_file(path, vehicle, observer) {
            Ok(sources) => sources,
            Err(why) => return (Err(why), Vec::new()),
        };
        let used = Self::load(&sources, vehicle, reading, observer);
        sources.retain(Source::has_chosen_parts);
        let whole = load_all(&sources, vehicle, Reading { whole: true, ..reading }, observer);
        (used, whole.unwrap_or_default())
    }

    /// Takes flights that are already in memory.
    pub fn from_flights(
        flights: &[Flight],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        let sources: Vec<Source<'_>> = flights.iter().map(Source::Memory).collect();
        Self::load(&sources, vehicle, reading, observer)
    }

    fn load(
        sources: &[Source<'_>],
        vehicle: &Vehicle,
        reading: Reading,
        observer: &dyn Observer,
    ) -> Result<Self, WorkflowError> {
        Self::from_loaded(load_all(sources, vehicle, reading, observer)?, vehicle, reading)
    }

    /// Takes flights that have been read already, as they were read.
    pub fn from_loaded(
        flights: Vec<LoadedFlight>,
        vehicle: &Vehicle,
        reading: Reading,
    ) -> Result<Self, WorkflowError> {
        if let Some((first, again)) = repeated(&flights) {
            return Err(given_twice(&flights, first, again, false));
        }
        let mut faults = Faults::default();
        faults.add_of_flights(&flights, vehicle, reading)?;
        Ok(Self { flights, faults })
    }

    /// The flights as identification takes them.
    pub fn prepared(&self) -> Vec<&Prepared> {
        prepared(&self.flights)
    }
}

/// The first pair of flights with the same content.
fn repeated(flights: &[LoadedFlight]) -> Option<(usize, usize)> {
    (1..flights.len()).find_map(|again| {
        let first = (0..again).find(|&first| flights[first].sha256 == flights[again].sha256)?;
        Some((first, again))
    })
}

fn given_twice(flights: &[LoadedFlight], first: usize, again: usize, in_both_sets: bool) -> WorkflowError {
    let path = |index: usize| flights[index].path.clone();
    WorkflowError::GivenTwice { first: path(first), again: path(again), in_both_sets }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::Silent;

    fn flown(seeds: &[u64]) -> Vec<Flight> {
        seeds.iter().map(|seed| fly(&truth(), *seed, 4.0, &ORDINARY)).collect()
    }

    fn sets(train: &[u64], validate: &[u64]) -> Result<FlightSets, WorkflowError> {
        let (train, validate) = (flown(train), flown(validate));
        FlightSets::from_flights(&train, &validate, &truth().vehicle, Reading::default(), &Silent)
    }

    #[test]
    fn flights_keep_their_set_and_their_order() {
        let sets = sets(&[3, 1], &[2]).unwrap();
        let names: Vec<&str> = sets.all().map(|flight| flight.prepared.name.as_str()).collect();
        assert_eq!(names, ["flight-3.csv", "flight-1.csv", "flight-2.csv"]);
        assert_eq!((sets.train().len(), sets.validate().len()), (2, 1));
        assert_eq!(sets.held_out.loaded()[0].path, PathBuf::from("flight-2.csv"));
    }

    #[test]
    fn the_same_content_twice_is_refused_in_a_set_and_across_both() {
        let twice = |train: &[u64], validate: &[u64]| match sets(train, validate) {
            Err(WorkflowError::GivenTwice { again, in_both_sets, .. }) => (again, in_both_sets),
            _ => panic!("a flight was used twice"),
        };
        assert_eq!(twice(&[1, 2, 1], &[3]), (PathBuf::from("flight-1.csv"), false));
        assert_eq!(twice(&[1, 2], &[3, 3]), (PathBuf::from("flight-3.csv"), false));
        assert_eq!(twice(&[1, 2], &[3, 2]), (PathBuf::from("flight-2.csv"), true));
        let same = flown(&[4, 4]);
        let one_kind = FlightsOfOneKind::from_flights(&same, &truth().vehicle, Reading::default(), &Silent);
        assert!(matches!(one_kind, Err(WorkflowError::GivenTwice { in_both_sets: false, .. })));
    }

    #[test]
    fn an_error_of_a_fit_names_the_flights_that_were_fitted_on() {
        let refused = sets(&[1, 2], &[3]).unwrap().blame(FitError::NoFlights);
        assert_eq!(refused.to_string(), "flight-1.csv, flight-2.csv: no flights to fit on");
    }

    #[test]
    fn a_flight_is_told_in_which_the_load_of_a_model_would_swing_too_wide() {
        let mut sets = sets(&[1], &[2]).unwrap();
        let told = |sets: &FlightSets| -> Vec<String> {
            let all = sets.faults.listed().iter().filter(|l| l.fault.kind == FaultKind::WideSwing);
            all.map(|listed| listed.whose.clone()).collect()
        };
        let mut loaded = truth();
        loaded.set(Effect::SlungLoad, &[0.1, 0.5, 0.3]);
        sets.add_faults_of_fit(&loaded);
        assert_eq!(told(&sets), [""; 0]);
        let stretch = &mut sets.held_out.0[0].prepared.stretches[0];
        let frequency_rad_s = (9.81_f64 / 0.5).sqrt();
        for (north_m, time_s) in stretch.position_ned_m[0].iter_mut().zip(&stretch.time_s) {
            *north_m += 0.5 * (frequency_rad_s * time_s).sin();
        }
        loaded.set(Effect::SlungLoad, &[0.1, 0.5, 0.01]);
        sets.add_faults_of_fit(&loaded);
        assert_eq!(told(&sets), ["flight-2.csv"]);
    }

    #[test]
    fn the_true_model_finds_no_other_vehicle_among_the_flights_to_judge_by() {
        let mut sets = sets(&[1, 2], &[3, 4]).unwrap();
        let other_vehicle = |sets: &FlightSets| -> usize {
            sets.faults.all().iter().filter(|fault| fault.kind == FaultKind::OtherVehicle).count()
        };
        sets.add_faults_of_fit(&truth());
        assert_eq!(other_vehicle(&sets), 0);
        let mut stronger = truth();
        let thrust = truth().term(Effect::Thrust).unwrap().coefficients[0].value;
        stronger.set(Effect::Thrust, &[2.0 * thrust]);
        sets.add_faults_of_fit(&stronger);
        assert_eq!(other_vehicle(&sets), 1);
        let told = sets.faults.listed().iter().find(|l| l.fault.kind == FaultKind::OtherVehicle).unwrap();
        assert_eq!(told.whose, "flight-3.csv, flight-4.csv");
        assert_eq!(
            told.fault.sentence,
            "these flights look like those of another vehicle than flight-1.csv, flight-2.csv: against the \
             fit, the thrust is 50 % below the model's; judge a model by flights of the same craft"
        );
    }
}
