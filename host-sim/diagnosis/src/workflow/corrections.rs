//! Flights before a model meets them: what is checked, and what belongs to single flights and not to the craft, the offset
//! between their clocks and their trim.

use model::{Effect, Model, Vehicle};
use sysid::checks::vehicle::Likeness;
use sysid::{Prepared, Reference};

use crate::observer::Observer;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::{LoadedFlight, leave_out_undefined};
use crate::workflow::sets::{FlightSets, FlightsOfOneKind};

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
        self.align_training(model);
        self.align_held_out(model);
        Ok(())
    }

    /// Aligns the training flights with each other and finds their trim.
    pub(crate) fn align_training(&mut self, model: &Model) {
        let mut train = prepared(&mut self.training.0);
        sysid::align(&mut train, model);
        sysid::fit::trim::estimate(&mut train, model);
    }

    /// Finds the training flights' trim anew, with what has joined the model.
    pub(crate) fn trim(&mut self, model: &Model) {
        sysid::fit::trim::estimate(&mut prepared(&mut self.training.0), model);
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

fn prepared(flights: &mut [LoadedFlight]) -> Vec<&mut Prepared> {
    flights.iter_mut().map(|flight| &mut flight.prepared).collect()
}
