//! `quadlab discover`: when no known effect fits, what does the unknown one look like?

use std::path::PathBuf;

use diagnosis::workflow;
use diagnosis::{Discovery, DiscoveryVerdict, Proposal, Unexplained};
use model::Effect;
use report::number::{p_equation, percent};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::colour;
use crate::cli::effect_names::listed;
use crate::cli::faults::{self, FaultOptions};
use crate::cli::flights::SetOptions;
use crate::cli::model_files::{read_model, vehicle_of};
use crate::cli::output::{Outcome, OutputOptions};
use crate::cli::terminal::Terminal;
use crate::cli::user_effects::EffectOptions;
use crate::commands::diagnose::WithoutOptions;
use crate::render::tables;

/// Find a formula for an effect that is not in the catalogue.
///
/// Known effects come first: those that the model lacks are added. The residual is then searched for a force or a moment that
/// depends on measured quantities, on place or on time. The form is chosen on the training flights and tested on the held-out
/// ones. With --out it is written as an effect of your own, which `quadlab add --effects` takes. Where nothing is left, nothing is
/// proposed; where no formula predicts the residual of other flights (turbulence), the answer is `not-a-formula`.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab discover --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out effects.toml\n  \
                        quadlab add discovered-1 --effects effects.toml --model model.toml --train A.csv B.csv C.csv \
                        --validate D.csv E.csv --out better.toml")]
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
    options.output.check(&options.out, &inputs)?;
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
        let explanation = workflow::explain(&vehicle, &effects, &mut sets, &search, None, &terminal)?;
        (workflow::discover_after(&explanation, &sets, &search, &terminal)?, sets)
    };
    terminal.clear();
    if let (Some(path), false) = (&options.out, discovery.proposals.is_empty()) {
        report::write_atomic(path, workflow::effects_file(&discovery.proposals))?;
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
    text
}

/// The conclusion, and each proposal.
pub(crate) fn answer(discovery: &Discovery) -> String {
    let mut text = colour::lead(&tables::paragraph(&conclusion(discovery)));
    for proposal in &discovery.proposals {
        text.push('\n');
        text.push_str(&proposal_text(proposal));
    }
    text
}

/// What the search ends with, in a paragraph.
fn conclusion(discovery: &Discovery) -> String {
    let known = match &discovery.known[..] {
        [] => "Known effects added first: none.".to_owned(),
        known => format!("Known effects added first: {}.", listed(known)),
    };
    let chance = p_equation(discovery.search_p_value);
    let answer = match (discovery.verdict, discovery.proposals.first()) {
        (_, Some(best)) => format!(
            "Proposed: {} It explains {} of the held-out residual beyond noise ({}).",
            best.sentence,
            share(best.share_of_structure_percent),
            p_equation(best.p_value)
        ),
        (DiscoveryVerdict::Nothing, None) => format!(
            "Nothing is proposed: the residual is noise, and the best form is no better than chance ({chance}; the limit is 0.01)."
        ),
        (_, None) => {
            let best = discovery.refused.as_ref();
            let best = best.map_or_else(String::new, |why| format!(" The best form was refused: {why}."));
            format!(
                "Nothing is proposed: something is left, but no formula predicts it on other flights (not-a-formula). Turbulence, lost \
                 data or someone touching the craft leave such residuals.{best} Next: repeat a pattern in still air, with at least \
                 three flights to fit on and two to judge by."
            )
        }
    };
    format!("{answer} {known}")
}

/// A share that is as good as all is not told to the last digit.
fn share(percent_of_all: f64) -> String {
    if percent_of_all > 99.0 { "over 99 %".into() } else { format!("{} %", percent(percent_of_all)) }
}

fn proposal_text(proposal: &Proposal) -> String {
    let mut lines = vec![format!("{}: {}", proposal.id, proposal.formula)];
    for c in &proposal.coefficients {
        lines.push(format!("  {} = {}", c.name, report::number::with_error(c.value, c.std_error, c.unit)));
    }
    let drops: Vec<String> =
        proposal.drop_percent.iter().map(|(axis, drop)| format!("{axis} {} %", percent(*drop))).collect();
    lines.push(format!(
        "  Held-out squared error, noise included, falls: {}; on {} of {} flights.",
        drops.join(", "),
        proposal.flights_improved[0],
        proposal.flights_improved[1]
    ));
    lines.push(format!(
        "  Leave-one-out: improves {} of {} training flights.",
        proposal.splits[0], proposal.splits[1]
    ));
    lines.extend(proposal.physics.map(|physics| format!("  Consistent with: {physics}.")));
    lines.push(match &proposal.rivals[..] {
        [] => "  No form in other quantities explains these flights about as well.".into(),
        rivals => format!("  These flights cannot distinguish it from: {}.", rivals.join("; ")),
    });
    lines.push(format!("  To confirm: {}.", proposal.excite));
    lines.join("\n") + "\n"
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    proposals: &'a [Proposal],
    verdict: DiscoveryVerdict,
    known: &'a [Effect],
    unexplained: &'a [Unexplained],
    search_p_value: f64,
}

pub(crate) fn document(discovery: &Discovery) -> Document<'_> {
    Document {
        proposals: &discovery.proposals,
        verdict: discovery.verdict,
        known: &discovery.known,
        unexplained: &discovery.left,
        search_p_value: discovery.search_p_value,
    }
}
