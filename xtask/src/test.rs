//! `cargo xtask test`: every check, one after the other, with one closing line of counts.
//!
//! The order is from quick and common to slow and rare. A step that cannot run is skipped aloud; in
//! continuous integration (`CI=true`) that is a failure, since nobody would read it.

use std::num::NonZero;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};

use crate::base::process::{FIRST_LOOK, cargo, in_continuous_integration, output_of};
use crate::base::tally::{self, SKIP_MARK, Tally};
use crate::base::tools::{CARGO_DENY, CLIPPY, GIT, MDBOOK, NEXTEST, RUSTFMT, TYPESCRIPT};
use crate::base::workspace::Workspace;
use crate::checks::known::Kind;
use crate::checks::{arrows, dependencies, promises, scripts, structure, tidy};
use crate::nightly::PARTS;
use crate::step::{Outcome, Step, command_holds, harness, holds, listed, missing, nextest, one};
use crate::{arm, book, supply};

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Continue after a failed step, to see all failures
    #[arg(long)]
    keep_going: bool,
    /// What takes too long for every change, in the place of the usual steps
    #[arg(long)]
    nightly: bool,
    /// Only these steps; by default all
    #[arg(value_name = "STEP", value_parser = STEPS.iter().chain(PARTS).map(|step| step.name).collect::<Vec<_>>())]
    steps: Vec<String>,
}

/// What tells nextest how many tests run at once.
const TESTS_AT_ONCE: &str = "NEXTEST_TEST_THREADS";

const STEPS: &[Step] = &[
    Step { name: "format", about: "sources are formatted", tools: &[&RUSTFMT], run: format },
    Step {
        name: "arrows",
        about: "crates use only what the architecture allows",
        tools: &[],
        run: check_arrows,
    },
    Step { name: "circles", about: "no files use each other in a loop", tools: &[], run: check_circles },
    Step {
        name: "folders",
        about: "folders of a crate use only those below them",
        tools: &[],
        run: check_folders,
    },
    Step {
        name: "lengths",
        about: "files and functions are short enough to read",
        tools: &[],
        run: check_lengths,
    },
    Step {
        name: "promises",
        about: "every test that the book's table of tests names exists",
        tools: &[&GIT],
        run: check_promises,
    },
    Step {
        name: "tidy",
        about: "house rules: heads, links, sizes, leftovers",
        tools: &[&GIT],
        run: check_tidy,
    },
    Step {
        name: "lints",
        about: "no warnings from clippy or the compiler on any target",
        tools: &[&CLIPPY],
        run: lints,
    },
    Step {
        name: "scripts",
        about: "the page's scripts have no type errors and nothing unused",
        tools: &[&GIT, &TYPESCRIPT],
        run: check_scripts,
    },
    Step {
        name: "arm",
        about: "programs of the craft's processors build, fit, and cannot panic in flight",
        tools: &[],
        run: arm_programs,
    },
    Step { name: "tests", about: "unit tests, integration tests and stories", tools: &[], run: tests },
    Step { name: "doc tests", about: "examples in the docs run", tools: &[], run: doc_tests },
    Step { name: "docs", about: "rustdoc builds without warnings", tools: &[], run: docs },
    Step {
        name: "book",
        about: "the book builds; its links and commands exist",
        tools: &[&MDBOOK],
        run: check_book,
    },
    Step {
        name: "licences",
        about: "every dependency may be linked and comes from where it should",
        tools: &[&CARGO_DENY],
        run: supply::check_licences,
    },
    Step {
        name: "flying",
        about: "nothing is linked into what flies but what is listed",
        tools: &[],
        run: supply::check_flying,
    },
];

/// Runs the steps; status 1 when one fails.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let start = Instant::now();
    let mut total = Tally::default();
    let mut summary = Vec::new();
    let wanted =
        |step: &&Step| options.steps.is_empty() || options.steps.iter().any(|name| name == step.name);
    let table = if options.nightly { PARTS } else { STEPS };
    let steps: Vec<&Step> = table.iter().filter(wanted).collect();
    anyhow::ensure!(
        !steps.is_empty(),
        "none of these steps is of {}",
        if options.nightly { "the night" } else { "the day: add --nightly" }
    );
    // The night's parts have nothing to do with one another, and nobody waits for the first failure.
    let goes_on = options.keep_going || options.nightly;
    for (at, step) in steps.iter().enumerate() {
        if total.failed > 0 && !goes_on {
            summary.push(format!("  not run  {}", step.name));
            continue;
        }
        println!("\n== {}/{} {}: {}", at + 1, steps.len(), step.name, step.about);
        let began = Instant::now();
        let outcome = match step.tools.iter().find(|tool| tool.found().is_none()) {
            Some(tool) => Ok(missing(tool)),
            None => (step.run)(workspace),
        };
        let tally = counted(step, outcome);
        let word = verdict(&tally);
        let seconds = began.elapsed().as_secs_f64();
        println!("   {word} in {seconds:.1} s");
        summary.push(format!("  {word:7}  {:9} {seconds:7.1} s  {tally}", step.name));
        total.add(&tally);
    }
    println!("\n== summary, {:.1} s", start.elapsed().as_secs_f64());
    for line in summary.iter().chain(&total.skip_lines) {
        println!("{line}");
    }
    println!("{total}");
    Ok(ExitCode::from(u8::from(total.failed > 0)))
}

/// Turns whatever came of a step into counts. An error of the step itself is one failure.
fn counted(step: &Step, outcome: Result<Outcome>) -> Tally {
    match outcome {
        Ok(Outcome::Ran(tally)) => tally,
        Ok(Outcome::Skipped(why)) => {
            let line = format!("{SKIP_MARK} {}, {why}", step.name);
            println!("{line}");
            skipped_step(line, in_continuous_integration())
        }
        Err(error) => {
            println!("error: {error:#}");
            one(false)
        }
    }
}

/// A step left out: skipped on a developer's machine, failed where nobody reads it.
fn skipped_step(line: String, fails: bool) -> Tally {
    Tally { failed: usize::from(fails), skipped: usize::from(!fails), skip_lines: vec![line], passed: 0 }
}

fn verdict(tally: &Tally) -> &'static str {
    match tally {
        Tally { failed: 1.., .. } => "FAILED",
        Tally { passed: 0, skipped: 1.., .. } => "skipped",
        _ => "passed",
    }
}

fn format(_: &Workspace) -> Result<Outcome> {
    command_holds(cargo(["fmt", "--all", "--check"]))
}

fn lints(workspace: &Workspace) -> Result<Outcome> {
    let mut tally = Tally::default();
    let here = cargo(["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]);
    let mut first_look = cargo(["clippy", "--package", "quadlab", "--lib", "--bins"]);
    first_look.args(FIRST_LOOK).args(["--", "-D", "warnings"]);
    for command in [here, first_look].into_iter().chain(arm::lints(workspace)) {
        tally.add(&holds(command)?);
    }
    Ok(Outcome::Ran(tally))
}

fn check_scripts(_: &Workspace) -> Result<Outcome> {
    command_holds(scripts::command()?)
}

/// Before the tests, which run what is built here.
fn arm_programs(workspace: &Workspace) -> Result<Outcome> {
    match arm::Target::ALL.into_iter().find_map(arm::missing) {
        Some(missing) => Ok(Outcome::Skipped(missing)),
        None => Ok(listed("both targets", &arm::check(workspace)?)),
    }
}

fn tests(workspace: &Workspace) -> Result<Outcome> {
    if NEXTEST.found().is_some() {
        return with_nextest(workspace);
    }
    println!("   with `cargo test`; faster with nextest: {}", NEXTEST.install);
    let mut command = cargo(["test", "--workspace", "--tests", "--no-fail-fast", "--", "--show-output"]);
    command.envs(arm::variables(workspace));
    Ok(Outcome::Ran(harness(command)?))
}

fn doc_tests(_: &Workspace) -> Result<Outcome> {
    let command = cargo(["test", "--workspace", "--doc", "--no-fail-fast", "--", "--show-output"]);
    Ok(Outcome::Ran(harness(command)?))
}

/// How many tests run at once where the user does not say: half as many again as there are processors, for a third of the
/// time of those that use a browser, a serial line or a network is waiting.
fn tests_at_once() -> String {
    let processors = std::thread::available_parallelism().map_or(1, NonZero::get);
    processors.saturating_add(processors / 2).to_string()
}

/// Runs the tests with nextest, counting from its report and its list of ignored tests.
fn with_nextest(workspace: &Workspace) -> Result<Outcome> {
    let mut command = cargo(["nextest", "run", "--workspace", "--profile", "xtask"]);
    if std::env::var_os(TESTS_AT_ONCE).is_none() {
        command.env(TESTS_AT_ONCE, tests_at_once());
    }
    command.envs(arm::variables(workspace));
    let mut tally = nextest(command)?;
    let list = output_of(&mut cargo(["nextest", "list", "--workspace", "--message-format", "json"]));
    tally.add(&tally::ignored_in_list(&list.context("`cargo nextest list` fails")?)?);
    Ok(Outcome::Ran(tally))
}

fn docs(_: &Workspace) -> Result<Outcome> {
    // There are no examples; but with them cargo takes the features of the tests, for which all dependencies are there.
    let mut command = cargo(["doc", "--workspace", "--no-deps", "--lib", "--bins", "--examples"]);
    let flags = std::env::var("RUSTDOCFLAGS").unwrap_or_default();
    command.env("RUSTDOCFLAGS", format!("{flags} -D warnings").trim());
    command_holds(command)
}

fn check_book(_: &Workspace) -> Result<Outcome> {
    Ok(listed("pages, links and commands", &book::check()?))
}

fn check_arrows(workspace: &Workspace) -> Result<Outcome> {
    let mut problems = arrows::check(workspace);
    problems.extend(dependencies::check(workspace)?);
    let about = format!("{} crates, {} arrows", workspace.members().len(), arrows::edges(workspace).len());
    Ok(listed(&about, &problems))
}

fn check_circles(workspace: &Workspace) -> Result<Outcome> {
    let problems = structure::check(workspace, &[Kind::Circle])?;
    Ok(listed("every library and program; `cargo xtask levels` shows who uses whom", &problems))
}

fn check_folders(workspace: &Workspace) -> Result<Outcome> {
    let problems = structure::check(workspace, &[Kind::FolderArrow, Kind::Folder])?;
    Ok(listed("every crate that has folders", &problems))
}

fn check_lengths(workspace: &Workspace) -> Result<Outcome> {
    let problems = structure::check(workspace, &[Kind::LongFile, Kind::LongFunction])?;
    Ok(listed("every library and program, without what is for tests", &problems))
}

fn check_promises(workspace: &Workspace) -> Result<Outcome> {
    let [steps, parts] = [STEPS, PARTS].map(|table| table.iter().map(|step| step.name).collect::<Vec<_>>());
    Ok(listed("the page of tests in the book", &promises::check(workspace, &steps, &parts)?))
}

fn check_tidy(workspace: &Workspace) -> Result<Outcome> {
    Ok(listed("all files that git knows", &tidy::check(workspace)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skipped_step_fails_in_continuous_integration_only() {
        let line = || format!("{SKIP_MARK} lints, clippy is not installed: {}", CLIPPY.install);
        assert_eq!(verdict(&skipped_step(line(), false)), "skipped");
        assert_eq!(verdict(&skipped_step(line(), true)), "FAILED");
        assert_eq!(skipped_step(line(), true).skip_lines, [line()]);
    }
}
