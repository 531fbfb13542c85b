//! `quadlab diagnose`: which physical effect is missing from a model?

use std::path::PathBuf;

use diagnosis::workflow::{self, FlightsOfOneKind};
use diagnosis::{Diagnosis, Verdict};

use crate::cli::colour;
use crate::cli::effect_names::{UnknownEffect, known_effect};
use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::{self, SetOptions};
use crate::cli::model_files::read_model;
use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::terminal::Terminal;
use crate::cli::user_effects::EffectOptions;
use crate::render::grid::Grid;
use crate::render::{evidence, pages, tables};

/// Say which physical effect a model lacks, with the evidence for each.
///
/// Every effect of the catalogue is fitted together with the whole model on the training flights and tested on the
/// held-out flights. An effect is supported when it lowers the error there by more than chance would and by enough to
/// matter, with coefficients that are physically possible. Exit status 1 if the flights do not determine the model; it then
/// says what to fly.
///
/// With --changed, instead of --train and --validate, the model's coefficients stay fixed, and the residual of new
/// flights is explained by one change (a heavier craft, a weak motor, wind, ...). The change must stand out from the
/// scatter between the flights that the model was fitted to.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  quadlab diagnose --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --html diagnosis.html\n  \
                        quadlab diagnose --model model.toml --train A.csv B.csv C.csv --validate D.csv E.csv \
                        --why ground-effect\n  \
                        quadlab diagnose --model model.toml --changed today-1.csv today-2.csv\n  \
                        quadlab diagnose --model model.toml --changed today-1.csv today-2.csv --why mass-change")]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    #[command(flatten)]
    sets: Option<SetOptions>,

    #[command(flatten)]
    effects: EffectOptions,

    /// New flights, to find what has changed since the model was fitted, for example: --changed today-1.csv today-2.csv
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with_all = ["train", "validate"])]
    changed: Vec<PathBuf>,

    /// Show all the evidence for and against one effect, missing or in the model; with --changed, for and against the
    /// changes that it can be. For example: --why ground-effect
    #[arg(long, value_name = "EFFECT", conflicts_with = "html")]
    why: Option<String>,

    #[command(flatten)]
    without: WithoutOptions,

    /// Page with figures to write, for example: --html diagnosis.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    faults: FaultOptions,

    #[command(flatten)]
    output: OutputOptions,
}

/// Effects to leave out of the catalogue.
#[derive(clap::Args)]
pub(crate) struct WithoutOptions {
    /// Ignore these effects, as if the catalogue did not have them, for example: --without tether
    #[arg(long, value_name = "EFFECT", num_args = 1..)]
    without: Vec<String>,
}

impl WithoutOptions {
    /// What to diagnose with.
    pub(crate) fn options(&self) -> Result<diagnosis::Options, UnknownEffect> {
        let without = self.without.iter().map(|id| known_effect(id)).collect::<Result<_, _>>()?;
        Ok(diagnosis::Options { without })
    }
}

/// Why there is nothing to diagnose.
#[derive(Debug, thiserror::Error)]
enum DiagnoseError {
    #[error(
        "no flights given: name --train and --validate (what is missing?) or --changed (what has changed?)"
    )]
    NoFlights,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    match &options.sets {
        _ if !options.changed.is_empty() => run_changed(options),
        Some(sets) => run_missing(options, sets),
        None => Err(DiagnoseError::NoFlights.into()),
    }
}

fn run_missing(options: &Options, sets: &SetOptions) -> anyhow::Result<Outcome> {
    let files = sets.files()?;
    let mut inputs = files.paths();
    inputs.push(&options.model);
    inputs.extend(options.effects.paths());
    options.output.check(&options.html, &inputs)?;
    let effects = options.effects.read()?;
    let model = read_model(&options.model)?;
    let search = options.without.options()?;
    let asked = options.why.as_deref().map(known_effect).transpose()?;
    let terminal = Terminal::new(options.output.json);
    options.faults.apply(&files.paths(), &model.vehicle)?;
    let mut sets = files.read(&model.vehicle, options.faults.reading()?, &terminal)?;
    if let Some(effect) = asked {
        let why = workflow::why(&model, effect, &effects, &mut sets, &search, &terminal)?;
        return if options.output.json {
            Outcome::json(&why)
        } else {
            Ok(Outcome::done(evidence::text(&why)))
        };
    }
    let diagnosis = workflow::diagnose(&model, &effects, &mut sets, &search, &terminal)?;
    terminal.clear();
    if let Some(path) = &options.html {
        pages::with_checks(pages::diagnose(&model, &sets, &diagnosis), sets.all(), &sets.faults)
            .provenance(provenance(&[&options.model], sets.all()))
            .write(path)?;
    }
    let outcome = if options.output.json {
        faults::json(&diagnosis, sets.all(), &sets.faults)?
    } else {
        faults::warn(&sets.faults);
        Outcome::done(text(options, &diagnosis, tables::candidates(&diagnosis, true)))
    };
    Ok(Outcome { holds: diagnosis.verdict != Verdict::NotIdentified, ..outcome })
}

fn run_changed(options: &Options) -> anyhow::Result<Outcome> {
    let files = flights::files(&options.changed)?;
    let inputs: Vec<&PathBuf> = files.iter().chain([&options.model]).chain(options.effects.paths()).collect();
    options.output.check(&options.html, &inputs)?;
    let effects = options.effects.read()?;
    let model = read_model(&options.model)?;
    let search = options.without.options()?;
    let asked = options.why.as_deref().map(known_effect).transpose()?;
    let terminal = Terminal::new(options.output.json);
    options.faults.apply(&files.iter().collect::<Vec<_>>(), &model.vehicle)?;
    let mut changed = FlightsOfOneKind::read(&files, &model.vehicle, options.faults.reading()?, &terminal)?;
    if model.fit.as_ref().is_none_or(|fit| fit.scatter.is_empty()) {
        colour::warn(&format!(
            "{}: does not say how much the craft differed from flight to flight; changes are judged against noise alone",
            options.model.display()
        ));
    }
    let untold = search.untold_changes(&model);
    if !untold.is_empty() {
        let names: Vec<&str> = untold.iter().map(|effect| effect.id()).collect();
        colour::warn(&format!(
            "{}: does not say how much {} differed from flight to flight, so they are not tried; fit the model again with this version",
            options.model.display(),
            names.join(" and ")
        ));
    }
    if let Some(effect) = asked {
        let why = workflow::changed_why(&model, effect, &effects, &mut changed, &search, &terminal)?;
        terminal.clear();
        return if options.output.json {
            Outcome::json(&why)
        } else {
            faults::warn(&changed.faults);
            Ok(Outcome::done(evidence::text_of_change(&why)))
        };
    }
    let diagnosis = workflow::changed(&model, &effects, &mut changed, &search, &terminal)?;
    terminal.clear();
    if let Some(path) = &options.html {
        pages::with_checks(
            pages::changed(&model, &changed.flights, &diagnosis),
            &changed.flights,
            &changed.faults,
        )
        .provenance(provenance(&[&options.model], &changed.flights))
        .write(path)?;
    }
    let outcome = if options.output.json {
        faults::json(&diagnosis, &changed.flights, &changed.faults)?
    } else {
        faults::warn(&changed.faults);
        Outcome::done(text(options, &diagnosis, tables::change(&diagnosis)))
    };
    Ok(Outcome { holds: diagnosis.verdict != Verdict::NotIdentified, ..outcome })
}

fn text(options: &Options, diagnosis: &Diagnosis, coefficients: Grid) -> String {
    let mut text = colour::lead(&tables::paragraph(&diagnosis.summary));
    for grid in [tables::evidence(diagnosis), coefficients] {
        if grid.has_rows() {
            text.push_str(&format!("\n{}", grid.to_text()));
        }
    }
    for grid in
        [tables::unexplained(&diagnosis.unexplained), tables::not_identified(&diagnosis.not_identified)]
    {
        if grid.has_rows() {
            text.push_str(&format!("\n{}", grid.to_text()));
        }
    }
    if let Some(path) = &options.html {
        text.push_str(&format!("\npage: {}\n", path.display()));
    }
    text
}
