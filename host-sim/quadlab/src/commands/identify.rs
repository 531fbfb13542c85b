//! `quadlab identify`: the basic model fitted to flights and judged on others.

use std::path::PathBuf;

use model::{AxisError, Effect, FitRecord, FlightRole, Model, PerAxis, Vehicle};
use serde::Serialize;
use sysid::MotorsOfFlights;

use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::{SetOptions, Sets};
use crate::cli::output::{Outcome, check_outputs};
use crate::cli::progress;
use crate::cli::user_effects::EffectOptions;
use crate::real_logs::{self, RefineOptions, RefinementEntry};
use crate::render::tables;

/// Identify the basic model from flights.
///
/// Fits thrust, drag, rotor moments, inertia coupling, gyroscopic torque and angular damping to the training flights by
/// least squares, judges them on the flights held out, and writes the model.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab identify --vehicle vehicle.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out model.toml")]
pub(crate) struct Options {
    /// What is known of the craft before any flight, for example: --vehicle vehicle.toml
    #[arg(long, value_name = "TOML")]
    vehicle: PathBuf,

    #[command(flatten)]
    sets: SetOptions,

    #[command(flatten)]
    effects: EffectOptions,

    #[command(flatten)]
    refine: RefineOptions,

    /// Model file to write, for example: --out model.toml
    #[arg(long, value_name = "TOML")]
    out: PathBuf,

    #[command(flatten)]
    faults: FaultOptions,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let mut inputs = options.sets.paths();
    inputs.push(&options.vehicle);
    inputs.extend(options.effects.paths());
    check_outputs([&options.out], &inputs)?;
    let vehicle = Vehicle::read(&options.vehicle)?;
    let effects = options.effects.read()?;
    let mut sets = Sets::read(&options.sets, &vehicle, options.faults.reading(options.json))?;
    sets.leave_out_undefined(&Model::new(vehicle.clone()), &effects)?;
    let mut identified = identify(&vehicle, &mut sets, options.json)?;
    let refinement = real_logs::refine(&mut identified.model, &sets, &options.refine, options.json)?;
    report::write_atomic(&options.out, identified.model.to_toml())?;
    if options.json {
        faults::json(&document(&identified, &sets, refinement), sets.all(), &sets.faults)
    } else {
        sets.faults.warn();
        Ok(text(options, &identified, &sets, refinement.as_ref()))
    }
}

/// A basic model and how well determined it is.
pub(crate) struct Identified {
    /// With its fit record.
    pub(crate) model: Model,
    /// Condition number of the column-scaled problem.
    pub(crate) condition: f64,
    /// Motor coefficients flight by flight.
    pub(crate) motors: Vec<MotorsOfFlights>,
}

/// Fits the basic model.
pub(crate) fn identify(vehicle: &Vehicle, sets: &mut Sets, json: bool) -> anyhow::Result<Identified> {
    let spinner = progress::spinner(json);
    spinner.set_message("fitting the basic model");
    let basic: Vec<Effect> = Effect::basic().collect();
    real_logs::align_training(sets, &real_logs::basic_model(vehicle));
    let mut fit = sysid::fit(&sets.train(), vehicle, &basic, None).map_err(|refused| sets.blame(refused))?;
    let rotation_refused = sysid::rotation_doubts(&fit.model, &sets.train());
    if !rotation_refused.is_empty() {
        let forces = sysid::without_rotation(&basic);
        fit = sysid::fit(&sets.train(), vehicle, &forces, None).map_err(|refused| sets.blame(refused))?;
        real_logs::align_training(sets, &fit.model);
    }
    let mut model = fit.model;
    real_logs::align_held_out(sets, &model);
    model.fit = Some(FitRecord { rotation_refused, ..sets.record(&model) });
    let motors = real_logs::motors(&model, sets);
    spinner.finish_and_clear();
    real_logs::warn(&model, sets, &motors);
    sets.faults.of_fit(&model, sets);
    Ok(Identified { model, condition: fit.condition, motors })
}

fn text(
    options: &Options,
    identified: &Identified,
    sets: &Sets,
    refinement: Option<&RefinementEntry>,
) -> Outcome {
    let model = &identified.model;
    let record = real_logs::record_of(model);
    let roles = sets.train.iter().map(|f| (f, "train")).chain(sets.validate.iter().map(|f| (f, "validate")));
    let mut more = String::new();
    for grid in [tables::trim(&sets.train), tables::motors(&identified.motors)] {
        if grid.has_rows() {
            more.push_str(&format!("{}\n", grid.to_text()));
        }
    }
    let refused = (!record.rotation_refused.is_empty())
        .then(|| format!("Note: {}.", real_logs::rotation_refused(&record.rotation_refused)));
    for sentence in refused.into_iter().chain(refinement.map(RefinementEntry::text)) {
        more.push_str(&format!("{}\n", tables::paragraph(&sentence)));
    }
    Outcome::done(format!(
        "{}\n{}\n{}\n{}\n{more}condition number of the fit: {}\nmodel written to {}\n",
        tables::flights(roles).to_text(),
        tables::clocks(sets.all()).to_text(),
        tables::coefficients(model).to_text(),
        tables::fit_errors(&record.train, &record.held_out).to_text(),
        report::significant(identified.condition, 2),
        options.out.display(),
    ))
}

#[derive(Serialize)]
struct Document<'a> {
    vehicle: &'a str,
    flights: Vec<FlightEntry<'a>>,
    coefficients: Vec<CoefficientEntry>,
    train: PerAxis<AxisError>,
    held_out: PerAxis<AxisError>,
    condition: f64,
    /// Why the model has no rotation, where it has none.
    rotation_refused: Vec<String>,
    /// Motor coefficients flight by flight, and whether they follow how the flights were flown.
    motors: &'a [MotorsOfFlights],
    #[serde(skip_serializing_if = "Option::is_none")]
    refinement: Option<RefinementEntry>,
}

#[derive(Serialize)]
struct FlightEntry<'a> {
    name: &'a str,
    sha256: &'a str,
    role: FlightRole,
    samples: usize,
    gyro_bias_rad_s: [f64; 3],
    accelerometer_bias_m_s2: [f64; 2],
    /// Clock of the rotor samples against that of the state.
    alignment: Option<&'a sysid::Alignment>,
    /// Constants of the rows beyond the mean of the training flights.
    trim: Option<sysid::fit::trim::Trim>,
    force_target: &'static str,
    notes: &'a [String],
}

#[derive(Serialize)]
struct CoefficientEntry {
    effect: &'static str,
    name: &'static str,
    value: f64,
    std_error: Option<f64>,
    unit: &'static str,
}

fn document<'a>(
    identified: &'a Identified,
    sets: &'a Sets,
    refinement: Option<RefinementEntry>,
) -> Document<'a> {
    let model = &identified.model;
    let record = real_logs::record_of(model);
    let flights = sets
        .all()
        .zip(&record.flights)
        .map(|(flight, entry)| FlightEntry {
            name: &flight.prepared.name,
            sha256: &flight.sha256,
            role: entry.role,
            samples: flight.prepared.rows(),
            gyro_bias_rad_s: flight.prepared.gyro_bias_rad_s,
            accelerometer_bias_m_s2: flight.prepared.accelerometer_bias_m_s2,
            alignment: flight.prepared.alignment.as_ref(),
            trim: flight.prepared.trim,
            force_target: flight.prepared.force_target.name(),
            notes: &flight.prepared.notes,
        })
        .collect();
    let coefficients = model.terms.iter().flat_map(|term| {
        let info = term.effect.info();
        info.coefficients.iter().zip(&term.coefficients).map(|(c, estimate)| CoefficientEntry {
            effect: info.id,
            name: c.name,
            value: estimate.value,
            std_error: estimate.std_error,
            unit: c.unit,
        })
    });
    Document {
        vehicle: &model.vehicle.name,
        flights,
        coefficients: coefficients.collect(),
        train: record.train,
        held_out: record.held_out,
        condition: identified.condition,
        rotation_refused: record.rotation_refused,
        motors: &identified.motors,
        refinement,
    }
}
