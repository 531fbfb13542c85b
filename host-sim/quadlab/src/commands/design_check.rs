//! `quadlab design check`: gains on a model, loop by loop.

use std::path::PathBuf;

use design::check::{CheckOptions, check};
use design::loops::View;
use model::Model;

use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::render::design_pages;
use crate::render::design_tables::text;

/// Oldest pose that makes sense: a second at 100 Hz.
const MOST_DELAY: usize = 100;

/// Check gains on a model: margins, poles, responses, worst cases. Exit status 1 if a loop is
/// unstable, also at another battery voltage or in one of the random draws of the model.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab design check --model model.toml --gains gains.toml --delay 2\n  quadlab design check --model model.toml --gains gains.toml --continuous --html check.html"
)]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Gains file, for example: --gains gains.toml
    #[arg(long, value_name = "TOML")]
    gains: PathBuf,

    /// Age of the pose that the law receives, in samples (thesis 5.5: about 2)
    #[arg(long, value_name = "SAMPLES", default_value_t = 2, conflicts_with = "continuous")]
    delay: usize,

    /// Check the continuous loops that the thesis designs, without sampling and delay
    #[arg(long)]
    continuous: bool,

    /// Number of random draws of the model's coefficients within their standard errors
    #[arg(long, value_name = "COUNT", default_value_t = 100)]
    samples: usize,

    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Page with figures to write, for example: --html check.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

/// A number beyond what any craft could be flown or checked with.
#[derive(Debug, thiserror::Error)]
#[error("--{option} {value}: give a number from 0 to {most}")]
struct TooMany {
    option: &'static str,
    value: usize,
    most: usize,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let refuse =
        |option, value, most| if value > most { Err(TooMany { option, value, most }) } else { Ok(()) };
    refuse("delay", options.delay, MOST_DELAY)?;
    refuse("samples", options.samples, 100_000)?;
    options.output.check(&options.html, &[&options.model, &options.gains])?;
    let model = Model::read_to_linearize(&options.model)?;
    let gains = design::gains_match::read_for(&options.gains, &model)?;
    let view = match options.continuous {
        true => View::Continuous,
        false => View::Sampled { delay_samples: options.delay },
    };
    let settings = CheckOptions { view, samples: options.samples, seed: options.seed };
    let report = check(&model, &gains.config, &settings)?;
    if let Some(path) = &options.html {
        design_pages::check(&model, &gains.config, view, &report)?
            .provenance(provenance(&[&options.model, &options.gains], []))
            .write(path)?;
    }
    let outcome = if options.output.json {
        Outcome::json(&report)?
    } else {
        let page =
            options.html.as_ref().map_or_else(String::new, |path| format!("\npage: {}\n", path.display()));
        Outcome::done(text(&report) + &page)
    };
    Ok(Outcome { holds: report.holds, ..outcome })
}
