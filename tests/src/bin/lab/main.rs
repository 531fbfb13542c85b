//! `lab`: how often does the laboratory name the right effect?
//!
//! Worlds that share no equation with the product's plant ([`stories::world`]) hide an effect, two,
//! one that no catalogue has, or nothing. The product identifies and diagnoses from the flights
//! alone; here its answers are counted. Results depend on the seed and on nothing else: not on the
//! clock, not on the number of threads.
#![forbid(unsafe_code)]

mod arguments;
mod condition;
mod counts;
mod judge;
mod library;
mod plan;
mod score;
mod show;
mod trial;

use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::Context;
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::arguments::Arguments;
use crate::plan::{Plan, Trial};
use crate::score::Scores;
use crate::trial::Outcome;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(holds) => ExitCode::from(u8::from(!holds)),
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Whether what is asked of the counts holds.
fn run(arguments: &Arguments) -> anyhow::Result<bool> {
    let plan = Plan::new(arguments)?;
    std::fs::create_dir_all(&arguments.out).with_context(|| {
        format!("{}: cannot create the folder; give another with --out", arguments.out.display())
    })?;
    let outcomes = all(&plan.trials);
    if arguments.keep_failures {
        keep_failures(arguments, &outcomes)?;
    }
    if let Some(folder) = &arguments.libraries {
        library::write(folder, &outcomes)?;
    }
    let scores = Scores::of(&plan, &outcomes);
    report::write_atomic(arguments.out.join("lab.json"), serde_json::to_string_pretty(&scores)?)?;
    let page = arguments.out.join("index.html");
    show::page(&plan, &scores).write(&page)?;
    let mut text = show::text(&scores);
    let counts = arguments.counts.map_or_else(Vec::new, |_| counts::of(&outcomes));
    counts.iter().for_each(|count| text.push_str(&format!("{count}\n")));
    text.push_str(&format!("\npage: {}\n", page.display()));
    std::io::stdout().write_all(text.as_bytes()).context("cannot write the tables")?;
    Ok(counts.iter().all(counts::Count::holds))
}

/// Runs all trials on all cores; the outcomes are in the order of the plan.
fn all(trials: &[Trial]) -> Vec<Outcome> {
    let terminal = std::io::stderr().is_terminal();
    let bar = if terminal { ProgressBar::new(trials.len() as u64) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} trials, {eta} left")
        .expect("the template in the source is well-formed");
    bar.set_style(style);
    let started = Instant::now();
    let done = AtomicUsize::new(0);
    let tenth = trials.len().div_ceil(10).max(1);
    let outcomes = trials
        .par_iter()
        .map(|trial| {
            let outcome = trial::run(trial);
            bar.inc(1);
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            if !terminal && (count.is_multiple_of(tenth) || count == trials.len()) {
                let seconds = started.elapsed().as_secs_f64();
                let _ = writeln!(std::io::stderr(), "{count} of {} trials, {seconds:.0} s", trials.len());
            }
            outcome
        })
        .collect();
    bar.finish_and_clear();
    outcomes
}

fn keep_failures(arguments: &Arguments, outcomes: &[Outcome]) -> anyhow::Result<()> {
    let is_kept = |outcome: &&Outcome| !outcome.is_right() || score::farthest(outcome).is_some();
    for outcome in outcomes.iter().filter(is_kept) {
        let folder = arguments.out.join("failures").join(outcome.trial.folder_name());
        let Ok((world, flights)) = trial::fly(&outcome.trial) else { continue };
        world
            .write(&folder, &flights.iter().collect::<Vec<_>>())
            .with_context(|| format!("{}: cannot write the flights", folder.display()))?;
    }
    Ok(())
}
