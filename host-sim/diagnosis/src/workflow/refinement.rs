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
    let mut record = sets.record(&better);
    record.rotation_refused = model.fit.as_ref().map_or_else(Vec::new, |fit| fit.rotation_refused.clone());
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
