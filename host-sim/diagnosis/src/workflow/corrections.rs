//! What belongs to single flights and not to the craft: the offset between their clocks, and their trim.

use model::{Effect, Model, Vehicle};
use sysid::{Prepared, Reference};

use crate::workflow::loaded::LoadedFlight;
use crate::workflow::sets::FlightSets;

impl FlightSets {
    /// Aligns the training flights with each other and the held-out ones to `model`, and finds the training flights' trim.
    pub(crate) fn align(&mut self, model: &Model) {
        self.align_training(model);
        self.align_held_out(model);
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

    /// Aligns the held-out flights to a model of the training flights.
    pub(crate) fn align_held_out(&mut self, model: &Model) {
        let delay = sysid::fit::alignment::common_delay_s(model, &self.train());
        align_to(&mut self.held_out.0, model, Reference::Model(delay));
    }
}

/// Aligns flights to a model whose coefficients stay.
pub(crate) fn align_to(flights: &mut [LoadedFlight], model: &Model, reference: Reference) {
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
