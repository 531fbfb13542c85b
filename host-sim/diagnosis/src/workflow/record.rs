//! What a model file says of its fit.

use model::{Axis, AxisError, FitRecord, FlightRecord, FlightRole, Model, PerAxis};
use sysid::Prepared;

use crate::changes;
use crate::workflow::loaded::LoadedFlight;
use crate::workflow::sets::FlightSets;

impl FlightSets {
    /// The flights behind a model and its errors on both sets.
    pub(crate) fn record(&self, model: &Model) -> FitRecord {
        let mut flights = entries(self.training.loaded(), FlightRole::Train);
        flights.extend(entries(self.held_out.loaded(), FlightRole::Validate));
        let all: Vec<&Prepared> = self.all().map(|flight| &flight.prepared).collect();
        FitRecord {
            flights,
            train: errors(model, &self.train()),
            held_out: errors(model, &self.validate()),
            scatter: changes::scatter(model, &all),
            rotor_delay_s: sysid::fit::alignment::common_delay_s(model, &self.train()),
            ..FitRecord::default()
        }
    }
}

fn entries(flights: &[LoadedFlight], role: FlightRole) -> Vec<FlightRecord> {
    let entry = |flight: &LoadedFlight| FlightRecord {
        name: flight.prepared.name.clone(),
        sha256: flight.sha256.clone(),
        role,
        samples: flight.prepared.rows() as u64,
    };
    flights.iter().map(entry).collect()
}

fn errors(model: &Model, flights: &[&Prepared]) -> PerAxis<AxisError> {
    let all: Vec<_> = flights.iter().map(|flight| sysid::residuals(flight, model)).collect();
    sysid::errors(&all)
}

/// The fit record of a model as it is shown: errors of axes that the model does not speak of are not numbers.
pub fn shown_record(model: &Model) -> FitRecord {
    let mut record = model.fit.clone().unwrap_or_default();
    if !sysid::has_rotation(model) {
        for errors in [&mut record.train, &mut record.held_out] {
            for axis in [Axis::P, Axis::Q, Axis::R] {
                errors[axis] = AxisError { sse: f64::NAN, rms: f64::NAN, r2: f64::NAN, ..errors[axis] };
            }
        }
    }
    record
}

/// The sentence about a rotation that the flights do not determine.
pub fn rotation_refused(reasons: &[String]) -> String {
    format!(
        "the rotation is not identifiable from these flights ({}); the model holds the force rows only, and predictions \
         take the logged attitude",
        reasons.join("; ")
    )
}
