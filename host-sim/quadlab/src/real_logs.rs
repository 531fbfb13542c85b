//! What real logs need before a model meets them, and what they say about it afterwards: clocks and trim of single
//! flights, motors that answer the airflow, a rotation that the flights do not determine, refinement on predictions.

use model::{
    Axis, AxisError, Effect, FitRecord, HistoryEntry, Model, OpenLoopSums, PerAxis, RefinementRecord, Vehicle,
};
use serde::Serialize;
use sysid::compare::HorizonError;
use sysid::fit::output_error::Rows;
use sysid::{MotorsOfFlights, Prepared, Reference, RefinementOutcome};

use crate::cli::flights::{Loaded, Sets};
use crate::cli::progress;

/// Whether to refine, and what.
#[derive(clap::Args)]
pub(crate) struct RefineOptions {
    /// Refine the coefficients on predictions of half a second instead of accelerations: those of the moments, or all.
    /// Kept only where flights held out are predicted better. For example: --refine, or --refine all
    #[arg(long, value_name = "ROWS", num_args = 0..=1, default_missing_value = "moments")]
    pub(crate) refine: Option<Refined>,
}

/// Which coefficients are refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Refined {
    /// Those that act on p, q and r alone; forces stay as the accelerometer has them
    Moments,
    /// Every linear coefficient
    All,
}

/// What a refinement did, for JSON.
#[derive(Serialize)]
pub(crate) struct RefinementEntry {
    rows: Rows,
    kept: bool,
    reason: String,
    before: HorizonError,
    after: HorizonError,
}

impl From<RefinementOutcome> for RefinementEntry {
    fn from(o: RefinementOutcome) -> Self {
        Self { rows: o.rows, kept: o.kept, reason: o.reason, before: o.before, after: o.after }
    }
}

impl RefinementEntry {
    /// One sentence.
    pub(crate) fn text(&self) -> String {
        format!("Refinement {}: {}.", if self.kept { "kept" } else { "not kept" }, self.reason)
    }
}

/// Aligns the training flights with each other and the held-out ones to `model`, and finds the training flights' trim.
pub(crate) fn align(sets: &mut Sets, model: &Model) {
    align_training(sets, model);
    align_held_out(sets, model);
}

/// Aligns the training flights with each other and finds their trim.
pub(crate) fn align_training(sets: &mut Sets, model: &Model) {
    let mut train = prepared(&mut sets.train);
    sysid::align(&mut train, model);
    sysid::fit::trim::estimate(&mut train, model);
}

/// Finds the training flights' trim anew, with what has joined the model.
pub(crate) fn trim(sets: &mut Sets, model: &Model) {
    sysid::fit::trim::estimate(&mut prepared(&mut sets.train), model);
}

/// Aligns the held-out flights to a model of the training flights.
pub(crate) fn align_held_out(sets: &mut Sets, model: &Model) {
    let delay = sysid::fit::alignment::common_delay_s(model, &sets.train());
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
    Effect::basic().for_each(|effect| model.set(effect, &vec![0.0; effect.info().coefficients.len()]));
    model
}

/// Refines `model` if asked, and brings its fit record and history up to date.
pub(crate) fn refine(
    model: &mut Model,
    sets: &Sets,
    options: &RefineOptions,
    json: bool,
) -> anyhow::Result<Option<RefinementEntry>> {
    let Some(refined) = options.refine else { return Ok(None) };
    let rows = match refined {
        Refined::Moments => Rows::Moments,
        Refined::All => Rows::All,
    };
    let spinner = progress::spinner(json);
    spinner.set_message("refining on predictions");
    let refinement = sysid::refine(model, &sets.train(), &sets.validate(), rows)?;
    let outcome = refinement.outcome;
    let sse = |record: Option<&FitRecord>| {
        record.map_or_else(PerAxis::default, |fit| PerAxis::from_fn(|axis| fit.held_out[axis].sse))
    };
    let before = sse(model.fit.as_ref());
    let refused = model.fit.as_ref().map_or_else(Vec::new, |fit| fit.rotation_refused.clone());
    *model = Model { fit: None, ..refinement.model };
    let mut record = sets.record(model);
    record.rotation_refused = refused;
    record.refinement = Some(RefinementRecord {
        rows: if rows == Rows::Moments { "moments".into() } else { "all".into() },
        kept: outcome.kept,
        reason: outcome.reason.clone(),
        before: sums(&outcome.before),
        after: sums(&outcome.after),
    });
    model.history.push(HistoryEntry {
        effect: "refinement".into(),
        supported: outcome.kept,
        sse_before: before,
        sse_after: sse(Some(&record)),
    });
    model.fit = Some(record);
    spinner.finish_and_clear();
    Ok(Some(outcome.into()))
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

/// The fit record of a model as it is shown: errors of axes that the model does not speak of are not numbers.
pub(crate) fn record_of(model: &Model) -> FitRecord {
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

/// Motor coefficients of each training flight.
pub(crate) fn motors(model: &Model, sets: &Sets) -> Vec<MotorsOfFlights> {
    sysid::motors_of_flights(model, &sets.train())
}

/// Doubts about a model to print on standard error, one line each.
pub(crate) fn warn(model: &Model, sets: &Sets, motors: &[MotorsOfFlights]) {
    let record = model.fit.as_ref();
    if let Some(reasons) = record.map(|fit| &fit.rotation_refused).filter(|reasons| !reasons.is_empty()) {
        eprintln!("warning: {}", rotation_refused(reasons));
    }
    for doubt in sysid::impossible_signs(model) {
        eprintln!("warning: {doubt}");
    }
    for flight in sets.all() {
        let wandering = flight.prepared.alignment.as_ref().filter(|a| !a.wandering.is_empty());
        if let Some(note) = wandering.and_then(sysid::Alignment::note) {
            eprintln!("warning: {}: {note}", flight.path.display());
        }
    }
    for warning in motors.iter().filter_map(|m| m.warning.as_ref()) {
        eprintln!("warning: {warning}");
    }
}

/// The sentence about a rotation that the flights do not determine.
pub(crate) fn rotation_refused(reasons: &[String]) -> String {
    format!(
        "the rotation is not identifiable from these flights ({}); the model holds the force rows only, and predictions \
         take the logged attitude",
        reasons.join("; ")
    )
}

fn prepared(flights: &mut [Loaded]) -> Vec<&mut Prepared> {
    flights.iter_mut().map(|flight| &mut flight.prepared).collect()
}
