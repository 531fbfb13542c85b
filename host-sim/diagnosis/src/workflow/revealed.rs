//! What a drag is that only winds of the flights' own bring to light.
//!
//! A flight's wind is told by the drag that turns its push into one. With a linear drag, that wind leaves nothing of the push for a
//! drag that grows with the airspeed to explain, whatever the true drag is: beside winds that were found without it, it is never
//! missing. So the two are found together and held against the winds and the model without it, along the axes that tell a wind.

use model::{Axis, Effect, Model};

use crate::Options;
use crate::finding::EffectFinding;
use crate::held_out::{Validated, examine_along, fit_and_validate};
use crate::workflow::error::WorkflowError;
use crate::workflow::own_winds::WIND;
use crate::workflow::sets::FlightSets;
use crate::workflow::winds::{Revealed, Winds};

impl FlightSets {
    /// Gives the flights the winds that they have beside an effect that winds reveal, where that is supported against the winds that they
    /// have now: the evidence for it.
    pub(crate) fn reveal(&mut self, model: &Model, options: &Options) -> Option<EffectFinding> {
        self.conceal();
        let candidates = options.candidates_by(model, &[self.train(), self.validate()].concat());
        let asked: Vec<Effect> = WIND.reveals().filter(|effect| candidates.contains(effect)).collect();
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

    fn winds(&self) -> Winds {
        Winds(self.all().map(|flight| flight.prepared.wind_ned_m_s).collect())
    }

    fn blow(&mut self, winds: &Winds) {
        let flights = self.training.0.iter_mut().chain(&mut self.held_out.0);
        flights.zip(&winds.0).for_each(|(flight, wind)| flight.prepared.wind_ned_m_s = *wind);
    }
}

#[cfg(test)]
mod tests {
    use flights::Flight;
    use sysid::FaultKind;

    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent, explain};

    const WINDS_M_S: [[f64; 2]; 5] = [[0.0, 0.0], [-2.0, 0.5], [-3.5, 0.0], [-1.0, 1.0], [-3.0, -0.5]];

    fn explained(drag: Option<[f64; 2]>) -> (Vec<Effect>, FlightSets) {
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
        (explained.found(), sets)
    }

    fn winds_are_within(sets: &FlightSets, part: f64) {
        for (found, [north, east]) in sets.winds().0.iter().zip(WINDS_M_S) {
            let error = (found.x - north).hypot(found.y - east);
            assert!(error < part * north.hypot(east) + 0.1, "{found} for {north} {east}");
        }
    }

    #[test]
    fn a_drag_that_grows_with_the_airspeed_is_found_in_winds_that_were_told_by_it() {
        let (found, sets) = explained(Some([-0.2; 2]));
        assert_eq!(found, [Effect::QuadraticDrag]);
        assert!(sets.faults.has(FaultKind::WindBetweenFlights));
        winds_are_within(&sets, 0.15);
    }

    #[test]
    fn winds_beside_a_linear_drag_reveal_nothing() {
        let (found, sets) = explained(None);
        assert_eq!(found, []);
        winds_are_within(&sets, 0.1);
    }
}
