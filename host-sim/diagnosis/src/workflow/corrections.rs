//! Flights before a model meets them: what is checked, and what belongs to single flights and not to the craft, the offset
//! between their clocks, their trim and their wind.

use model::{Effect, Model, Vehicle};
use report::number::fixed;
use sysid::checks::vehicle::Likeness;
use sysid::fit::{gusts, weather};
use sysid::{Fault, FaultKind, Prepared, Reference, Severity};

use crate::not_logged::lack_position;
use crate::observer::Observer;
use crate::wander;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::{LoadedFlight, leave_out_undefined};
use crate::workflow::sets::{FlightSets, FlightsOfOneKind};
use crate::workflow::winds::recall;

/// Fits of drag and winds by turns: a drag that was fitted without the winds is off by what they do.
const ROUNDS: usize = 3;
/// Smallest root mean square of a wind that wanders in the flight with most of it, m/s.
const LEAST_M_S: f64 = 0.2;

/// What flights tell of their own winds.
enum OwnWinds {
    /// The model fitted in them.
    Differ(Box<Model>),
    /// No more than by chance.
    Alike,
}

impl FlightSets {
    /// Checks the flights against a model that is there already, and sets their clocks and trim.
    pub(crate) fn hold_against(
        &mut self,
        model: &Model,
        effects: &[Effect],
        observer: &dyn Observer,
    ) -> Result<(), WorkflowError> {
        self.leave_out_undefined(model, effects, observer)?;
        self.faults.add_of_fitted(model, self.held_out.loaded());
        let all: Vec<&LoadedFlight> = self.training.loaded().iter().chain(self.held_out.loaded()).collect();
        self.faults.add_of_likeness(model, &all, Likeness::SAME);
        self.recall_weather(model);
        let aligned = self.align_training(model);
        self.align_held_out(aligned.as_ref().unwrap_or(model));
        Ok(())
    }

    /// Lets the winds blow beside which a model was fitted. Where some of the flights are new to it, those of all are found anew.
    fn recall_weather(&mut self, model: &Model) {
        self.revealed = None;
        self.faults.withdraw(FaultKind::WindBetweenFlights);
        let recalled = recall(model, &mut self.training.0) + recall(model, &mut self.held_out.0);
        if recalled > 0 && (recalled == self.all().count() || self.find_weather(model).is_some()) {
            self.tell_weather();
        }
    }

    /// Aligns the training flights with each other and finds their trim. Returns the model that held-out flights are aligned to,
    /// where it is not the one that is fitted.
    pub(crate) fn align_training(&mut self, model: &Model) -> Option<Model> {
        let mut train = prepared(&mut self.training.0);
        let aligned = sysid::align(&mut train, model);
        sysid::fit::trim::estimate(&mut train, model);
        aligned
    }

    /// Finds the training flights' trim anew, with what has joined the model.
    pub(crate) fn trim(&mut self, model: &Model) {
        sysid::fit::trim::estimate(&mut prepared(&mut self.training.0), model);
    }

    /// Finds the training flights' trim and the winds of all of them anew, about a model that an effect did not join in the end.
    pub(crate) fn go_back_to(&mut self, model: &Model) {
        self.trim(model);
        let _ = self.follow_weather(model);
    }

    /// Whether the flights have winds of their own, constant or wandering.
    pub(crate) fn has_weather(&self) -> bool {
        self.has_own_winds() || self.all().any(|flight| flight.prepared.has_gusts())
    }

    /// Whether each of the flights has a constant wind of its own.
    pub(crate) fn has_own_winds(&self) -> bool {
        self.all().any(|flight| flight.prepared.has_own_wind())
    }

    /// Gives each flight its own wind about `model`, where they differ: the model fitted again in these winds.
    pub(crate) fn find_weather(&mut self, model: &Model) -> Option<Model> {
        if let Some(OwnWinds::Differ(fitted)) = self.in_own_winds(model) {
            return Some(*fitted);
        }
        self.forget_weather();
        None
    }

    /// Nothing where the flights do not tell their winds beside what is in the model.
    fn in_own_winds(&mut self, model: &Model) -> Option<OwnWinds> {
        let mut about = model.clone();
        for _ in 0..ROUNDS {
            let drag = weather::beside_pushes(&self.train(), &about)?;
            if !weather::estimate(&mut self.all_prepared(), &drag)? {
                return Some(OwnWinds::Alike);
            }
            about = sysid::fit(&self.train(), &model.vehicle, &model.effects(), Some(&about)).ok()?.model;
        }
        Some(OwnWinds::Differ(Box::new(about)))
    }

    /// Finds the flights' own winds anew about a model that was fitted in them, where they have any: the model fitted in what was found,
    /// and without any wind of theirs where it explains what they differed by. Where the flights do not tell, the winds stay as they are.
    pub(crate) fn follow_weather(&mut self, model: &Model) -> Option<Model> {
        if !self.has_own_winds() {
            return None;
        }
        self.revealed = None;
        let before = self.winds();
        match self.in_own_winds(model) {
            Some(OwnWinds::Differ(again)) => {
                self.tell_weather();
                Some(*again)
            }
            Some(OwnWinds::Alike) => {
                self.forget_weather();
                self.faults.withdraw(FaultKind::WindBetweenFlights);
                let calm = sysid::fit(&self.train(), &model.vehicle, &model.effects(), Some(model));
                calm.ok().map(|fit| fit.model)
            }
            None => {
                self.blow(&before);
                None
            }
        }
    }

    pub(crate) fn forget_weather(&mut self) {
        self.revealed = None;
        weather::clear(&mut self.all_prepared());
    }

    /// Says the wind of each flight.
    pub(crate) fn tell_weather(&mut self) {
        let fault = weather_of(self.all());
        self.faults.withdraw(FaultKind::WindBetweenFlights);
        self.faults.add("flights", fault);
    }

    /// Gives each flight a wind that wanders, about `model` fitted again without what is slow in the horizontal forces. Whether
    /// there is one, and these flights tell.
    pub(crate) fn find_gusts(&mut self, model: &Model) -> bool {
        let flights = [self.train(), self.validate()].concat();
        if lack_position(&flights) || !wander::is_told_by(&flights) {
            return false;
        }
        gusts::expect(&mut self.all_prepared());
        let found = self.gusts_about(model).is_some()
            && self.all().any(|flight| gusts::rms_m_s(&flight.prepared) > LEAST_M_S);
        if !found {
            self.forget_gusts();
        }
        found
    }

    fn gusts_about(&mut self, model: &Model) -> Option<()> {
        let mut about = model.clone();
        for _ in 0..ROUNDS {
            about = sysid::fit(&self.train(), &model.vehicle, &model.effects(), Some(&about)).ok()?.model;
            gusts::estimate(&mut self.all_prepared(), &about)?;
        }
        Some(())
    }

    /// Finds the winds that wander anew about a model that was fitted in them, where there are any.
    pub(crate) fn follow_gusts(&mut self, model: &Model) {
        if self.all().any(|flight| flight.prepared.has_gusts()) {
            // Where the drag is not known any more, the winds are those that were found before.
            let _ = gusts::estimate(&mut self.all_prepared(), model);
        }
    }

    pub(crate) fn forget_gusts(&mut self) {
        gusts::clear(&mut self.all_prepared());
    }

    /// Says how the wind of each flight wanders.
    pub(crate) fn tell_gusts(&mut self) {
        let of = |flight: &LoadedFlight| {
            format!("{} {}", flight.path.display(), fixed(gusts::rms_m_s(&flight.prepared), 2))
        };
        let winds: Vec<String> = self.all().map(of).collect();
        let sentence = format!(
            "the wind wanders within each flight, which is taken into account: root mean square in m/s, {}",
            winds.join(", ")
        );
        self.faults.add("flights", Fault::of_all(FaultKind::WanderingWind, Severity::Warning, sentence));
    }

    fn all_prepared(&mut self) -> Vec<&mut Prepared> {
        let all = self.training.0.iter_mut().chain(&mut self.held_out.0);
        all.map(|flight| &mut flight.prepared).collect()
    }

    /// Judges anew whose rotor clocks wander, now that `effect` has joined the model: what a model lacks can look like that.
    pub(crate) fn judge_clocks(&mut self, model: &Model, effect: Effect) {
        if !sysid::has_rotation(model) {
            return;
        }
        let mut settled = Vec::new();
        for flight in self.training.0.iter_mut().chain(&mut self.held_out.0) {
            let Some(alignment) = &mut flight.prepared.alignment else { continue };
            let wandered = !std::mem::take(&mut alignment.wandering).is_empty();
            sysid::fit::alignment::name_wandering(&mut flight.prepared, model);
            if wandered && !flight.wanders() {
                settled.push(flight.path.display().to_string());
            }
        }
        if !settled.is_empty() {
            self.faults.withdraw_wandering(&settled, effect);
        }
    }

    /// Aligns the held-out flights to a model of the training flights.
    pub(crate) fn align_held_out(&mut self, model: &Model) {
        let delay = sysid::fit::alignment::common_delay_s(model, &self.train());
        align_to(&mut self.held_out.0, model, Reference::Model(delay));
    }
}

impl FlightsOfOneKind {
    /// Lets the winds blow beside which a model was fitted, in those of the flights that it knows.
    pub(crate) fn recall_weather(&mut self, model: &Model) {
        self.faults.withdraw(FaultKind::WindBetweenFlights);
        if recall(model, &mut self.flights) > 0 {
            let windy = self.flights.iter().filter(|flight| flight.prepared.has_own_wind());
            self.faults.add("flights", weather_of(windy));
        }
    }

    /// Checks the flights against a model whose coefficients stay, and sets their clocks.
    pub(crate) fn hold_against(
        &mut self,
        model: &Model,
        effects: &[Effect],
        (likeness, reference): (Likeness, Reference),
        observer: &dyn Observer,
    ) -> Result<(), WorkflowError> {
        leave_out_undefined(&mut self.flights, model, effects, observer)?;
        self.faults.add_of_fitted(model, &self.flights);
        let all: Vec<&LoadedFlight> = self.flights.iter().collect();
        self.faults.add_of_likeness(model, &all, likeness);
        align_to(&mut self.flights, model, reference);
        Ok(())
    }
}

/// The wind of each flight.
fn weather_of<'a>(flights: impl Iterator<Item = &'a LoadedFlight>) -> Fault {
    let of = |flight: &LoadedFlight| {
        let [north, east] = [0, 1].map(|i| fixed(flight.prepared.wind_ned_m_s[i], 2));
        format!("{} {north} north and {east} east", flight.path.display())
    };
    let winds: Vec<String> = flights.map(of).collect();
    let sentence =
        format!("each has a wind of its own, which is taken into account: in m/s, {}", winds.join(", "));
    Fault::of_all(FaultKind::WindBetweenFlights, Severity::Warning, sentence)
}

/// Aligns flights to a model whose coefficients stay.
fn align_to(flights: &mut [LoadedFlight], model: &Model, reference: Reference) {
    sysid::align_to(model, &mut prepared(flights), reference);
}

/// The basic model without coefficients.
pub(crate) fn basic_model(vehicle: &Vehicle) -> Model {
    let mut model = Model::new(vehicle.clone());
    Effect::basic().for_each(|effect| model.set(effect, &vec![0.0; effect.info().coefficients.len()]));
    model
}

pub(crate) fn prepared(flights: &mut [LoadedFlight]) -> Vec<&mut Prepared> {
    flights.iter_mut().map(|flight| &mut flight.prepared).collect()
}

#[cfg(test)]
mod tests {
    use sysid::FaultKind;

    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent};

    #[test]
    fn the_basic_model_has_every_basic_effect_at_zero() {
        let model = basic_model(&truth().vehicle);
        assert!(model.effects().into_iter().eq(Effect::basic()));
        assert!(model.terms.iter().flat_map(|term| &term.coefficients).all(|c| c.value == 0.0));
        assert!(sysid::has_rotation(&model));
    }

    #[test]
    fn flights_held_against_a_model_that_was_fitted_to_one_of_them_are_told_so() {
        let flights = [1, 2].map(|seed| fly(&truth(), seed, 4.0, &ORDINARY));
        let vehicle = truth().vehicle;
        let mut held =
            FlightsOfOneKind::from_flights(&flights, &vehicle, Reading::default(), &Silent).unwrap();
        let mut model = truth();
        let record = model::FlightRecord {
            name: String::new(),
            sha256: held.flights[1].sha256.clone(),
            role: model::FlightRole::Train,
            samples: 1,
            wind_m_s: None,
        };
        model.fit = Some(model::FitRecord { flights: vec![record], ..Default::default() });
        held.hold_against(&model, &[], (Likeness::SAME, Reference::Model(None)), &Silent).unwrap();
        let told: Vec<(&str, FaultKind)> =
            held.faults.listed().iter().map(|l| (l.whose.as_str(), l.fault.kind)).collect();
        assert_eq!(told, [("flight-2.csv", FaultKind::FittedOn)]);
    }

    #[test]
    fn flights_of_commands_get_no_trim() {
        let flown = |seed| fly(&truth(), seed, 4.0, &ORDINARY);
        let (train, validate) = ([flown(1), flown(2)], [flown(3)]);
        let vehicle = truth().vehicle;
        let mut sets =
            FlightSets::from_flights(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap();
        sets.hold_against(&truth(), &[], &Silent).unwrap();
        assert!(sets.all().all(|flight| flight.prepared.trim.is_none()));
        // What the clocks are held against: each flight says how late its commands are.
        assert!(sets.train().iter().all(|flight| flight.alignment.is_some()));
    }
}
