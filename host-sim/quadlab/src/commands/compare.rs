//! `quadlab compare`: a model against flights, and where it fails.

use std::path::PathBuf;

use diagnosis::workflow::{self, FlightsOfOneKind, LoadedFlight};
use model::Model;
use sysid::Comparison;

use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights;
use crate::cli::output::{Outcome, check_outputs, provenance};
use crate::cli::terminal::Terminal;
use crate::render::{pages, tables};

/// Compare a model with flights: errors of each axis, open-loop prediction, and where it fails most.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  quadlab compare --model model.toml --flights D.csv E.csv --html compare.html"
)]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Flights to compare with, for example: --flights D.csv E.csv
    #[arg(long, value_name = "CSV", num_args = 1.., required = true)]
    flights: Vec<PathBuf>,

    /// Page with figures to write, for example: --html compare.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    faults: FaultOptions,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let inputs: Vec<&PathBuf> = options.flights.iter().chain([&options.model]).collect();
    check_outputs(&options.html, &inputs)?;
    let model = Model::read(&options.model)?;
    let terminal = Terminal::new(options.json);
    let mut flights = flights::read(&options.flights, &model.vehicle, options.faults.reading(), &terminal)?;
    let comparison = workflow::compare(&model, &mut flights, &terminal)?;
    terminal.clear();
    let FlightsOfOneKind { flights, faults } = flights;
    if let Some(path) = &options.html {
        pages::with_checks(pages::compare(&model, &flights, &comparison), &flights, &faults)
            .provenance(provenance(&[&options.model], &flights))
            .write(path)?;
    }
    if options.json {
        faults::json(&comparison, &flights, &faults)
    } else {
        faults::warn(&faults);
        Ok(Outcome::done(text(options, &flights, &comparison)))
    }
}

fn text(options: &Options, flights: &[LoadedFlight], comparison: &Comparison) -> String {
    let mut text = format!(
        "{}\n{}\n{}",
        tables::comparison(comparison).to_text(),
        tables::horizons(comparison).to_text(),
        tables::clocks(flights).to_text()
    );
    let worst = tables::worst(comparison);
    if worst.has_rows() {
        text.push('\n');
        text.push_str(&worst.to_text());
    } else {
        text.push_str("\nNo condition holds more than its share of the error.\n");
    }
    for flight in comparison.flights.iter().filter(|f| !f.notes.is_empty()) {
        text.push_str(&format!("\n{}: {}\n", flight.name, flight.notes.join("; ")));
    }
    if let Some(path) = &options.html {
        text.push_str(&format!("\npage: {}\n", path.display()));
    }
    text
}
