//! What a model file says of its fit.

use model::{Axis, AxisError, FitRecord, FlightRecord, FlightRole, Model, PerAxis};
use sysid::Prepared;

use crate::change_scatter::scatter;
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
            scatter: scatter(model, &all),
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
        "the rotation is not identifiable from these flights ({}); the model has forces only, and predictions \
         take the logged attitude",
        reasons.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::testing::{loaded, truth};

    fn error(rms: f64) -> AxisError {
        AxisError { sse: 4.0 * rms, rms, r2: 0.9, samples: 4 }
    }

    #[test]
    fn axes_that_a_model_does_not_speak_of_are_shown_without_figures() {
        let mut model = truth();
        let errors = PerAxis::from_fn(|axis| error(1.0 + axis.index() as f64));
        model.fit = Some(FitRecord { train: errors, held_out: errors, ..FitRecord::default() });
        assert_eq!(shown_record(&model).train, errors);
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        let shown = shown_record(&model);
        for errors in [shown.train, shown.held_out] {
            assert_eq!(errors.w, error(3.0));
            assert!(errors.q.rms.is_nan() && errors.q.sse.is_nan() && errors.q.r2.is_nan());
            assert_eq!(errors.q.samples, 4);
        }
        model.fit = None;
        assert_eq!(shown_record(&model).train.u, AxisError::default());
    }

    #[test]
    fn every_flight_is_recorded_with_its_role_its_hash_and_its_rows() {
        let flights = loaded([1, 2]);
        let entries = entries(&flights, FlightRole::Validate);
        assert_eq!(entries.len(), 2);
        assert_eq!((entries[1].name.as_str(), entries[1].role), ("flight-2.csv", FlightRole::Validate));
        assert_eq!(entries[1].sha256, flights[1].sha256);
        // 400 samples less two windows at either end.
        assert_eq!(entries[1].samples, 340);
    }

    #[test]
    fn the_errors_of_no_flights_are_none() {
        assert_eq!(errors(&truth(), &[]), PerAxis::default());
    }

    #[test]
    fn all_reasons_against_a_rotation_are_in_one_sentence() {
        assert_eq!(
            rotation_refused(&["motor 1 pulls".into(), "nothing moves".into()]),
            "the rotation is not identifiable from these flights (motor 1 pulls; nothing moves); the model \
             has forces only, and predictions take the logged attitude"
        );
    }
}
