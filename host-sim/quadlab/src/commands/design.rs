//! `quadlab design`: gains from a model and specifications.

use std::fmt::Write as _;
use std::path::PathBuf;

use campaign::NamedText;
use clap::Subcommand;
use design::check::{CheckOptions, CheckReport, check};
use design::synthesis::{Designed, Method, Shortfall, Specs, Step, design};
use design::{Criterion, DesignError, Gains, Provenance};
use model::{Model, NotIdentified};
use report::significant;
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::output::{Outcome, OutputOptions};
use crate::commands::design_losses::{LossOptions, Losses};
use crate::commands::{design_check, design_report};
use diagnosis::workflow::sha256;

/// Design gains for a model, step by step; or check gains. Exit status 1 if a specification cannot
/// be met.
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  quadlab design --model model.toml --out gains.toml\n  quadlab design --model model.toml --specs specs.toml --out gains.toml\n  quadlab design check --model model.toml --gains gains.toml\n  quadlab design report --out report.html\n\nA specifications file (every field may be left out; these are defaults):\n  method = \"delay\"          # or \"thesis\": chapter 5 step by step, without delay\n  delay_samples = 2\n  stable_delay_samples = 4\n  [attitude]\n  phase_margin_deg = 45.0\n  gain_margin = 2.0"
)]
pub(crate) struct Options {
    #[command(subcommand)]
    command: Option<Command>,

    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML", required = true)]
    model: Option<PathBuf>,

    /// Specifications, for example: --specs specs.toml
    #[arg(long, value_name = "TOML")]
    specs: Option<PathBuf>,

    /// Gains file to write, for example: --out gains.toml
    #[arg(long, value_name = "TOML", required = true)]
    out: Option<PathBuf>,

    #[command(flatten)]
    losses: LossOptions,

    /// Design for a model although its flights do not determine it; the gains are as wrong as the model
    #[arg(long)]
    accept_unidentified: bool,

    #[command(flatten)]
    output: OutputOptions,
}

/// A model that no gains should be designed for.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: the {} of this model is not identified: {}; to determine it: {} (or --accept-unidentified to design all the same)",
    path.display(), unknown.group, unknown.reason, unknown.fly
)]
struct Unidentified {
    path: PathBuf,
    unknown: NotIdentified,
}

#[derive(Subcommand)]
enum Command {
    Check(design_check::Options),
    Report(design_report::Options),
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    method: Method,
    steps: &'a [Step],
    shortfalls: &'a [Shortfall],
    loops: &'a [design::check::LoopReport],
    /// How often the craft was lost with these gains, in any scenario and in each; absent where that was not asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    losses: Option<&'a [campaign::Rate]>,
    gains: Option<String>,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    match (&options.command, &options.model, &options.out) {
        (Some(Command::Check(options)), ..) => design_check::run(options),
        (Some(Command::Report(options)), ..) => design_report::run(options),
        (None, Some(model), Some(out)) => make(options, model, out),
        // The parser has asked for both.
        (None, ..) => Ok(Outcome::done(String::new())),
    }
}

fn make(options: &Options, path: &PathBuf, out: &PathBuf) -> anyhow::Result<Outcome> {
    let inputs: Vec<&PathBuf> =
        std::iter::once(path).chain(&options.specs).chain(&options.losses.campaign).collect();
    options.output.check([out], &inputs)?;
    let asked = options.losses.asked()?;
    let model = Model::read_to_linearize(path)?;
    // Loops of attitude and yaw stand on the rotation, those of height and position on the translation: both are needed.
    if let Some(unknown) =
        diagnosis::recorded(&model).into_iter().next().filter(|_| !options.accept_unidentified)
    {
        return Err(Unidentified { path: path.clone(), unknown }.into());
    }
    let specs = specifications(options)?;
    let designed = match design(&model, &specs) {
        Err(DesignError::Unmet(shortfall)) => return unmet(options, specs.method, &shortfall),
        designed => designed?,
    };
    let report = check(&model, &designed.config, &CheckOptions { view: specs.view(), samples: 0, seed: 0 })?;
    let mut losses = None;
    let mut holds = designed.shortfalls.is_empty();
    if holds {
        let file = std::fs::read_to_string(path)?;
        let provenance = Provenance {
            vehicle: model.vehicle.name.clone(),
            vehicle_sha256: Some(model.vehicle.sha256()),
            source: format!("quadlab {} design", env!("CARGO_PKG_VERSION")),
            model_sha256: Some(sha256(file.as_bytes())),
            specs: Some(toml::Table::try_from(specs)?),
            margins: Some(margins(&report)),
        };
        let gains = Gains { config: designed.config, provenance: Some(provenance) }.to_toml();
        let file = NamedText { name: path.display().to_string(), text: Some(file) };
        losses = asked.map(|asked| asked.fly(file, &gains, options.output.json)).transpose()?;
        holds = losses.as_ref().is_none_or(Losses::hold);
        if holds {
            report::write_atomic(out, gains)?;
        }
    }
    let written = holds.then(|| out.display().to_string());
    let outcome = if options.output.json {
        Outcome::json(&Document {
            method: specs.method,
            steps: &designed.steps,
            shortfalls: &designed.shortfalls,
            loops: &report.loops,
            losses: losses.as_ref().map(|losses| &losses.rates[..]),
            gains: written,
        })?
    } else {
        let told = losses.as_ref().map(Losses::text).unwrap_or_default();
        Outcome::done(text(&designed, &report, &told, written.as_deref()))
    };
    Ok(Outcome { holds, ..outcome })
}

/// What the file of specifications says; the defaults without one.
fn specifications(options: &Options) -> anyhow::Result<Specs> {
    let Some(path) = &options.specs else { return Ok(Specs::default()) };
    let text = std::fs::read_to_string(path)
        .map_err(|source| design::DesignError::Read { path: path.clone(), source })?;
    Ok(Specs::parse(&text, path)?)
}

/// The outcome of a design that stopped at a specification that no gain meets.
fn unmet(options: &Options, method: Method, shortfall: &Shortfall) -> anyhow::Result<Outcome> {
    let shortfalls = std::slice::from_ref(shortfall);
    let outcome = match options.output.json {
        true => Outcome::json(&Document {
            method,
            steps: &[],
            shortfalls,
            loops: &[],
            losses: None,
            gains: None,
        })?,
        false => Outcome::done(not_met(shortfalls)),
    };
    Ok(Outcome { holds: false, ..outcome })
}

/// One line for each specification that is not met, and what to do.
fn not_met(shortfalls: &[Shortfall]) -> String {
    let mut text = String::new();
    for s in shortfalls {
        if s.what == Criterion::StabilisingGain {
            let least = significant(s.wanted, 1);
            let _ = writeln!(
                text,
                "NOT MET: {}: no proportional gain of at least {least} stabilises this loop",
                s.name
            );
            continue;
        }
        // Digits enough to tell the two apart.
        let both = |digits| (significant(s.wanted, digits), significant(s.reached, digits));
        let (wanted, reached) =
            (3..9).map(both).find(|(wanted, reached)| wanted != reached).unwrap_or_else(|| both(9));
        let key = s.key.map_or_else(String::new, |key| format!(" ({key})"));
        let _ = writeln!(
            text,
            "NOT MET: {}: {}: wanted {wanted}, reached {reached}{key}",
            s.name,
            s.what.label()
        );
    }
    text.push_str(
        "no gains written: relax these specifications in a file for --specs, or reduce the delay\n",
    );
    text
}

/// Margins of each loop for the file.
fn margins(report: &CheckReport) -> toml::Table {
    let row = |l: &design::check::LoopReport| {
        let numbers = [
            ("phase_margin_deg", l.phase_margin_deg),
            ("gain_margin", l.gain_margin),
            ("crossover_rad_s", l.crossover_rad_s),
            ("delay_margin_s", l.delay_margin_s),
        ];
        let table: toml::Table =
            numbers.into_iter().filter_map(|(k, v)| Some((k.to_owned(), toml::Value::Float(v?)))).collect();
        (l.name.to_owned(), toml::Value::Table(table))
    };
    report.loops.iter().map(row).collect()
}

fn text(designed: &Designed, report: &CheckReport, losses: &str, written: Option<&str>) -> String {
    let mut text = String::new();
    for step in &designed.steps {
        let _ = writeln!(
            text,
            "{:<6}{:<18}{:>9}  {}",
            step.name,
            step.gain,
            significant(step.value, 4),
            step.rule
        );
    }
    text.push('\n');
    for l in &report.loops {
        let number = |value: Option<f64>| value.map_or_else(|| "-".into(), |x| significant(x, 3));
        let _ = writeln!(
            text,
            "{:<6}phase margin {} deg at {} rad/s, gain margin {}, delay margin {} ms",
            l.name,
            number(l.phase_margin_deg),
            number(l.crossover_rad_s),
            number(l.gain_margin),
            number(l.delay_margin_s.map(|s| 1000.0 * s))
        );
    }
    if !losses.is_empty() {
        let _ = write!(text, "\n{losses}");
    }
    match written {
        Some(path) => {
            let _ = writeln!(text, "\ngains: {path}");
        }
        None if !designed.shortfalls.is_empty() => {
            text.push('\n');
            text.push_str(&not_met(&designed.shortfalls));
        }
        None => {}
    }
    text
}
