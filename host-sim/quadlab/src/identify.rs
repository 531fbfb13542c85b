//! `quadlab identify`: the basic model fitted to flights and judged on others.

use std::path::PathBuf;

use model::{AxisError, Effect, FlightRole, Model, PerAxis, Vehicle};
use serde::Serialize;

use crate::flights::{SetOptions, Sets};
use crate::output::{Outcome, check_outputs};
use crate::{progress, real_logs, tables};

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

    /// Model file to write, for example: --out model.toml
    #[arg(long, value_name = "TOML")]
    out: PathBuf,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let mut inputs = options.sets.paths();
    inputs.push(&options.vehicle);
    check_outputs([&options.out], &inputs)?;
    let vehicle = Vehicle::read(&options.vehicle)?;
    let mut sets = Sets::read(&options.sets, &vehicle, options.json)?;
    let identified = identify(&vehicle, &mut sets, options.json)?;
    report::write_atomic(&options.out, identified.model.to_toml())?;
    if options.json {
        Outcome::json(&document(&identified, &sets))
    } else {
        Ok(text(options, &identified, &sets))
    }
}

/// A basic model and how well determined it is.
pub(crate) struct Identified {
    /// With its fit record.
    pub(crate) model: Model,
    /// Condition number of the column-scaled problem.
    pub(crate) condition: f64,
}

/// Fits the basic model.
pub(crate) fn identify(vehicle: &Vehicle, sets: &mut Sets, json: bool) -> anyhow::Result<Identified> {
    let spinner = progress::spinner(json);
    spinner.set_message("fitting the basic model");
    let basic: Vec<Effect> = Effect::basic().collect();
    real_logs::align_training(sets, &real_logs::basic_model(vehicle));
    let fit = sysid::fit(&sets.train(), vehicle, &basic, None).map_err(|refused| sets.blame(refused))?;
    let mut model = fit.model;
    real_logs::align_held_out(sets, &model);
    model.fit = Some(sets.record(&model));
    spinner.finish_and_clear();
    for doubt in sysid::impossible_signs(&model) {
        eprintln!("warning: {doubt}");
    }
    Ok(Identified { model, condition: fit.condition })
}

fn text(options: &Options, identified: &Identified, sets: &Sets) -> Outcome {
    let model = &identified.model;
    let record = model.fit.clone().unwrap_or_default();
    let roles = sets.train.iter().map(|f| (f, "train")).chain(sets.validate.iter().map(|f| (f, "validate")));
    Outcome::done(format!(
        "{}\n{}\n{}\ncondition number of the fit: {}\nmodel written to {}\n",
        tables::flights(roles).to_text(),
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
}

#[derive(Serialize)]
struct FlightEntry<'a> {
    name: &'a str,
    sha256: &'a str,
    role: FlightRole,
    samples: usize,
    gyro_bias_rad_s: [f64; 3],
    /// Clock of the rotor samples against that of the state.
    alignment: Option<&'a sysid::Alignment>,
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

fn document<'a>(identified: &'a Identified, sets: &'a Sets) -> Document<'a> {
    let model = &identified.model;
    let record = model.fit.clone().unwrap_or_default();
    let flights = sets
        .all()
        .zip(&record.flights)
        .map(|(flight, entry)| FlightEntry {
            name: &flight.prepared.name,
            sha256: &flight.sha256,
            role: entry.role,
            samples: flight.prepared.rows(),
            gyro_bias_rad_s: flight.prepared.gyro_bias_rad_s,
            alignment: flight.prepared.alignment.as_ref(),
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
    }
}
