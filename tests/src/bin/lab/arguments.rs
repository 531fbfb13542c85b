//! What `lab` is asked for.

use std::path::PathBuf;

use clap::Parser;

/// Measure how often diagnoses are right, on flights of simulated worlds that were not made with
/// the product's plant.
///
/// Prints tables, and writes lab.json and index.html.
#[derive(Parser)]
#[command(
    name = "lab",
    version,
    after_help = "Examples:\n  cargo xtask bench lab --quick\n  cargo xtask bench lab --only ground-effect --strength 0.3 --noise 2 --seeds 20 --keep-failures\n  cargo xtask bench lab --only conditions --each 10\n  cargo xtask bench lab --counts 10"
)]
pub(crate) struct Arguments {
    /// One seed, one strength and one noise level: under a minute
    #[arg(long)]
    pub(crate) quick: bool,

    /// Repetitions of every combination
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: Option<u64>,

    /// First seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,

    /// Strengths of the hidden effect; 1 is what a pilot would notice
    #[arg(long, value_name = "S", num_args = 1.., value_parser = positive)]
    pub(crate) strength: Vec<f64>,

    /// Noise of the sensors; 1 is a good motion capture
    #[arg(long, value_name = "S", num_args = 1.., value_parser = positive)]
    pub(crate) noise: Vec<f64>,

    /// Trials of each condition of flights and logs (50; in a quick run 2)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) each: Option<u64>,

    /// N trials of each effect, nine times as many with nothing hidden, and N pairs, at a strength that a pilot would notice and under
    /// usual noise: status 1 where too few are right
    #[arg(long, value_name = "N", conflicts_with_all = ["quick", "seeds", "each"], value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) counts: Option<u64>,

    /// Only trials that hide these (nothing, pairs, triples, beside, changes, or identifiers of effects), or
    /// of these conditions (conditions for all, floor, gaps, log-25-hz, ...)
    #[arg(long, value_name = "WHAT", num_args = 1..)]
    pub(crate) only: Vec<String>,

    /// Length of a flight, s
    #[arg(long, value_name = "S", default_value_t = 24.0, value_parser = flight_length)]
    pub(crate) duration: f64,

    /// Folder for lab.json and index.html
    #[arg(long, value_name = "DIR", default_value = "out/lab")]
    pub(crate) out: PathBuf,

    /// Write the flights of wrong answers, and of coefficients that come out far from the truth, into folders of their own, for
    /// `quadlab explain`
    #[arg(long)]
    pub(crate) keep_failures: bool,

    /// Write what regressions choose from in each trial into folders under this one, for
    /// tests/peers/compare.py
    #[arg(long, value_name = "DIR")]
    pub(crate) libraries: Option<PathBuf>,
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value > 0.0 && value <= 10.0 { Ok(value) } else { Err("must be above 0 and at most 10".into()) }
}

fn flight_length(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (10.0..=600.0).contains(&value) { Ok(value) } else { Err("must be between 10 and 600 s".into()) }
}
