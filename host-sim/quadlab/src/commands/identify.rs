//! `quadlab identify`: the basic model fitted to flights and judged on others.

use std::path::PathBuf;

use diagnosis::workflow::{self, FlightSets, Identified, rotation_refused, shown_record};
use model::{AxisError, FlightRole, Group, Model, NotIdentified, PerAxis};
use schemars::JsonSchema;
use serde::Serialize;
use sysid::{MotorsOfFlights, RotorComparison};

use crate::cli::colour;
use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::SetOptions;
use crate::cli::model_files::vehicle_of;
use crate::cli::output::{Outcome, OutputOptions};
use crate::cli::refine::{self, RefineOptions, RefinementEntry};
use crate::cli::terminal::Terminal;
use crate::cli::user_effects::EffectOptions;
use crate::render::documents::{CoefficientEntry, coefficient_entries};
use crate::render::tables;

/// Identify the basic model from flights.
///
/// Fits thrust, drag, rotor moments, inertia coupling, gyroscopic torque and angular damping to the training flights by
/// least squares, tests them on the held-out flights, and writes the model.
#[derive(clap::Args)]
#[command(
    override_usage = "quadlab identify [OPTIONS] --out <TOML> <FLIGHTS>...\n       quadlab identify [OPTIONS] --out <TOML> \
                      --train <FLIGHTS>... --validate <FLIGHTS>...",
    after_help = "Example:\n  quadlab identify --vehicle vehicle.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out model.toml"
)]
pub(crate) struct Options {
    /// Vehicle file, with what was measured before any flight, for example: --vehicle vehicle.toml; without, the vehicle.toml
    /// beside the flights, or what logs tell about the craft
    #[arg(long, value_name = "TOML")]
    vehicle: Option<PathBuf>,

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

    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let files = options.sets.files()?;
    let mut inputs = files.paths();
    inputs.extend(&options.vehicle);
    inputs.extend(options.effects.paths());
    options.output.check([&options.out], &inputs)?;
    let terminal = Terminal::new(options.output.json);
    let (vehicle, _) = vehicle_of(options.vehicle.as_ref(), options.sets.named(), &files.paths(), &terminal)?;
    let effects = options.effects.read()?;
    options.faults.apply(&files.paths(), &vehicle)?;
    let mut sets = files.read(&vehicle, options.faults.reading()?, &terminal)?;
    let identified = workflow::identify(&vehicle, &effects, &mut sets, options.refine.rows(), &terminal)?;
    terminal.clear();
    report::write_atomic(&options.out, identified.model.to_toml())?;
    if options.output.json {
        faults::json(&document(&identified, &sets), sets.all(), &sets.faults)
    } else {
        faults::warn(&sets.faults);
        warn_of_unidentified(&identified.model);
        Ok(text(options, &identified, &sets))
    }
}

/// Warns of what the flights do not determine, but for signs and a refused rotation, which have been told. The document of
/// `--json` has them all.
fn warn_of_unidentified(model: &Model) {
    let signs = sysid::impossible_signs(model);
    let is_told = |unknown: &NotIdentified| {
        let is_refused = unknown.group == Group::Rotation && !sysid::has_rotation(model);
        is_refused || signs.contains(&unknown.reason)
    };
    let unknown = model.fit.as_ref().map_or(&[][..], |fit| &fit.not_identified);
    for NotIdentified { group, reason, fly, .. } in unknown.iter().filter(|unknown| !is_told(unknown)) {
        colour::warn(&format!(
            "the {group} of this model is not identified: {reason}; an effect may be missing (see quadlab diagnose), or these \
             flights do not determine it: {fly}"
        ));
    }
}

/// What may look like unequal rotors in a model that nobody has diagnosed yet.
const MISSING_MOMENT: &str = "A missing effect can look the same: run `quadlab diagnose`.";

fn text(options: &Options, identified: &Identified, sets: &FlightSets) -> Outcome {
    let model = &identified.model;
    let record = shown_record(model);
    let mut more = String::new();
    for grid in [
        tables::trim(sets.training.loaded()),
        tables::motors(model, &identified.motors),
        tables::not_identified(&record.not_identified),
    ] {
        if grid.has_rows() {
            more.push_str(&format!("{}\n", grid.to_text()));
        }
    }
    let refused = (!record.rotation_refused.is_empty())
        .then(|| format!("Note: {}.", rotation_refused(&record.rotation_refused)));
    let rotors = identified.rotors.iter().map(RotorComparison::sentences).find(|unlike| !unlike.is_empty());
    let unlike = rotors.map(|sentences| format!("{} {MISSING_MOMENT}", sentences.join(" ")));
    let refined = identified.refinement.as_ref().map(refine::sentence);
    for sentence in refused.into_iter().chain(unlike).chain(refined) {
        more.push_str(&format!("{}\n", tables::paragraph(&sentence)));
    }
    Outcome::done(format!(
        "{}\n{}\n{}\n{}\n{more}condition number of the fit: {}\nmodel written to {}\n",
        tables::flights(sets).to_text(),
        tables::clocks(sets.all()).to_text(),
        tables::coefficients(model).to_text(),
        tables::fit_errors(&record.train, &record.held_out).to_text(),
        report::significant(identified.condition, 2),
        options.out.display(),
    ))
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    vehicle: &'a str,
    flights: Vec<FlightEntry<'a>>,
    coefficients: Vec<CoefficientEntry>,
    train: PerAxis<AxisError>,
    held_out: PerAxis<AxisError>,
    condition: f64,
    /// Why the model has no rotation, where it has none.
    rotation_refused: Vec<String>,
    /// What of the model the flights do not determine, and why.
    not_identified: Vec<NotIdentified>,
    /// Motor coefficients flight by flight, and whether they follow how the flights were flown.
    motors: &'a [MotorsOfFlights],
    /// The rotors against each other by the coefficients of the model; null where these are inconclusive.
    rotors: Option<&'a RotorComparison>,
    #[serde(skip_serializing_if = "Option::is_none")]
    refinement: Option<RefinementEntry>,
}

#[derive(Serialize, JsonSchema)]
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
    trim: Option<sysid::prepare::Trim>,
    force_target: &'static str,
    notes: &'a [String],
}

fn document<'a>(identified: &'a Identified, sets: &'a FlightSets) -> Document<'a> {
    let model = &identified.model;
    let record = shown_record(model);
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
    Document {
        vehicle: &model.vehicle.name,
        flights,
        coefficients: coefficient_entries(model),
        train: record.train,
        held_out: record.held_out,
        condition: identified.condition,
        rotation_refused: record.rotation_refused,
        not_identified: record.not_identified,
        motors: &identified.motors,
        rotors: identified.rotors.as_ref(),
        refinement: identified.refinement.as_ref().map(RefinementEntry::from),
    }
}
