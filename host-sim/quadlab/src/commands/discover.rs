//! `quadlab discover`: when no known effect fits, what does the unknown one look like?

use std::path::PathBuf;

use diagnosis::Discovery;
use diagnosis::workflow;

use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::SetOptions;
use crate::cli::model_files::{read_model, vehicle_of};
use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::terminal::Terminal;
use crate::cli::user_effects::EffectOptions;
use crate::commands::diagnose::WithoutOptions;
use crate::render::discovery::{answer, conclusion, document};
use crate::render::{discovery_page, pages, tables};

/// Find a formula for an effect that is not in the catalogue.
///
/// Known effects come first: those that the model lacks are added. The residual is then searched for a force or a moment that
/// depends on measured quantities, on place or on time. The form is chosen on the training flights and tested on the held-out
/// ones: it takes two training flights and one held-out flight at least; three and two are better. With --out it is written as an
/// effect of your own, which `quadlab add --effects` takes. Where nothing is left, nothing is proposed; where no formula predicts
/// the residual of other flights (turbulence), the answer is `not-a-formula`.
#[derive(clap::Args)]
#[command(
    override_usage = "quadlab discover [OPTIONS] <FLIGHTS>...\n       quadlab discover [OPTIONS] \
                      --train <FLIGHTS>... --validate <FLIGHTS>...",
    after_help = "Example:\n  quadlab discover --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out effects.toml\n  \
                        quadlab add discovered-1 --effects effects.toml --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out better.toml"
)]
pub(crate) struct Options {
    /// Model file to start from, for example: --model model.toml; without it, the known effects are fitted first, as `explain` does
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,

    /// Vehicle file, where there is no model yet, for example: --vehicle vehicle.toml
    #[arg(long, value_name = "TOML", conflicts_with = "model")]
    vehicle: Option<PathBuf>,

    #[command(flatten)]
    sets: SetOptions,

    #[command(flatten)]
    effects: EffectOptions,

    #[command(flatten)]
    without: WithoutOptions,

    /// File of effects to write, for example: --out effects.toml; nothing is written where nothing is proposed
    #[arg(long, value_name = "TOML")]
    out: Option<PathBuf>,

    /// Page with each form drawn over the residual, for example: --html discovery.html
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
    inputs.extend(options.model.iter().chain(&options.vehicle));
    inputs.extend(options.effects.paths());
    options.output.check(options.out.iter().chain(&options.html), &inputs)?;
    let effects = options.effects.read()?;
    let search = options.without.options()?;
    let terminal = Terminal::new(options.output.json);
    workflow::prepare_to_discover();
    let (discovery, sets) = if let Some(path) = &options.model {
        let model = read_model(path)?;
        options.faults.apply(&files.paths(), &model.vehicle)?;
        let mut sets = files.read(&model.vehicle, options.faults.reading()?, &terminal)?;
        (workflow::discover(&model, &effects, &mut sets, &search, &terminal)?, sets)
    } else {
        let (vehicle, _) =
            vehicle_of(options.vehicle.as_ref(), options.sets.named(), &files.paths(), &terminal)?;
        options.faults.apply(&files.paths(), &vehicle)?;
        let mut sets = files.read(&vehicle, options.faults.reading()?, &terminal)?;
        workflow::can_discover(&sets)?;
        let explanation = workflow::explain(&vehicle, &effects, &mut sets, &search, None, &terminal)?;
        (workflow::discover_after(&explanation, &sets, &search, &terminal)?, sets)
    };
    terminal.clear();
    if let (Some(path), false) = (&options.out, discovery.proposals.is_empty()) {
        report::write_atomic(path, workflow::effects_file(&discovery.proposals))?;
    }
    if let Some(path) = &options.html {
        let page = discovery_page::discovery(&conclusion(&discovery), &sets, &discovery);
        let given = options.model.iter().chain(&options.vehicle).map(PathBuf::as_path);
        pages::with_checks(page, sets.all(), &sets.faults)
            .provenance(provenance(&given.collect::<Vec<_>>(), sets.all()))
            .write(path)?;
    }
    if options.output.json {
        return faults::json(&document(&discovery), sets.all(), &sets.faults);
    }
    faults::warn(&sets.faults);
    Ok(Outcome::done(text(options, &discovery)))
}

fn text(options: &Options, discovery: &Discovery) -> String {
    let mut text = answer(discovery);
    let left = tables::unexplained(&discovery.left);
    if left.has_rows() {
        text.push_str(&format!("\n{}", left.to_text()));
    }
    if let (Some(path), false) = (&options.out, discovery.proposals.is_empty()) {
        text.push_str(&format!("effects written to {}\n", path.display()));
    }
    if let Some(path) = &options.html {
        text.push_str(&format!("page: {}\n", path.display()));
    }
    text
}
