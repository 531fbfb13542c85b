//! `quadlab effects`: the catalogue of physical effects.

use std::fmt::Write as _;

use model::{Axis, Effect, Kind};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::output::Outcome;
use crate::cli::user_effects::EffectOptions;
use crate::render::tables;

/// List the physical effects that a model can have.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab effects")]
pub(crate) struct Options {
    #[command(flatten)]
    effects: EffectOptions,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Entry {
    effect: &'static str,
    basic: bool,
    sentence: &'static str,
    axes: &'static [Axis],
    coefficients: Vec<CoefficientEntry>,
    excitation: &'static str,
    confused_with: Vec<ConfusionEntry>,
}

#[derive(Serialize, JsonSchema)]
struct CoefficientEntry {
    name: &'static str,
    unit: &'static str,
    possible: (f64, f64),
}

#[derive(Serialize, JsonSchema)]
struct ConfusionEntry {
    effect: &'static str,
    separated_by: &'static str,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    options.effects.read()?;
    let all: Vec<Effect> = Effect::all().collect();
    if options.json {
        return Outcome::json(&all.iter().map(|e| entry(*e)).collect::<Vec<_>>());
    }
    let (basic, candidates): (Vec<Effect>, Vec<Effect>) =
        all.iter().partition(|e| e.info().kind == Kind::Basic);
    let mut text = String::from("In every model:\n");
    basic.iter().for_each(|effect| describe(*effect, &mut text));
    text.push_str("\nCan be missing from a model (quadlab diagnose, quadlab add):\n");
    candidates.iter().for_each(|effect| describe(*effect, &mut text));
    Ok(Outcome::done(text))
}

fn describe(effect: Effect, text: &mut String) {
    let info = effect.info();
    let axes: Vec<&str> = info.axes.iter().map(|a| a.name()).collect();
    let coefficients: Vec<String> =
        info.coefficients.iter().map(|c| format!("{} [{}]", c.name, c.unit)).collect();
    let _ = writeln!(text, "\n  {}  (acts on {})", info.id, axes.join(" "));
    for (label, value) in [
        ("", info.sentence.to_owned()),
        ("coefficients: ", coefficients.join(", ")),
        ("to see it: ", info.excitation.into()),
    ] {
        for (index, line) in tables::wrap(&format!("{label}{value}"), 94).iter().enumerate() {
            let indent = if index == 0 { 4 } else { 6 };
            let _ = writeln!(text, "{:indent$}{line}", "");
        }
    }
}

fn entry(effect: Effect) -> Entry {
    let info = effect.info();
    let coefficients = info.coefficients.iter().map(|c| CoefficientEntry {
        name: c.name,
        unit: c.unit,
        possible: c.possible,
    });
    let confused =
        info.confused_with.iter().map(|&(effect, separated_by)| ConfusionEntry { effect, separated_by });
    Entry {
        effect: info.id,
        basic: info.kind == Kind::Basic,
        sentence: info.sentence,
        axes: info.axes,
        coefficients: coefficients.collect(),
        excitation: info.excitation,
        confused_with: confused.collect(),
    }
}
