//! `quadlab diagnose`: which physical effect is missing from a model?

use std::path::PathBuf;

use model::Model;
use sysid::Diagnosis;

use crate::flights::{SetOptions, Sets};
use crate::output::{Outcome, check_outputs, provenance};
use crate::{pages, progress, tables};

/// Say which physical effect a model lacks, with the evidence for each.
///
/// Every effect of the catalogue is fitted together with the whole model on the training flights and judged on the
/// flights held out. An effect is supported when the error falls there by more than chance and by enough to matter,
/// with coefficients that are physically possible.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab diagnose --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --html diagnosis.html")]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    #[command(flatten)]
    sets: SetOptions,

    /// Page with figures to write, for example: --html diagnosis.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let mut inputs = options.sets.paths();
    inputs.push(&options.model);
    check_outputs(&options.html, &inputs)?;
    let model = Model::read(&options.model)?;
    let sets = Sets::read(&options.sets, &model.vehicle, options.json)?;
    let diagnosis = diagnose(&model, &sets, options.json)?;
    if let Some(path) = &options.html {
        pages::diagnose(&model, &sets, &diagnosis)
            .provenance(provenance(&[&options.model], sets.all()))
            .write(path)?;
    }
    if options.json { Outcome::json(&diagnosis) } else { Ok(Outcome::done(text(options, &diagnosis))) }
}

/// Diagnoses with progress on standard error.
pub(crate) fn diagnose(model: &Model, sets: &Sets, json: bool) -> anyhow::Result<Diagnosis> {
    let spinner = progress::spinner(json);
    let diagnosis = sysid::diagnose(model, &sets.train(), &sets.validate(), |step| {
        spinner.set_message(format!("trying {step}"));
    });
    spinner.finish_and_clear();
    diagnosis.map_err(|refused| sets.blame(refused))
}

fn text(options: &Options, diagnosis: &Diagnosis) -> String {
    let mut text = tables::paragraph(&diagnosis.summary);
    for grid in [tables::evidence(diagnosis), tables::candidates(diagnosis, true)] {
        if grid.has_rows() {
            text.push_str(&format!("\n{}", grid.to_text()));
        }
    }
    let left = tables::unexplained(&diagnosis.unexplained);
    if left.has_rows() {
        text.push_str(&format!("\n{}", left.to_text()));
    }
    if let Some(path) = &options.html {
        text.push_str(&format!("\npage: {}\n", path.display()));
    }
    text
}
