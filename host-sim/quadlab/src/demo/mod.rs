//! `quadlab demo`: everything from flights to a better model, and a page that shows it.
//!
//! Without flights of your own, a craft is flown in simulation with one hidden physical effect. The
//! flights go to files, and everything after that sees the files only: the name found at the end is
//! found from them.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use diagnosis::workflow::{self, Explanation, FlightSets, Reading};
use model::{Effect, Vehicle};

use crate::cli::demo_flights::{self, Flown, TRAIN, VALIDATE, create, seed_from_clock};
use crate::cli::faults;
use crate::cli::flights::{SetFiles, flights_in};
use crate::cli::model_files::vehicle_of;
use crate::cli::output::{Outcome, provenance};
use crate::cli::terminal::Terminal;
use crate::render::{pages, tables};

/// Run the whole workflow: identify, compare, diagnose, add, and write a page with figures.
///
/// Without --flights, a simulated craft is flown that has one hidden effect, to be found from its
/// flights alone. Exit status 1 if it is not found.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab demo --seed 7\n  quadlab demo --flights my-flights --out my-report"
)]
pub(crate) struct Options {
    /// Folder with flight files or logs; A, B and C are used for the fit, D and E for validation, and
    /// flights with other names are split as by the other commands, for example: --flights my-flights
    #[arg(long, value_name = "DIR", conflicts_with = "seed")]
    flights: Option<PathBuf>,

    /// Seed of the hidden effect and of the flights, for example: --seed 7 [default: from the
    /// clock]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,

    /// Folder for report.html, model files and simulated flights, for example: --out my-report
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,

    /// Open the flights in the lab, a page in the browser, to find the effect yourself
    #[arg(long)]
    lab: bool,

    /// With --lab: print the page's address and do not open the browser
    #[arg(long, requires = "lab")]
    no_open: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    match &options.flights {
        Some(folder) if options.lab => open_lab(options, folder),
        Some(folder) => on_flights(options, folder),
        None => on_hidden_effect(options),
    }
}

/// Serves the page until it is ended.
#[cfg(feature = "all-commands")]
fn open_lab(options: &Options, folder: &Path) -> anyhow::Result<Outcome> {
    use crate::lab;
    lab::serve(&lab::Options { folder: folder.to_owned(), port: 0, open: !options.no_open })?;
    Ok(Outcome::done(String::new()))
}

#[cfg(not(feature = "all-commands"))]
fn open_lab(_: &Options, folder: &Path) -> anyhow::Result<Outcome> {
    anyhow::bail!("--lab: built without the lab; the flights are in {}", folder.display())
}

fn on_flights(options: &Options, folder: &Path) -> anyhow::Result<Outcome> {
    let named = [folder.to_owned()];
    let files = chosen_flights(flights_in(folder)?);
    let terminal = Terminal::new(false);
    let (vehicle, vehicle_path) = vehicle_of(None, named.iter(), &files.paths(), &terminal)?;
    let mut sets = files.read(&vehicle, Reading::default(), &terminal)?;
    create(&options.out)?;
    let explanation =
        workflow::explain(&vehicle, &[], &mut sets, &diagnosis::Options::default(), None, &terminal)?;
    terminal.clear();
    let lead = format!("Flights {}. {}", sets.split_sentence(), explanation.conclusion());
    let text = finish(options, &lead, vehicle_path.as_deref(), &sets, &explanation)?;
    faults::warn(&sets.faults);
    Ok(Outcome::done(text))
}

/// Flights that are named as those of a demonstration are used as these are; all others are to be split.
fn chosen_flights(files: Vec<PathBuf>) -> SetFiles {
    let named = |names: &[&str]| -> Vec<PathBuf> {
        let has_name =
            |path: &&PathBuf| names.iter().any(|name| path.file_stem().is_some_and(|stem| stem == *name));
        files.iter().filter(has_name).cloned().collect()
    };
    let (train, validate) = (named(&TRAIN), named(&VALIDATE));
    if train.len() == TRAIN.len() && validate.len() == VALIDATE.len() {
        return SetFiles { train, validate };
    }
    SetFiles { train: files, validate: Vec::new() }
}

fn on_hidden_effect(options: &Options) -> anyhow::Result<Outcome> {
    let seed = options.seed.unwrap_or_else(seed_from_clock);
    let folder = options.out.join("flights");
    let terminal = Terminal::new(false);
    let Flown { craft, hidden: effect, vehicle_path, files } = demo_flights::fly(seed, &folder, &terminal)?;
    terminal.clear();
    if options.lab {
        // What an earlier demonstration found is of other flights.
        let _ = std::fs::remove_dir_all(folder.join("lab"));
        return open_lab(options, &folder);
    }

    // From here on only the files speak.
    let files = chosen_flights(files);
    let vehicle = Vehicle::read(&vehicle_path)?;
    let mut sets = files.read(&vehicle, Reading::default(), &terminal)?;
    let explanation =
        workflow::explain(&vehicle, &[], &mut sets, &diagnosis::Options::default(), None, &terminal)?;
    let found = explanation.found().first() == Some(&effect);
    terminal.clear();
    let lead = format!("{} {}", explanation.conclusion(), verdict(effect, seed, &explanation));
    let mut text = finish(options, &lead, Some(&vehicle_path), &sets, &explanation)?;
    let _ = write!(text, "\n{}", tables::hidden(&craft, effect, &explanation.model).to_text());
    let again = format!("quadlab demo --seed {seed}");
    let _ = writeln!(text, "\nto see this run again: {again}");
    Ok(Outcome { holds: found, ..Outcome::done(text) })
}

/// What was hidden, and whether the flights gave away that and nothing else.
fn verdict(hidden: Effect, seed: u64, explanation: &Explanation) -> String {
    let found = explanation.found();
    let gave = if found.first() == Some(&hidden) { "found from the flights alone" } else { "not found" };
    let not_there: Vec<&str> = found.iter().filter(|e| **e != hidden).map(|e| e.id()).collect();
    let wrong = if not_there.is_empty() {
        String::new()
    } else {
        format!(" Found, but not in the craft: {}.", not_there.join(", "))
    };
    format!("Hidden in the simulated craft (seed {seed}): {hidden}. It was {gave}.{wrong}")
}

/// Writes models and page, and says what was found.
fn finish(
    options: &Options,
    lead: &str,
    vehicle: Option<&Path>,
    sets: &FlightSets,
    explanation: &Explanation,
) -> anyhow::Result<String> {
    let page = options.out.join("report.html");
    let mut basic = explanation.basic.clone();
    sets.record_for_changes(&mut basic);
    report::write_atomic(options.out.join("basic.toml"), basic.to_toml())?;
    report::write_atomic(options.out.join("better.toml"), explanation.model.to_toml())?;
    pages::explanation(lead, sets, explanation)
        .provenance(provenance(vehicle.as_slice(), sets.all()))
        .write(&page)?;
    let mut text = tables::paragraph(lead);
    let _ = write!(text, "\n{}", tables::falling_error(explanation).to_text());
    for step in &explanation.steps {
        let finding = &step.addition.finding;
        let line = format!("{}: {}. {}", step.effect, finding.reason, sentence(step.effect));
        let _ = write!(text, "\n{}", tables::paragraph(&line));
    }
    let left = format!("What is left: {}", explanation.last_diagnosis.summary);
    let _ = write!(text, "\n{}", tables::paragraph(&left));
    let _ = writeln!(text, "\npage: {}", page.display());
    Ok(text)
}

fn sentence(effect: Effect) -> &'static str {
    effect.info().sentence
}
