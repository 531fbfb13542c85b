//! `quadlab compare`: a model against flights, and where it fails.

use std::path::{Path, PathBuf};

use diagnosis::workflow::{self, FlightsOfOneKind, LoadedFlight};
use model::Model;
use schemars::JsonSchema;
use serde::Serialize;
use sysid::Comparison;

use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights;
use crate::cli::model_files::read_model;
use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::terminal::Terminal;
use crate::render::{pages, tables, unpredicted};

/// Compare a model with flights: errors of each axis, open-loop prediction, and where it fails most.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab compare --model model.toml --flights D.csv E.csv --html compare.html\n  \
                  quadlab compare --model model.toml better.toml --flights D.csv E.csv"
)]
pub(crate) struct Options {
    /// Model files, several to see them side by side, for example: --model model.toml better.toml
    #[arg(long, value_name = "TOML", num_args = 1.., required = true)]
    model: Vec<PathBuf>,

    /// Flights to compare with: files, folders or patterns, for example: --flights D.csv E.csv
    #[arg(long, value_name = "CSV", num_args = 1.., required = true)]
    flights: Vec<PathBuf>,

    /// Page with figures to write, for example: --html compare.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    faults: FaultOptions,

    #[command(flatten)]
    output: OutputOptions,
}

/// A model against the flights.
struct Compared {
    path: PathBuf,
    model: Model,
    flights: FlightsOfOneKind,
    comparison: Comparison,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let files = flights::files(&options.flights)?;
    let inputs: Vec<&PathBuf> = files.iter().chain(&options.model).collect();
    options.output.check(&options.html, &inputs)?;
    let terminal = Terminal::new(options.output.json);
    let compared: anyhow::Result<Vec<Compared>> =
        options.model.iter().map(|path| compare(options, path, &files, &terminal)).collect();
    terminal.clear();
    match compared?.as_slice() {
        [one] => report_one(options, one),
        several => report_several(options, several),
    }
}

/// Each model sets the flights' clocks for itself.
fn compare(
    options: &Options,
    path: &Path,
    files: &[PathBuf],
    terminal: &Terminal,
) -> anyhow::Result<Compared> {
    let model = read_model(path)?;
    options.faults.apply(&files.iter().collect::<Vec<_>>(), &model.vehicle)?;
    let mut flights = FlightsOfOneKind::read(files, &model.vehicle, options.faults.reading()?, terminal)?;
    let comparison = workflow::compare(&model, &mut flights, terminal)?;
    Ok(Compared { path: path.into(), model, flights, comparison })
}

fn report_one(options: &Options, compared: &Compared) -> anyhow::Result<Outcome> {
    let Compared { path: model_path, model, flights: FlightsOfOneKind { flights, faults }, comparison } =
        compared;
    if let Some(path) = &options.html {
        pages::with_checks(pages::compare(model, flights, comparison), flights, faults)
            .provenance(provenance(&[model_path], flights))
            .write(path)?;
    }
    if options.output.json {
        faults::json(comparison, flights, faults)
    } else {
        faults::warn(faults);
        Ok(Outcome::done(text(options, flights, comparison)))
    }
}

/// Models beside each other; what is said of single flights is that of the first model.
#[derive(Serialize, JsonSchema)]
pub(crate) struct SideBySide<'a> {
    #[serde(flatten)]
    first: &'a Comparison,
    models: Vec<OfModel<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct OfModel<'a> {
    model: String,
    #[serde(flatten)]
    comparison: &'a Comparison,
}

fn report_several(options: &Options, compared: &[Compared]) -> anyhow::Result<Outcome> {
    let first = &compared[0];
    let columns: Vec<(String, &Comparison)> =
        compared.iter().map(|c| (c.path.display().to_string(), &c.comparison)).collect();
    let (flights, faults) = (&first.flights.flights, &first.flights.faults);
    if let Some(path) = &options.html {
        let models: Vec<(&Model, &FlightsOfOneKind)> =
            compared.iter().map(|c| (&c.model, &c.flights)).collect();
        let paths: Vec<&Path> = compared.iter().map(|c| c.path.as_path()).collect();
        pages::with_checks(pages::compare_models(&models, &columns), flights, faults)
            .provenance(provenance(&paths, flights))
            .write(path)?;
    }
    if options.output.json {
        let models = columns.iter().map(|(model, comparison)| OfModel { model: model.clone(), comparison });
        let document = SideBySide { first: &first.comparison, models: models.collect() };
        return faults::json(&document, flights, faults);
    }
    faults::warn(faults);
    let mut text = format!(
        "{}\n{}{}",
        tables::side_by_side(&columns).to_text(),
        tables::horizons_side_by_side(&columns).to_text(),
        unpredicted::footnote(columns.iter().map(|(_, comparison)| *comparison))
    );
    if let Some(path) = &options.html {
        text.push_str(&format!("\npage: {}\n", path.display()));
    }
    Ok(Outcome::done(text))
}

fn text(options: &Options, flights: &[LoadedFlight], comparison: &Comparison) -> String {
    let mut text = format!(
        "{}\n{}{}\n{}",
        tables::comparison(comparison).to_text(),
        tables::horizons(comparison).to_text(),
        unpredicted::footnote([comparison]),
        tables::clocks(flights).to_text()
    );
    let worst = tables::worst(comparison);
    if worst.has_rows() {
        text.push('\n');
        text.push_str(&worst.to_text());
    } else {
        text.push_str("\nNo condition has more than its share of the error.\n");
    }
    for flight in comparison.flights.iter().filter(|f| !f.notes.is_empty()) {
        text.push_str(&format!("\n{}: {}\n", flight.name, flight.notes.join("; ")));
    }
    if let Some(path) = &options.html {
        text.push_str(&format!("\npage: {}\n", path.display()));
    }
    text
}
