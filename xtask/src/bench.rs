//! `cargo xtask bench`: times (divan) and, where valgrind can run, instruction counts (gungraun).
//!
//! Times say what a person waits for, but wander with the machine; instruction counts are the same on
//! every run, so a change of a few percent can be seen. A bench whose name ends in `instructions` counts.

use std::ffi::OsString;
use std::process::ExitCode;

use anyhow::{Result, bail};
use cargo_metadata::TargetKind;

use crate::process::{Program, cargo, run_program, shown, succeeds};
use crate::tally::SKIP_MARK;
use crate::tools::{self, VALGRIND};
use crate::workspace::Workspace;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only the benches of this name; `lab` measures how often diagnoses are right; all times and counts without it
    name: Option<String>,

    /// Arguments of `lab`, such as --quick
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    arguments: Vec<OsString>,
}

#[cfg(test)]
impl Options {
    pub(crate) fn arguments(&self) -> &[OsString] {
        &self.arguments
    }
}

/// A bench target of a crate.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Bench {
    package: String,
    name: String,
}

impl Bench {
    fn counts_instructions(&self) -> bool {
        self.name.ends_with("instructions")
    }
}

/// Runs the benches; status 1 when one of them fails.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    if options.name.as_deref() == Some(Program::LAB.binary()) {
        return run_program(&Program::LAB, &options.arguments);
    }
    if let Some(argument) = options.arguments.first() {
        bail!("only `lab` takes arguments, and {} is one; leave it out", argument.display());
    }
    let all: Vec<Bench> = workspace
        .targets(&TargetKind::Bench)
        .into_iter()
        .map(|(package, name, _)| Bench { package, name })
        .collect();
    let chosen = chosen(&all, options.name.as_deref())?;
    let obstacle =
        chosen.iter().any(Bench::counts_instructions).then(|| counting_obstacle(workspace)).flatten();
    let mut failed = Vec::new();
    for bench in &chosen {
        if let (true, Some(why)) = (bench.counts_instructions(), &obstacle) {
            println!("{SKIP_MARK} {} of {}, {why}", bench.name, bench.package);
            continue;
        }
        let mut command = cargo(["bench", "--package", &bench.package, "--bench", &bench.name]);
        println!("\n== {} of {}: {}", bench.name, bench.package, shown(&command));
        if !succeeds(&mut command)? {
            failed.push(format!("{} of {}", bench.name, bench.package));
        }
    }
    if failed.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    eprintln!("failed: {}", failed.join(", "));
    Ok(ExitCode::FAILURE)
}

/// The benches to run, times before instruction counts.
fn chosen(all: &[Bench], name: Option<&str>) -> Result<Vec<Bench>> {
    let wanted = |bench: &&Bench| name.is_none_or(|name| bench.name == name);
    let mut chosen: Vec<Bench> = all.iter().filter(wanted).cloned().collect();
    chosen.sort_by_key(Bench::counts_instructions);
    let Some(name) = name.filter(|_| chosen.is_empty()) else {
        if chosen.is_empty() {
            bail!("no crate of the workspace has a bench");
        }
        return Ok(chosen);
    };
    let mut names: Vec<&str> = all.iter().map(|bench| bench.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    bail!("no bench is called {name}; there are: {}", names.join(", "))
}

/// What keeps instruction counts from running here, with the line that mends it.
fn counting_obstacle(workspace: &Workspace) -> Option<String> {
    if VALGRIND.found().is_none() {
        return Some(format!("valgrind is not installed: {}", VALGRIND.install));
    }
    let version = workspace.locked_version("gungraun")?;
    match tools::gungraun_runner_version() {
        Some(found) if found == version => None,
        found => Some(format!(
            "gungraun-runner {version} is needed and {} is installed: {}",
            found.unwrap_or_else(|| "none".to_owned()),
            tools::gungraun_runner_install(&version)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bench(package: &str, name: &str) -> Bench {
        Bench { package: package.into(), name: name.into() }
    }

    fn some_benches() -> Vec<Bench> {
        vec![bench("control", "tick_instructions"), bench("control", "tick"), bench("sysid", "identify")]
    }

    #[test]
    fn all_benches_run_times_first() {
        let all = some_benches();
        let names: Vec<String> =
            chosen(&all, None).expect("there are some").into_iter().map(|bench| bench.name).collect();
        assert_eq!(names, ["tick", "identify", "tick_instructions"]);
    }

    #[test]
    fn one_bench_runs_by_its_whole_name() {
        assert_eq!(chosen(&some_benches(), Some("tick")).expect("it exists"), [bench("control", "tick")]);
        let error = chosen(&some_benches(), Some("tack")).expect_err("no such bench").to_string();
        assert_eq!(error, "no bench is called tack; there are: identify, tick, tick_instructions");
        assert!(chosen(&[], None).is_err());
    }

    #[test]
    fn the_name_says_what_counts_instructions() {
        assert!(bench("control", "tick_instructions").counts_instructions());
        assert!(!bench("control", "tick").counts_instructions());
    }
}
