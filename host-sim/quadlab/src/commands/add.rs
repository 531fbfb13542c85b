//! `quadlab add`: an effect joins a model, and everything is fitted again.

use std::path::PathBuf;

use diagnosis::Addition;
use model::{Effect, FitRecord, HistoryEntry, Model, PerAxis};
use serde::Serialize;
use sysid::checks::vehicle::Likeness;

use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::{SetOptions, Sets};
use crate::cli::output::{Outcome, check_outputs};
use crate::cli::progress;
use crate::cli::user_effects::EffectOptions;
use crate::real_logs::{self, RefineOptions, RefinementEntry};
use crate::render::tables;

/// Add a physical effect to a model and fit all of it again.
///
/// The error of each axis on the flights held out is shown before and after. An effect that the flights do not support
/// is added all the same, and the answer says so.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab add ground-effect --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out better.toml\n\n`quadlab effects` lists the effects.")]
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

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

/// Why an effect cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AddError {
    #[error("unknown effect \"{effect}\"; known are {known}")]
    Unknown { effect: String, known: String },
    #[error("{}: already has the effect \"{effect}\"; its effects are {there}", model.display())]
    AlreadyThere { model: PathBuf, effect: Effect, there: String },
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let mut inputs = options.sets.paths();
    inputs.extend(options.effects.paths());
    check_outputs([&options.out], &inputs)?;
    options.effects.read()?;
    let model = Model::read(&options.model)?;
    let effect = known_effect(&options.effect)?;
    if model.has(effect) {
        let there = listed(&model.effects());
        return Err(AddError::AlreadyThere { model: options.model.clone(), effect, there }.into());
    }
    let mut sets = Sets::read(&options.sets, &model.vehicle, options.faults.reading(options.json))?;
    sets.leave_out_undefined(&model, &[effect])?;
    sets.faults.of_fitted(&model, &sets.validate);
    sets.faults.of_likeness(&model, sets.all(), Likeness::SAME);
    real_logs::align(&mut sets, &model);
    let (mut better, addition) = add(&model, effect, &mut sets, options.json)?;
    let refinement = real_logs::refine(&mut better, &sets, &options.refine, options.json)?;
    report::write_atomic(&options.out, better.to_toml())?;
    if options.json {
        faults::json(&document(&addition, refinement), sets.all(), &sets.faults)
    } else {
        sets.faults.warn();
        Ok(text(options, &better, &addition, refinement.as_ref()))
    }
}

pub(crate) fn known_effect(id: &str) -> Result<Effect, AddError> {
    Effect::from_id(id).ok_or_else(|| {
        let candidates: Vec<Effect> = Effect::candidates().collect();
        AddError::Unknown { effect: id.into(), known: listed(&candidates) }
    })
}

fn listed(effects: &[Effect]) -> String {
    effects.iter().map(|e| e.id()).collect::<Vec<_>>().join(", ")
}

/// The model with `effect`, its fit record and history brought up to date.
pub(crate) fn add(
    model: &Model,
    effect: Effect,
    sets: &mut Sets,
    json: bool,
) -> anyhow::Result<(Model, Addition)> {
    let spinner = progress::spinner(json);
    spinner.set_message(format!("adding {effect}"));
    let mut with = model.clone();
    with.set(effect, &vec![0.0; effect.info().coefficients.len()]);
    real_logs::trim(sets, &with);
    let addition = diagnosis::add(model, effect, &sets.train(), &sets.validate())
        .map_err(|refused| sets.blame(refused))?;
    let mut better = addition.fit.model.clone();
    let rotation_refused = model.fit.as_ref().map_or_else(Vec::new, |fit| fit.rotation_refused.clone());
    better.fit = Some(FitRecord { rotation_refused, ..sets.record(&better) });
    better.history.clone_from(&model.history);
    better.history.push(HistoryEntry {
        effect: effect.id().into(),
        supported: addition.finding.supported,
        sse_before: addition.before,
        sse_after: addition.after,
    });
    spinner.finish_and_clear();
    Ok((better, addition))
}

fn text(
    options: &Options,
    better: &Model,
    addition: &Addition,
    refinement: Option<&RefinementEntry>,
) -> Outcome {
    let refined = refinement.map_or_else(String::new, |r| format!("\n{}", tables::paragraph(&r.text())));
    let finding = &addition.finding;
    let verdict = if finding.supported { "is supported" } else { "is NOT supported by these flights" };
    let sentence = Effect::from_id(finding.effect).map_or("", |e| e.info().sentence);
    Outcome::done(format!(
        "{}\n{}\n{}{refined}\nmodel written to {}\n",
        tables::paragraph(&format!("{} {verdict}: {}. {sentence}", finding.effect, finding.reason)),
        tables::before_after(
            "Squared error on the held-out flights, everything fitted again without and with the effect",
            &addition.before,
            &addition.after,
        )
        .to_text(),
        tables::coefficients(better).to_text(),
        options.out.display(),
    ))
}

#[derive(Serialize)]
struct Document<'a> {
    effect: &'static str,
    sse_before: PerAxis<f64>,
    sse_after: PerAxis<f64>,
    drop_percent: PerAxis<f64>,
    supported: bool,
    finding: &'a diagnosis::diagnose::EffectFinding,
    #[serde(skip_serializing_if = "Option::is_none")]
    refinement: Option<RefinementEntry>,
}

fn document(addition: &Addition, refinement: Option<RefinementEntry>) -> Document<'_> {
    Document {
        effect: addition.finding.effect,
        sse_before: addition.before,
        sse_after: addition.after,
        drop_percent: addition.before.drop_percent(&addition.after),
        supported: addition.finding.supported,
        finding: &addition.finding,
        refinement,
    }
}
