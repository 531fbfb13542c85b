//! What real logs need before a model meets them: the clock of each flight's rotor samples.

use model::{Effect, Model, Vehicle};
use sysid::{Prepared, Reference};

use crate::flights::{Loaded, Sets};

/// Aligns the training flights with each other and the held-out ones to `model`.
pub(crate) fn align(sets: &mut Sets, model: &Model) {
    align_training(sets, model);
    align_held_out(sets, model);
}

/// Aligns the training flights with each other.
pub(crate) fn align_training(sets: &mut Sets, model: &Model) {
    sysid::align(&mut prepared(&mut sets.train), model);
}

/// Aligns the held-out flights to a model of the training flights.
pub(crate) fn align_held_out(sets: &mut Sets, model: &Model) {
    let delay = sysid::alignment::common_delay_s(model, &sets.train());
    align_flights(&mut sets.validate, model, Reference::Model(delay));
}

/// Aligns flights to a model whose coefficients stay.
pub(crate) fn align_flights(flights: &mut [Loaded], model: &Model, reference: Reference) {
    sysid::align_to(model, &mut prepared(flights), reference);
}

/// What offsets of flights of commands are counted from, by the model's record.
pub(crate) fn reference_of(model: &Model) -> Reference {
    Reference::Model(model.fit.as_ref().and_then(|fit| fit.rotor_delay_s))
}

/// The basic model without coefficients.
pub(crate) fn basic_model(vehicle: &Vehicle) -> Model {
    let mut model = Model::new(vehicle.clone());
    for effect in Effect::basic() {
        model.set(effect, &vec![0.0; effect.info().coefficients.len()]);
    }
    model
}

fn prepared(flights: &mut [Loaded]) -> Vec<&mut Prepared> {
    flights.iter_mut().map(|flight| &mut flight.prepared).collect()
}
