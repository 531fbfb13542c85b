//! What a model file says of its fit.

use model::{Axis, AxisError, FitRecord, FlightRecord, FlightRole, Model};
use sysid::{Prepared, Residuals};

use crate::change_scatter::scatter;
use crate::constant_force;
use crate::motor_answers;
use crate::tracker_mount;
use crate::unidentified::unidentified;
use crate::workflow::loaded::LoadedFlight;
use crate::workflow::sets::FlightSets;

impl FlightSets {
    /// The flights behind a model, its errors on both sets, and what of it they do not determine. `rotation_refused` says why it
    /// has no rotation. What new flights are held against comes with [`record_for_changes`](Self::record_for_changes).
    pub(crate) fn record(&self, model: &Model, rotation_refused: Vec<String>) -> FitRecord {
        let mut flights = entries(self.training.loaded(), FlightRole::Train);
        flights.extend(entries(self.held_out.loaded(), FlightRole::Validate));
        let all: Vec<&Prepared> = self.all().map(|flight| &flight.prepared).collect();
        let (train, validate) = (self.train(), self.validate());
        let [fitted, held_out] = [&train, &validate].map(|flights| residuals(model, flights));
        let mut not_identified = unidentified(model, &rotation_refused, &[], &train, (&validate, &held_out));
        not_identified.extend(self.faults.not_identified());
        FitRecord {
            flights,
            train: sysid::errors(&fitted),
            held_out: sysid::errors(&held_out),
            flown_speed_m_s: flown_speed_m_s(&train),
            balance: sysid::fit::balance::record(
                model,
                all.iter().copied().zip(fitted.iter().chain(&held_out)),
            ),
            rotor_delay_s: sysid::fit::alignment::common_delay_s(model, &train),
            rotation_refused,
            not_identified,
            ..FitRecord::default()
        }
    }

    /// The same of a model that another one became: why that had no rotation is true of it as well.
    pub(crate) fn record_after(&self, before: &Model, model: &Model) -> FitRecord {
        self.record(model, before.fit.as_ref().map_or_else(Vec::new, |fit| fit.rotation_refused.clone()))
    }

    /// Adds to the record of a model what new flights are held against: how far each change's estimate scatters between the flights, the
    /// motors' answers to their commands, and how the tracker lies against the accelerometer and what force that told. A model that is kept needs it; it is as much
    /// work as many fits, so one on the way to another does not.
    pub fn record_for_changes(&self, model: &mut Model) {
        let all: Vec<&Prepared> = self.all().map(|flight| &flight.prepared).collect();
        let scatter = scatter(model, &all);
        let motor_answers = motor_answers::record(model, &all);
        let tracker_mount = tracker_mount::record(model, &all);
        if let Some(fit) = &mut model.fit {
            (fit.scatter, fit.motor_answers, fit.tracker_mount) = (scatter, motor_answers, tracker_mount);
            fit.constant_force = constant_force::record(&all);
        }
    }
}

/// Part of the samples that are flown faster than the speed that counts as flown.
const FASTER: f64 = 0.02;

/// Speed over ground that flights hardly ever exceed, m/s.
fn flown_speed_m_s(flights: &[&Prepared]) -> Option<f64> {
    let stretches = flights.iter().flat_map(|flight| &flight.stretches);
    let mut speeds: Vec<f64> = stretches
        .flat_map(|stretch| {
            let [north, east, _] = &stretch.velocity_ned_m_s;
            north.iter().zip(east).map(|(n, e)| n.hypot(*e))
        })
        .filter(|speed| speed.is_finite())
        .collect();
    speeds.sort_unstable_by(f64::total_cmp);
    let at = ((1.0 - FASTER) * speeds.len() as f64) as usize;
    speeds.get(at.min(speeds.len().saturating_sub(1))).copied()
}

fn entries(flights: &[LoadedFlight], role: FlightRole) -> Vec<FlightRecord> {
    let entry = |flight: &LoadedFlight| FlightRecord {
        name: flight.prepared.name.clone(),
        sha256: flight.sha256.clone(),
        role,
        samples: flight.prepared.rows() as u64,
        wind_m_s: flight.prepared.has_own_wind().then(|| {
            let [north, east, _] = flight.prepared.wind_ned_m_s.into();
            [north, east]
        }),
    };
    flights.iter().map(entry).collect()
}

fn residuals(model: &Model, flights: &[&Prepared]) -> Vec<Residuals> {
    flights.iter().map(|flight| sysid::residuals(flight, model)).collect()
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
    use model::{Effect, PerAxis};

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
    fn what_is_not_identified_is_kept_with_the_errors() {
        let flown = |seed| crate::testing::fly(&truth(), seed, 4.0, &crate::testing::ORDINARY);
        let (train, validate, vehicle) = ([flown(1), flown(2)], [flown(3)], truth().vehicle);
        let reading = crate::workflow::Reading::default();
        let sets =
            FlightSets::from_flights(&train, &validate, &vehicle, reading, &crate::workflow::Silent).unwrap();
        assert_eq!(sets.record(&truth(), Vec::new()).not_identified, []);
        let mut forces = truth();
        forces.terms.retain(|term| [Effect::Thrust, Effect::LinearDrag].contains(&term.effect));
        let record = sets.record(&forces, vec!["clocks drift".into()]);
        assert_eq!(record.rotation_refused, ["clocks drift"]);
        let [reason] = &record.not_identified[..] else { panic!("{:?}", record.not_identified) };
        assert!(reason.group == model::Group::Rotation && reason.reason.ends_with("because clocks drift"));
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
