//! `quadlab explain`: the whole loop by itself, from flights to a model in which nothing supported is missing.

use std::path::PathBuf;

use diagnosis::workflow::{self, Explanation};
use diagnosis::{Discovery, StandIn, Unexplained, Verdict};
use model::{Effect, NotIdentified, PerAxis, PerGroup};
use report::Page;
use schemars::JsonSchema;
use serde::Serialize;
use sysid::RotorComparison;

use crate::cli::colour;
use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::SetOptions;
use crate::cli::model_files::vehicle_of;
use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::refine::{self, RefineOptions, RefinementEntry};
use crate::cli::terminal::Terminal;
use crate::cli::user_effects::EffectOptions;
use crate::commands::diagnose::WithoutOptions;
use crate::render::{discovery, discovery_page, pages, stand_ins, tables, unpredicted};

/// Identify the basic model, then add effects until the flights support no further one.
///
/// An effect is added only if the held-out flights support it. The error after every step is kept in the model's
/// history. Exit status 1 if the flights do not determine the model; it then says what to fly.
#[derive(clap::Args)]
#[command(
    override_usage = "quadlab explain [OPTIONS] --out <TOML> <FLIGHTS>...\n       quadlab explain [OPTIONS] --out <TOML> \
                      --train <FLIGHTS>... --validate <FLIGHTS>...",
    after_help = "Example:\n  quadlab explain --vehicle vehicle.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out model.toml --html report.html"
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
    without: WithoutOptions,

    #[command(flatten)]
    refine: RefineOptions,

    /// Search the residual of the final model for a formula, as `quadlab discover` does
    #[arg(long)]
    discover: bool,

    /// Model file to write, for example: --out model.toml
    #[arg(long, value_name = "TOML")]
    out: PathBuf,

    /// Page with figures to write, for example: --html report.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

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
    options.output.check([&options.out].into_iter().chain(&options.html), &inputs)?;
    let terminal = Terminal::new(options.output.json);
    let (vehicle, vehicle_file) =
        vehicle_of(options.vehicle.as_ref(), options.sets.named(), &files.paths(), &terminal)?;
    let effects = options.effects.read()?;
    let search = options.without.options()?;
    options.faults.apply(&files.paths(), &vehicle)?;
    if options.discover {
        workflow::prepare_to_discover();
    }
    let mut sets = files.read(&vehicle, options.faults.reading()?, &terminal)?;
    if options.discover {
        workflow::can_discover(&sets)?;
    }
    let explanation =
        workflow::explain(&vehicle, &effects, &mut sets, &search, options.refine.rows(), &terminal)?;
    let discovery = options
        .discover
        .then(|| workflow::discover_after(&explanation, &sets, &search, &terminal))
        .transpose()?;
    terminal.clear();
    report::write_atomic(&options.out, explanation.model.to_toml())?;
    if let Some(path) = &options.html {
        let page = pages::explanation(&explanation.conclusion(), &sets, &explanation);
        let discovered = discovery.iter().flat_map(|found| discovery_page::sections(&sets, found));
        let page = discovered.fold(page, Page::section);
        pages::with_checks(page, sets.all(), &sets.faults)
            .provenance(provenance(
                &vehicle_file.iter().map(PathBuf::as_path).collect::<Vec<_>>(),
                sets.all(),
            ))
            .write(path)?;
    }
    let outcome = if options.output.json {
        faults::json(&document(&explanation, discovery.as_ref()), sets.all(), &sets.faults)?
    } else {
        faults::warn(&sets.faults);
        let found =
            discovery.as_ref().map_or_else(String::new, |found| format!("\n{}", discovery::answer(found)));
        Outcome::done(text(options, &explanation) + &found)
    };
    Ok(Outcome { holds: explanation.verdict() != Verdict::NotIdentified, ..outcome })
}

fn text(options: &Options, explanation: &Explanation) -> String {
    let mut text = format!(
        "{}\n{}",
        colour::lead(&tables::paragraph(&explanation.conclusion())),
        tables::falling_error(explanation).to_text()
    );
    let steps = explanation.steps.iter().map(|step| &step.comparison);
    text.push_str(&unpredicted::of_position(std::iter::once(&explanation.basic_comparison).chain(steps)));
    text.push_str(&format!("\n{}", tables::coefficients(&explanation.model).to_text()));
    let last = &explanation.last_diagnosis;
    let grids = [
        tables::unexplained(&last.unexplained),
        stand_ins::table(&last.stand_ins()),
        tables::not_identified(&last.not_identified),
    ];
    for grid in grids {
        if grid.has_rows() {
            text.push_str(&format!("\n{}", grid.to_text()));
        }
    }
    if let Some(outcome) = &explanation.refinement {
        text.push_str(&format!("\n{}", tables::paragraph(&refine::sentence(outcome))));
    }
    text.push_str(&format!("\nmodel written to {}\n", options.out.display()));
    if let Some(path) = &options.html {
        text.push_str(&format!("page: {}\n", path.display()));
    }
    text
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    /// Of the whole loop: `adequate` when nothing was missing, `missing-effect` when what was missing has been added and nothing
    /// is left, `unexplained` when something is left at the end, `not-identified` when the flights do not determine the model at
    /// the end and nothing was found.
    verdict: Verdict,
    /// That of the translation and that of the rotation.
    verdicts: PerGroup<Verdict>,
    /// Of the model before anything was added.
    verdict_first: Verdict,
    summary: String,
    added: Vec<Added>,
    sse_first: PerAxis<f64>,
    sse_last: PerAxis<f64>,
    unexplained: &'a [Unexplained],
    /// Effects that were not added although the error of an axis falls much with them: what they leave speaks of something unknown, beside
    /// which they may be there or for which they may stand.
    stand_ins: Vec<StandIn>,
    /// What the flights do not determine at the end, and why.
    not_identified: &'a [NotIdentified],
    /// The rotors against each other by the coefficients of the last model; null where these are inconclusive.
    rotors: Option<&'a RotorComparison>,
    #[serde(skip_serializing_if = "Option::is_none")]
    refinement: Option<RefinementEntry>,
    /// The form of what is left, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    discovery: Option<discovery::Document<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct Added {
    effect: Effect,
    drop_percent: f64,
    /// Held-out errors with it and those before it.
    sse: PerAxis<f64>,
}

fn document<'a>(explanation: &'a Explanation, discovery: Option<&'a Discovery>) -> Document<'a> {
    let sse = |c: &sysid::Comparison| PerAxis::from_fn(|a| c.total[a].sse);
    Document {
        verdict: explanation.verdict(),
        verdicts: explanation.verdicts(),
        verdict_first: explanation.first_diagnosis().verdict,
        summary: explanation.conclusion(),
        added: explanation
            .steps
            .iter()
            .map(|step| Added {
                effect: step.addition.finding.effect,
                drop_percent: step.addition.finding.drop_percent,
                sse: step.addition.after,
            })
            .collect(),
        sse_first: sse(&explanation.basic_comparison),
        sse_last: sse(explanation.last_comparison()),
        unexplained: &explanation.last_diagnosis.unexplained,
        stand_ins: explanation.last_diagnosis.stand_ins(),
        not_identified: &explanation.last_diagnosis.not_identified,
        rotors: explanation.rotors.as_ref(),
        refinement: explanation.refinement.as_ref().map(RefinementEntry::from),
        discovery: discovery.map(discovery::document),
    }
}
