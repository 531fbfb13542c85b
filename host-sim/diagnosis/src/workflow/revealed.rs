//! What a drag is that only winds of the flights' own bring to light.
//!
//! A flight's wind is told by the drag that turns its push into one. With a linear drag, that wind leaves nothing of the push for a
//! drag that grows with the airspeed to explain, whatever the true drag is: beside winds that were found without it, it is never
//! missing. So the two are found together and held against the winds and the model without it, along the axes that tell a wind.

use model::{Axis, Effect, Model};

use crate::Options;
use crate::change::WIND;
use crate::finding::EffectFinding;
use crate::held_out::{Validated, examine_along, fit_and_validate};
use crate::workflow::error::WorkflowError;
use crate::workflow::sets::FlightSets;
use crate::workflow::winds::{Revealed, Winds};

impl FlightSets {
    /// Gives the flights the winds that they have beside an effect that winds reveal, where that is supported against the winds that they
    /// have now: the evidence for it.
    pub(crate) fn reveal(&mut self, model: &Model, options: &Options) -> Option<EffectFinding> {
        self.conceal();
        let candidates = options.candidates_by(model, &[self.train(), self.validate()].concat());
        let asked: Vec<Effect> = WIND.effect.reveals().filter(|effect| candidates.contains(effect)).collect();
        if asked.is_empty() {
            return None;
        }
        let winds = self.winds();
        let without = fit_and_validate(model, &model.effects(), &self.train(), &self.validate()).ok()?;
        for effect in asked {
            let found = self.beside(effect, &without, candidates.len());
            if let Some(finding) = found.filter(|finding| finding.supported) {
                self.revealed = Some(Revealed { finding: finding.clone(), without: winds });
                return Some(finding);
            }
            self.blow(&winds);
        }
        None
    }

    /// Finds the flights' winds beside an effect, and its evidence in them.
    fn beside(&mut self, effect: Effect, without: &Validated, candidates: usize) -> Option<EffectFinding> {
        let mut model = without.fit.model.clone();
        model.set(effect, &vec![0.0; effect.info().coefficients.len()]);
        let windy = self.find_weather(&model)?;
        let flights = (&self.train()[..], &self.validate()[..]);
        let with = fit_and_validate(&windy, &windy.effects(), flights.0, flights.1).ok()?;
        Some(examine_along(&[Axis::U, Axis::V], without, &with, effect, flights, candidates))
    }

    /// The evidence for an effect that winds reveal, if these flights are in them.
    pub(crate) fn revealed_as(&self, effect: Effect) -> Option<&EffectFinding> {
        self.revealed.as_ref().map(|revealed| &revealed.finding).filter(|finding| finding.effect == effect)
    }

    /// Gives the flights back the winds that they have without the effect that was revealed.
    pub(crate) fn conceal(&mut self) {
        if let Some(revealed) = self.revealed.take() {
            self.blow(&revealed.without);
        }
    }

    /// What is so in the winds that the flights have without the effect that was revealed.
    pub(crate) fn concealed<T>(
        &mut self,
        of: impl FnOnce(&mut Self) -> Result<T, WorkflowError>,
    ) -> Result<T, WorkflowError> {
        let Some(revealed) = self.revealed.take() else { return of(self) };
        let winds = self.winds();
        self.blow(&revealed.without);
        let found = of(self);
        self.blow(&winds);
        self.revealed = Some(revealed);
        found
    }

    /// Those that the flights are in.
    pub(crate) fn winds(&self) -> Winds {
        Winds::of(self.all())
    }

    /// Lets others blow.
    pub(crate) fn blow(&mut self, winds: &Winds) {
        winds.blow(self.training.0.iter_mut().chain(&mut self.held_out.0));
    }
}

#[cfg(test)]
mod tests {
    use flights::Flight;
    use sysid::FaultKind;

    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{
        Explanation, FlightsOfOneKind, LoadedFlight, Reading, Silent, add, compare, diagnose, explain,
    };

    const WINDS_M_S: [[f64; 2]; 5] = [[0.0, 0.0], [-2.0, 0.5], [-3.5, 0.0], [-1.0, 1.0], [-3.0, -0.5]];

    fn explained(drag: Option<[f64; 2]>) -> (Explanation, FlightSets) {
        let flown = |(seed, wind): (usize, &[f64; 2])| {
            let mut world = truth();
            world.set(Effect::SteadyWind, wind);
            if let Some(values) = drag {
                world.set(Effect::QuadraticDrag, &values);
            }
            fly(&world, seed as u64, 12.0, &ORDINARY)
        };
        let flights: Vec<Flight> = WINDS_M_S.iter().enumerate().map(flown).collect();
        let vehicle = truth().vehicle;
        let (train, validate) = flights.split_at(3);
        let mut sets =
            FlightSets::from_flights(train, validate, &vehicle, Reading::default(), &Silent).unwrap();
        let explained = explain(&vehicle, &[], &mut sets, &Options::default(), None, &Silent).unwrap();
        (explained, sets)
    }

    fn winds_are_within(sets: &FlightSets, part: f64) {
        for (found, [north, east]) in sets.winds().0.iter().zip(WINDS_M_S) {
            let error = (found.x - north).hypot(found.y - east);
            assert!(error < part * north.hypot(east) + 0.1, "{found} for {north} {east}");
        }
    }

    #[test]
    fn a_drag_that_grows_with_the_airspeed_is_found_in_winds_that_were_told_by_it() {
        let (explained, sets) = explained(Some([-0.2; 2]));
        assert_eq!(explained.found(), [Effect::QuadraticDrag]);
        assert!(sets.faults.has(FaultKind::WindBetweenFlights));
        winds_are_within(&sets, 0.15);
    }

    /// A model file says in which winds it was fitted: held against the same flights later, it is what it was.
    #[test]
    fn a_model_that_was_explained_in_winds_is_held_against_its_flights_in_the_same() {
        let (explained, sets) = explained(Some([-0.2; 2]));
        let model = &explained.model;
        let [again, mut compared] = [&sets.held_out.0, &sets.held_out.0].map(|own| calm(own));
        let mut compared =
            FlightsOfOneKind::from_loaded(std::mem::take(&mut compared), &model.vehicle, Reading::default())
                .unwrap();
        let errors = compare(model, &mut compared, &Silent).unwrap().total;
        for axis in model::AXES {
            let recorded = model.fit.as_ref().unwrap().held_out[axis].rms;
            assert!((errors[axis].rms / recorded - 1.0).abs() < 1e-6, "{axis}: {recorded}, {errors:?}");
        }
        assert!(compared.faults.has(FaultKind::WindBetweenFlights));
        let loaded = |train| {
            FlightSets::from_loaded(train, again.clone(), &model.vehicle, Reading::default()).unwrap()
        };
        let mut same = loaded(calm(&sets.training.0));
        let found = diagnose(model, &[], &mut same, &Options::default(), &Silent).unwrap();
        assert_eq!(found.best(), None, "{}", found.summary);
        assert!(same.faults.has(FaultKind::WindBetweenFlights));
        // A push along one axis that is not there does not stand for what the winds are.
        let added = add(model, Effect::Tether, &mut loaded(calm(&sets.training.0)), None, &Silent).unwrap();
        assert!(!added.addition.finding.supported, "{}", added.addition.finding.reason);
        let record = added.model.fit.unwrap();
        assert!(record.flights.iter().all(|flight| flight.wind_m_s.is_some()), "{:?}", record.flights);
    }

    /// The same flights as they were read.
    fn calm(flights: &[LoadedFlight]) -> Vec<LoadedFlight> {
        let mut flights = flights.to_vec();
        Winds(vec![Default::default(); flights.len()]).blow(flights.iter_mut());
        flights
    }

    #[test]
    fn winds_beside_a_linear_drag_reveal_nothing() {
        let (explained, sets) = explained(None);
        assert_eq!(explained.found(), []);
        winds_are_within(&sets, 0.1);
    }
}
