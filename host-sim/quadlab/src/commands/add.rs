//! `quadlab add`: an effect joins a model, and everything is fitted again.

use std::path::PathBuf;

use diagnosis::workflow::{self, Added};
use model::{Effect, PerAxis};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::colour;
use crate::cli::effect_names::{known_effect, listed};
use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::SetOptions;
use crate::cli::model_files::read_model;
use crate::cli::output::{Outcome, OutputOptions};
use crate::cli::refine::{self, RefineOptions, RefinementEntry};
use crate::cli::terminal::Terminal;
use crate::cli::user_effects::EffectOptions;
use crate::render::tables;

/// Add a physical effect to a model and fit the whole model again.
///
/// Prints the error of each axis on the held-out flights before and after. An effect that the flights do not support is
/// added all the same, and the output says so.
#[derive(clap::Args)]
#[command(
    override_usage = "quadlab add [OPTIONS] --model <TOML> --out <TOML> <EFFECT> <FLIGHTS>...\n       quadlab add [OPTIONS] --model <TOML> --out <TOML> <EFFECT> \
                      --train <FLIGHTS>... --validate <FLIGHTS>...",
    after_help = "Example:\n  quadlab add ground-effect --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out better.toml\n\n`quadlab effects` lists the effects."
)]
pub(crate) struct Options {
    /// The effect's identifier, for example: ground-effect
    effect: String,

    /// Model file to start from, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    #[command(flatten)]
    sets: SetOptions,

    #[command(flatten)]
    effects: EffectOptions,

    #[command(flatten)]
    refine: RefineOptions,

    /// Model file to write, for example: --out better.toml
    #[arg(long, value_name = "TOML")]
    out: PathBuf,

    #[command(flatten)]
    faults: FaultOptions,

    #[command(flatten)]
    output: OutputOptions,
}

/// Why an effect cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AddError {
    #[error("{}: already has the effect \"{effect}\"; its effects are {there}", model.display())]
    AlreadyThere { model: PathBuf, effect: Effect, there: String },
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let files = options.sets.files()?;
    let mut inputs = files.paths();
    inputs.extend(options.effects.paths());
    options.output.check([&options.out], &inputs)?;
    options.effects.read()?;
    let model = read_model(&options.model)?;
    let effect = known_effect(&options.effect)?;
    if model.has(effect) {
        let there = listed(&model.effects());
        return Err(AddError::AlreadyThere { model: options.model.clone(), effect, there }.into());
    }
    let terminal = Terminal::new(options.output.json);
    options.faults.apply(&files.paths(), &model.vehicle)?;
    let mut sets = files.read(&model.vehicle, options.faults.reading()?, &terminal)?;
    let added = workflow::add(&model, effect, &mut sets, options.refine.rows(), &terminal)?;
    terminal.clear();
    report::write_atomic(&options.out, added.model.to_toml())?;
    if options.output.json {
        faults::json(&document(&added), sets.all(), &sets.faults)
    } else {
        faults::warn(&sets.faults);
        Ok(text(options, &added))
    }
}

fn text(options: &Options, added: &Added) -> Outcome {
    let refined = added.refinement.as_ref().map(refine::sentence);
    let refined = refined.map_or_else(String::new, |sentence| format!("\n{}", tables::paragraph(&sentence)));
    let addition = &added.addition;
    let finding = &addition.finding;
    let verdict = if finding.supported { "is supported" } else { "is NOT supported by these flights" };
    // What is not supported must not read as if it had been found.
    let sentence = match finding.supported {
        true => finding.sentence(),
        false => format!("({} means: {})", finding.effect, finding.effect.info().sentence),
    };
    let samples = |axis| added.model.fit.as_ref().map_or(0, |fit| fit.held_out[axis].samples);
    let rms = |sse: &PerAxis<f64>| PerAxis::from_fn(|axis| (sse[axis] / samples(axis) as f64).sqrt());
    Outcome::done(format!(
        "{}\n{}\n{}{refined}\nmodel written to {}\n",
        colour::lead(&tables::paragraph(&format!(
            "{} {verdict}: {}. {sentence}",
            finding.effect, finding.reason
        ))),
        tables::before_after(
            "Root mean square error on the held-out flights (u v w in m/s^2, p q r in rad/s^2), everything fitted again \
             without and with the effect",
            &rms(&addition.before),
            &rms(&addition.after),
        )
        .to_text(),
        tables::coefficients(&added.model).to_text(),
        options.out.display(),
    ))
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    effect: Effect,
    sse_before: PerAxis<f64>,
    sse_after: PerAxis<f64>,
    drop_percent: PerAxis<f64>,
    supported: bool,
    finding: &'a diagnosis::EffectFinding,
    #[serde(skip_serializing_if = "Option::is_none")]
    refinement: Option<RefinementEntry>,
}

fn document(added: &Added) -> Document<'_> {
    let addition = &added.addition;
    Document {
        effect: addition.finding.effect,
        sse_before: addition.before,
        sse_after: addition.after,
        drop_percent: addition.before.drop_percent(&addition.after),
        supported: addition.finding.supported,
        finding: &addition.finding,
        refinement: added.refinement.as_ref().map(RefinementEntry::from),
    }
}
