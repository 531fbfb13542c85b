//! `quadlab plan`: the next flight, chosen by what it would tell.

use std::fmt::Write as _;
use std::path::PathBuf;

use model::{Effect, Model, RotorQuantity};
use report::significant;
use schemars::JsonSchema;
use serde::Serialize;
use sil::next_flight::{Goal, Proposal, check_effect, coefficient, known_error, plan};
use sil::predict::Predictor;

use crate::cli::next_flight::{DURATION_S, SEED, is_enough, predictor};
use crate::cli::output::{Outcome, OutputOptions};
use crate::render::tables;

/// Say what to fly next: the flight that best tells two effects apart or shrinks a standard error.
///
/// The current model flies a library of manoeuvres in simulation; they are ranked by the information
/// that they would give. Exit status 1 if none gives enough.
#[derive(clap::Args)]
#[command(
    group(clap::ArgGroup::new("goal").required(true).args(["separate", "shrink"])),
    after_help = "Examples:\n  quadlab plan --model model.toml --separate steady-wind attitude-offset --out next.csv\n  quadlab plan --model model.toml --shrink C_du --out next.csv\n  quadlab plan --model model.toml --shrink ground-effect.k_ground"
)]
pub(crate) struct Options {
    /// Model file: what is known so far, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Gains file of the controller that will fly it [default: gains designed for the model]
    #[arg(long, value_name = "TOML")]
    gains: Option<PathBuf>,

    /// Two effects to tell apart, for example: --separate steady-wind attitude-offset
    #[arg(long, value_name = "EFFECT", num_args = 2)]
    separate: Option<Vec<String>>,

    /// Coefficient whose standard error to reduce, for example: --shrink C_du, or --shrink linear-drag.C_du
    #[arg(long, value_name = "COEFFICIENT")]
    shrink: Option<String>,

    /// Duration of the flight, s
    #[arg(long, value_name = "S", default_value_t = DURATION_S)]
    duration: f64,

    /// Seed of phases and the tour
    #[arg(long, value_name = "N", default_value_t = SEED)]
    seed: u64,

    /// Pattern file to write, with the best flight, for example: --out next.csv
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Debug, thiserror::Error)]
enum NoPlan {
    #[error("--separate {0}: no such effect; quadlab effects lists them")]
    NoEffect(String),
    #[error("--separate {0} {0}: give two different effects")]
    SameEffect(String),
    #[error("--duration {0}: give 8 to 600 seconds")]
    Duration(f64),
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    goal: String,
    /// What `worth` is.
    measure: &'static str,
    known_std_error: Option<f64>,
    enough: bool,
    why: String,
    pattern: Option<String>,
    flights: Vec<Entry<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct Entry<'a> {
    name: &'static str,
    words: &'static str,
    amplitude: f64,
    worth: Option<f64>,
    trouble: Option<&'a str>,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let inputs: Vec<&PathBuf> = std::iter::once(&options.model).chain(&options.gains).collect();
    options.output.check(&options.out, &inputs)?;
    if !(8.0..=600.0).contains(&options.duration) {
        return Err(NoPlan::Duration(options.duration).into());
    }
    let model = Model::read_to_simulate(&options.model)?;
    let predictor = predictor(&model, &options.model, options.gains.as_deref(), options.seed)?;
    let goal = goal(options, &predictor)?;
    let proposals = plan(&predictor, goal, options.duration, options.seed)?;
    let enough = proposals.first().is_some_and(|best| is_enough(best, goal));
    if let (Some(out), Some(best), true) = (&options.out, proposals.first(), enough) {
        report::write_atomic(out, best.pattern.to_csv())?;
    }
    let known = match goal {
        Goal::Shrink(p) => known_error(predictor.model(), p),
        Goal::Separate(..) => None,
    };
    let document = Document {
        goal: words(goal),
        measure: match goal {
            Goal::Separate(..) => "standard errors between the two",
            Goal::Shrink(_) => "standard error after the flight",
        },
        known_std_error: known,
        enough,
        why: why(&proposals, goal, known, predictor.model().rotor_quantity()),
        pattern: options.out.as_ref().filter(|_| enough).map(|p| p.display().to_string()),
        flights: proposals.iter().map(entry).collect(),
    };
    let unit = &predictor.model().vehicle.motors.command_unit;
    let outcome = if options.output.json {
        Outcome::json(&document)?
    } else {
        Outcome::done(described(&document, unit))
    };
    Ok(Outcome { holds: enough, ..outcome })
}

fn goal(options: &Options, predictor: &Predictor) -> anyhow::Result<Goal> {
    if let Some(name) = &options.shrink {
        return Ok(Goal::Shrink(coefficient(predictor, name)?));
    }
    let named = options.separate.as_deref().unwrap_or(&[]);
    let effects: Vec<Effect> = named
        .iter()
        .map(|id| Effect::from_id(id).ok_or_else(|| NoPlan::NoEffect(id.clone())))
        .collect::<Result<_, _>>()?;
    for effect in &effects {
        check_effect(predictor, *effect)?;
    }
    match effects.as_slice() {
        [a, b] if a != b => Ok(Goal::Separate(*a, *b)),
        _ => Err(NoPlan::SameEffect(named.first().cloned().unwrap_or_default()).into()),
    }
}

fn words(goal: Goal) -> String {
    match goal {
        Goal::Separate(a, b) => format!("tell {a} from {b}"),
        Goal::Shrink(p) => format!("know {} of {} better", p.info().name, p.effect),
    }
}

/// Why the best flight is the best, in plain words.
fn why(proposals: &[Proposal], goal: Goal, known: Option<f64>, rotors: RotorQuantity) -> String {
    let Some(best) = proposals.first() else { return "No flight was found.".into() };
    let hovers = proposals.iter().filter(|p| p.name == "hover");
    let usual = hovers.min_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
    let number = |p: Option<&Proposal>| p.and_then(|p| p.worth);
    match goal {
        Goal::Separate(a, b) => {
            let text = |v: Option<f64>| v.map_or_else(|| "no".to_owned(), |v| format!("{v:.1}"));
            let reason = |a: Effect, b: Effect| a.info().confused_with.iter().find(|(id, _)| *id == b.id());
            let physics = reason(a, b)
                .or_else(|| reason(b, a))
                .map(|(_, words)| format!(" The catalogue says: {words}."));
            format!(
                "If the craft has {a} or {b} of typical size and both are fitted, the one that is there stands out by {} standard errors (in plain hover by {}).{}",
                text(best.worth),
                text(number(usual)),
                physics.unwrap_or_default()
            )
        }
        Goal::Shrink(p) => {
            let error =
                |v: Option<f64>| v.map_or_else(|| "not known at all".to_owned(), |v| significant(v, 2));
            let unit = match p.info().unit_for(rotors) {
                "1" => String::new(),
                unit => format!(" {unit}"),
            };
            format!(
                "After it the standard error of {} is {}{unit} (now: {}; after plain hover: {}). To see {}: {}.",
                p.info().name,
                error(best.worth),
                error(known),
                error(number(usual)),
                p.effect,
                p.effect.info().excitation
            )
        }
    }
}

fn entry(proposal: &Proposal) -> Entry<'_> {
    Entry {
        name: proposal.name,
        words: proposal.words,
        amplitude: proposal.amplitude,
        worth: proposal.worth,
        trouble: proposal.course.trouble.as_deref(),
    }
}

fn described(document: &Document<'_>, unit: &str) -> String {
    let mut text = String::new();
    if let Some(best) = document.flights.first() {
        let fly = match document.enough {
            true => format!(
                "To {}: {}, with multisines of {} {unit} on the motors. {}",
                document.goal,
                best.words,
                significant(best.amplitude, 3),
                document.why
            ),
            false => format!(
                "None of these flights suffices to {}. The best is {}. {} Fly longer, or repeat it.",
                document.goal, best.name, document.why
            ),
        };
        text.push_str(&tables::paragraph(&fly));
    }
    let _ = writeln!(text, "\n{:<18}{:>10}  {:>12}   ({})", "flight", "multisine", "worth", document.measure);
    for flight in &document.flights {
        let worth = flight.worth.map_or_else(|| "nothing".into(), |w| significant(w, 3));
        let trouble = flight.trouble.map_or_else(String::new, |t| format!("   not flown: {t}"));
        let _ = writeln!(
            text,
            "{:<18}{:>10}  {worth:>12}{trouble}",
            flight.name,
            format!("{} {unit}", significant(flight.amplitude, 3))
        );
    }
    text.push_str("(Listed first: the gentlest of the flights that are about as good as the best.)\n");
    if let Some(path) = &document.pattern {
        let _ = writeln!(text, "\npattern file: {path}");
    }
    text
}
