//! `cargo xtask bench`: times (divan), throughput, and, where valgrind can run, instruction counts (gungraun).
//!
//! Times say what a person waits for, but wander with the machine; instruction counts are the same on
//! every run, so a change of a few percent can be seen. A bench whose name ends in `instructions` counts. One
//! whose name ends in `throughput` does its work once and prints the processor time it took; it runs in several
//! fresh processes, in turn with other people's programs if there are any to compare with.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use cargo_metadata::TargetKind;

mod figures;
mod kept;
mod peers;

use self::figures::{Figures, Throughput, TimesReader};
use self::kept::Kept;
use self::peers::{FLIGHT_FILE_FOLDER, Peers};
use crate::base::process::{Program, cargo, filtered, run_program, shown};
use crate::base::tally::SKIP_MARK;
use crate::base::tools::{self, VALGRIND};
use crate::base::workspace::Workspace;

/// Fresh processes of a throughput bench.
const RUNS: usize = 5;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only the benchmarks of this name; `lab` measures how often diagnoses are right, `real` what is found in real flights; by
    /// default all times and counts
    name: Option<String>,

    /// Alternate our throughput benchmarks with the reference programs in this folder
    #[arg(long, value_name = "FOLDER")]
    against: Option<PathBuf>,

    /// Keep the figures of this commit in this folder, and write its speed.md anew: every kept commit beside the others
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,

    /// Arguments of `lab`, such as --quick, or of `real`, such as --data FOLDER
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    arguments: Vec<OsString>,
}

#[cfg(test)]
impl Options {
    pub(crate) fn arguments(&self) -> &[OsString] {
        &self.arguments
    }
}

/// What a bench measures; they run in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Times,
    Throughput,
    Instructions,
}

/// A bench target of a crate.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Bench {
    package: String,
    name: String,
}

impl Bench {
    fn kind(&self) -> Kind {
        match self.name.rsplit('_').next() {
            Some("instructions") => Kind::Instructions,
            Some("throughput") => Kind::Throughput,
            _ => Kind::Times,
        }
    }

    fn command(&self) -> std::process::Command {
        cargo(["bench", "--package", &self.package, "--bench", &self.name])
    }
}

/// Runs the benches and shows what they measured; status 1 when one of them fails.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    for program in [Program::LAB, Program::FORMS, Program::REAL] {
        if options.name.as_deref() == Some(program.binary()) {
            return run_program(&program, &options.arguments);
        }
    }
    if let Some(argument) = options.arguments.first() {
        bail!(
            "only `lab`, `forms` and `real` take arguments, and {} is one; leave it out",
            argument.display()
        );
    }
    let all: Vec<Bench> = workspace
        .targets(&TargetKind::Bench)
        .into_iter()
        .map(|(package, name, _)| Bench { package, name })
        .collect();
    let chosen = chosen(&all, options.name.as_deref())?;
    let counts = chosen.iter().any(|bench| bench.kind() == Kind::Instructions);
    let obstacle = if counts { counting_obstacle(workspace) } else { None };
    let names: Vec<&str> = chosen.iter().map(|bench| bench.name.as_str()).collect();
    let peers = options.against.as_ref().map(|folder| Peers::prepare(folder, &names)).transpose()?;
    let kept =
        options.keep.as_ref().map(|folder| Kept::begun(folder).map(|kept| (folder, kept))).transpose()?;
    let mut figures = Figures::default();
    let mut skipped = peers.as_ref().map(|peers| peers.skipped.clone()).unwrap_or_default();
    let mut failed = Vec::new();
    for bench in &chosen {
        if let (Kind::Instructions, Some(why)) = (bench.kind(), &obstacle) {
            skipped.push(format!("{SKIP_MARK} {} of {}, {why}", bench.name, bench.package));
            continue;
        }
        println!("\n== {} of {}: {}", bench.name, bench.package, shown(&bench.command()));
        let succeeded = match bench.kind() {
            Kind::Times => time(bench, &mut figures)?,
            Kind::Throughput => work(bench, peers.as_ref(), &mut figures)?,
            Kind::Instructions => count(bench, &mut figures)?,
        };
        if !succeeded {
            failed.push(format!("{} of {}", bench.name, bench.package));
        }
    }
    print!("\n{figures}");
    skipped.iter().for_each(|line| println!("{line}"));
    if failed.is_empty() {
        if let Some((folder, kept)) = kept {
            println!("kept: {}", kept.of(figures).keep(folder)?.display());
        }
        return Ok(ExitCode::SUCCESS);
    }
    eprintln!("failed: {}", failed.join(", "));
    Ok(ExitCode::FAILURE)
}

/// Runs a bench of divan, with its output on the terminal.
fn time(bench: &Bench, figures: &mut Figures) -> Result<bool> {
    let mut reader = TimesReader::default();
    let mut found = 0;
    let succeeded = filtered(&mut bench.command(), |line| {
        if let Some((function, median)) = reader.line(line) {
            figures.add_median(&bench.name, function, median);
            found += 1;
        }
        true
    })?;
    Ok(succeeded && any(found, bench))
}

/// Runs a bench of gungraun, whose many lines a count are left out.
fn count(bench: &Bench, figures: &mut Figures) -> Result<bool> {
    let mut found = 0;
    let succeeded = filtered(bench.command().env("GUNGRAUN_OUTPUT_FORMAT", "json"), |line| {
        let Some((function, count)) = figures::counted(line) else { return true };
        figures.add_instructions(&bench.name, function, count);
        found += 1;
        false
    })?;
    Ok(succeeded && any(found, bench))
}

/// Runs a throughput bench and its peers in turn: what disturbs the machine disturbs both.
fn work(bench: &Bench, peers: Option<&Peers>, figures: &mut Figures) -> Result<bool> {
    let mut ours: Vec<Throughput> = Vec::new();
    let mut theirs: Vec<(&'static str, Vec<Throughput>)> = Vec::new();
    for _ in 0..RUNS {
        let mut command = bench.command();
        command.arg("--quiet");
        if let Some(peers) = peers {
            command.env(FLIGHT_FILE_FOLDER, peers.working_folder());
        }
        let mut run = None;
        let succeeded = filtered(&mut command, |line| {
            let Some(read) = Throughput::from_line(line) else { return true };
            println!("{} per CPU-second", read.shown());
            run = Some(read);
            false
        })?;
        let Some(run) = run.filter(|_| succeeded) else { return Ok(any(0, bench)) };
        for (peer, their_run) in
            peers.map(|peers| peers.run(&bench.name, &run)).transpose()?.unwrap_or_default()
        {
            match theirs.iter_mut().find(|(name, _)| *name == peer) {
                Some((_, runs)) => runs.push(their_run),
                None => theirs.push((peer, vec![their_run])),
            }
        }
        ours.push(run);
    }
    figures.add_throughput(&bench.name, &ours);
    for (peer, runs) in &theirs {
        figures.add_comparison(peer, &ours, runs);
    }
    Ok(true)
}

/// A bench without a figure has failed, or prints what this program no longer understands.
fn any(found: usize, bench: &Bench) -> bool {
    if found == 0 {
        eprintln!("no figure recognised in what {} of {} prints", bench.name, bench.package);
    }
    found > 0
}

/// The benches to run, in the order of their kinds.
fn chosen(all: &[Bench], name: Option<&str>) -> Result<Vec<Bench>> {
    let wanted = |bench: &&Bench| name.is_none_or(|name| bench.name == name);
    let mut chosen: Vec<Bench> = all.iter().filter(wanted).cloned().collect();
    chosen.sort_by_key(Bench::kind);
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
    fn the_reference_programs_may_be_named_before_or_after_the_bench() {
        use clap::{Args, Command, FromArgMatches};
        for line in [["bench", "--against", "folder", "tick"], ["bench", "tick", "--against", "folder"]] {
            let matches = Options::augment_args(Command::new("bench")).try_get_matches_from(line);
            let options = Options::from_arg_matches(&matches.expect("both orders are fine"));
            let options = options.expect("they are options");
            assert_eq!(options.name.as_deref(), Some("tick"));
            assert_eq!(options.against, Some(PathBuf::from("folder")), "{line:?}");
            assert!(options.arguments.is_empty());
        }
    }

    #[test]
    fn the_name_says_what_is_measured() {
        assert_eq!(bench("control", "tick_instructions").kind(), Kind::Instructions);
        assert_eq!(bench("sil", "flight_throughput").kind(), Kind::Throughput);
        assert_eq!(bench("control", "tick").kind(), Kind::Times);
    }
}
