//! Refinement on predictions: a model's coefficients fitted to half a second of flight instead of to accelerations.

use model::{FitRecord, HistoryEntry, Model, OpenLoopSums, PerAxis, RefinementRecord};
use sysid::RefinementOutcome;
use sysid::compare::HorizonError;
use sysid::fit::output_error::Rows;

use crate::observer::{Observer, Progress};
use crate::workflow::error::WorkflowError;
use crate::workflow::sets::FlightSets;

/// Refines `model` if `rows` are asked for, and leaves it as it is otherwise.
pub(crate) fn refine(
    model: Model,
    sets: &FlightSets,
    rows: Option<Rows>,
    observer: &dyn Observer,
) -> Result<(Model, Option<RefinementOutcome>), WorkflowError> {
    let Some(rows) = rows else { return Ok((model, None)) };
    observer.progress(Progress { activity: "refining on predictions", steps: None });
    let refinement = sysid::refine(&model, &sets.train(), &sets.validate(), rows)?;
    let outcome = refinement.outcome;
    let before = held_out_sse(model.fit.as_ref());
    let mut better = Model { fit: None, ..refinement.model };
    let mut record = sets.record_after(&model, &better);
    record.refinement = Some(RefinementRecord {
        rows: if rows == Rows::Moments { "moments".into() } else { "all".into() },
        kept: outcome.kept,
        reason: outcome.reason.clone(),
        before: sums(&outcome.before),
        after: sums(&outcome.after),
    });
    better.history.push(HistoryEntry {
        effect: "refinement".into(),
        supported: outcome.kept,
        sse_before: before,
        sse_after: held_out_sse(Some(&record)),
    });
    better.fit = Some(record);
    Ok((better, Some(outcome)))
}

fn held_out_sse(record: Option<&FitRecord>) -> PerAxis<f64> {
    record.map_or_else(PerAxis::default, |fit| PerAxis::from_fn(|axis| fit.held_out[axis].sse))
}

fn sums(e: &HorizonError) -> OpenLoopSums {
    // A model file holds numbers: a prediction that ran away is a very large one.
    let finite = |value: f64| if value.is_finite() { value } else { f64::MAX };
    OpenLoopSums {
        position_m: finite(e.position_m),
        velocity_m_s: finite(e.velocity_m_s),
        attitude_rad: finite(e.attitude_rad),
        rate_rad_s: finite(e.rate_rad_s),
    }
}

#[cfg(test)]
mod tests {
    use model::AxisError;

    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent};

    #[test]
    fn a_prediction_that_ran_away_is_a_very_large_number() {
        let ran_away = HorizonError {
            position_m: f64::INFINITY,
            velocity_m_s: f64::NAN,
            attitude_rad: 0.5,
            rate_rad_s: f64::NEG_INFINITY,
        };
        let sums = sums(&ran_away);
        assert_eq!((sums.position_m, sums.velocity_m_s, sums.rate_rad_s), (f64::MAX, f64::MAX, f64::MAX));
        assert_eq!(sums.attitude_rad, 0.5);
    }

    #[test]
    fn the_squares_are_those_of_the_held_out_flights() {
        let at = |sse: f64| {
            PerAxis::from_fn(|axis| AxisError { sse: sse + axis.index() as f64, ..AxisError::default() })
        };
        let record = FitRecord { train: at(100.0), held_out: at(1.0), ..FitRecord::default() };
        assert_eq!(held_out_sse(Some(&record)).q, 5.0);
        assert_eq!(held_out_sse(None), PerAxis::default());
    }

    #[test]
    fn a_model_is_left_alone_unless_a_refinement_is_asked_for() {
        let flown = |seed| fly(&truth(), seed, 4.0, &ORDINARY);
        let (train, validate) = ([flown(1), flown(2)], [flown(3)]);
        let vehicle = truth().vehicle;
        let sets =
            FlightSets::from_flights(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap();
        let (model, outcome) = refine(truth(), &sets, None, &Silent).unwrap();
        assert!(outcome.is_none());
        assert_eq!(model, truth());
        let (model, outcome) = refine(truth(), &sets, Some(Rows::Moments), &Silent).unwrap();
        let outcome = outcome.expect("it was asked for");
        let entry = model.history.last().unwrap();
        assert_eq!((entry.effect.as_str(), entry.supported), ("refinement", outcome.kept));
        let record = model.fit.unwrap();
        let refinement = record.refinement.unwrap();
        assert_eq!((refinement.rows.as_str(), refinement.kept), ("moments", outcome.kept));
        assert_eq!(record.flights.len(), 3);
        assert_eq!(entry.sse_after.u, record.held_out.u.sse);
    }
}
