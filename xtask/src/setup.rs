//! `cargo xtask setup`: from a fresh Debian or Ubuntu with Rust to a machine on which all commands work.
//!
//! It only installs what is missing, so it can be run any number of times. What it may not install (no
//! root for apt-get, no network) it says, with the line to type.

use std::process::{Command, ExitCode};

use anyhow::Result;

use crate::arm;
use crate::base::process::{output_of, shown};
use crate::base::tools::{
    self, CARGO_CYCLONEDX, CARGO_DENY, CHROMEDRIVER, CHROMIUM, CLIPPY, GIT, GUNGRAUN_RUNNER, MDBOOK, NEXTEST,
    NPM, OCTAVE, PARALLEL, PEERS, RUSTFMT, SLURM, SSHD, TYPESCRIPT, Tool, VALGRIND,
};
use crate::base::workspace::Workspace;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only say what is installed and what is missing
    #[arg(long)]
    check: bool,
    /// Leave out what `cargo xtask bench` alone needs
    #[arg(long)]
    no_bench: bool,
}

/// A tool as it is on this machine.
struct State {
    name: &'static str,
    purpose: &'static str,
    /// The version that is there.
    found: Option<String>,
    /// The lines that install it, the best one first: the next is tried where one fails.
    install: Vec<String>,
    /// Nothing stops working without it.
    optional: bool,
    /// Only `cargo xtask bench` needs it.
    of_bench: bool,
}

impl State {
    fn of(tool: &Tool, purpose: &'static str, optional: bool) -> Self {
        Self {
            name: tool.name,
            purpose,
            found: tool.found(),
            install: vec![tool.install.to_owned()],
            optional,
            of_bench: false,
        }
    }
}

/// What each tool is for, and whether it is here.
fn states(workspace: &Workspace) -> Vec<State> {
    let mut states = vec![
        State::of(&RUSTFMT, "`cargo xtask test` checks the format", false),
        State::of(&CLIPPY, "`cargo xtask test` checks the lints", false),
        State::of(&GIT, "`cargo xtask test` asks it which files are the project's", false),
        State::of(&NEXTEST, "`cargo xtask test` runs the tests faster", true),
        State::of(
            &CARGO_DENY,
            "`cargo xtask test` checks where dependencies come from and their licences",
            false,
        ),
        State::of(&CARGO_CYCLONEDX, "`cargo xtask sbom` writes bills of materials", true),
        State::of(&MDBOOK, "`cargo xtask docs` builds the book, and `cargo xtask test` checks it", false),
        State { of_bench: true, ..State::of(&VALGRIND, "`cargo xtask bench` counts instructions", false) },
    ];
    states.extend(workspace.locked_version("gungraun").map(|version| runner(&version)));
    for tool in [&arm::ARM_GCC, &arm::QEMU_ARM, &arm::ARM_LD, &arm::QEMU_SYSTEM_ARM] {
        states.push(State::of(tool, "`cargo xtask arm` builds and runs the craft's programs", false));
    }
    states.push(State::of(&SSHD, "`cargo xtask flash` is tested on a real one", false));
    for tool in [&CHROMIUM, &CHROMEDRIVER] {
        states.push(State::of(tool, "the lab's page is tested in a real browser", false));
    }
    states.push(State::of(&NPM, "it brings tsc", false));
    states.push(State::of(&TYPESCRIPT, "`cargo xtask test` checks the page's scripts", false));
    states.push(State::of(&PEERS, "exported models are flown in them", false));
    states.push(State::of(&OCTAVE, "exported models answer in it", true));
    states.push(State::of(&SLURM, "a campaign is flown by it", true));
    states.push(State::of(&PARALLEL, "a campaign is flown by it", true));
    states.extend(arm::Target::ALL.map(target));
    states
}

/// A target counts as found when this toolchain or the distribution's can build it.
fn target(target: arm::Target) -> State {
    State {
        name: target.triple(),
        purpose: "`cargo xtask arm` builds for it",
        found: arm::Toolchain::of(target).map(|toolchain| toolchain.describe().to_owned()),
        install: target.install().map(ToOwned::to_owned).to_vec(),
        optional: false,
        of_bench: false,
    }
}

/// The runner counts as found in the locked version alone: it refuses to work with another library.
fn runner(version: &str) -> State {
    State {
        name: GUNGRAUN_RUNNER,
        purpose: "`cargo xtask bench` counts instructions",
        found: tools::gungraun_runner_version().filter(|found| found == version),
        install: vec![tools::gungraun_runner_install(version)],
        optional: false,
        of_bench: true,
    }
}

/// Installs what is missing; status 1 when something needed is still missing at the end.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let mut complete = true;
    for state in states(workspace).into_iter().filter(|state| !(options.no_bench && state.of_bench)) {
        let done = settle(&state, options.check);
        complete &= done || state.optional;
    }
    println!(
        "{}",
        if complete { "everything needed is installed" } else { "something needed is missing; see above" }
    );
    Ok(ExitCode::from(u8::from(!complete)))
}

/// Says how a tool stands, installs it if it may, and answers whether it is there.
fn settle(state: &State, only_check: bool) -> bool {
    let State { name, purpose, found, install, optional, .. } = state;
    if let Some(version) = found {
        println!("there      {name}: {version}");
        return true;
    }
    let need = if *optional { "optional" } else { "missing" };
    println!("{need:9}  {name}: {purpose}");
    if only_check || *optional {
        println!("           install it with: {}", install.join(", or "));
        return false;
    }
    for line in install {
        match attempt(line) {
            Ok(()) => {
                println!("installed  {name}, with: {line}");
                return true;
            }
            Err(why) => println!("not done   {name}: {why}; install it with: {line}"),
        }
    }
    false
}

/// Runs an installation line, unless it cannot work here.
fn attempt(install: &str) -> Result<(), String> {
    if install.starts_with("apt-get") {
        apt_obstacle(is_root(), output_of(Command::new("apt-get").arg("--version")).is_some())?;
        // A fresh machine or container has no package lists yet.
        execute("apt-get update --quiet")?;
    }
    execute(install)
}

/// Why apt-get may not be used, if so.
fn apt_obstacle(root: bool, has_apt: bool) -> Result<(), String> {
    match (has_apt, root) {
        (false, _) => Err("this machine has no apt-get".to_owned()),
        (true, false) => Err("apt-get needs root".to_owned()),
        (true, true) => Ok(()),
    }
}

fn is_root() -> bool {
    output_of(Command::new("id").arg("-u")).is_some_and(|id| id.trim() == "0")
}

fn execute(line: &str) -> Result<(), String> {
    let mut words = line.split_whitespace();
    let mut command = Command::new(words.next().unwrap_or_default());
    command.args(words).env("DEBIAN_FRONTEND", "noninteractive");
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{}` failed ({status})", shown(&command))),
        Err(error) => Err(format!("`{}` does not start ({error})", shown(&command))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(found: Option<&str>, install: &str, optional: bool) -> State {
        State {
            name: "a",
            purpose: "to test",
            found: found.map(Into::into),
            install: vec![install.into()],
            optional,
            of_bench: false,
        }
    }

    #[test]
    fn what_is_there_is_not_installed_again() {
        assert!(settle(&state(Some("1.0"), "no-such-program-here", false), false));
    }

    #[test]
    fn checking_installs_nothing() {
        assert!(!settle(&state(None, "true", false), true));
        assert!(!settle(&state(None, "true", true), false));
    }

    #[test]
    fn a_failed_installation_is_reported() {
        assert!(settle(&state(None, "cargo --version", false), false));
        assert!(!settle(&state(None, "cargo no-such-subcommand", false), false));
        assert!(attempt("no-such-program-here").expect_err("not a program").contains("does not start"));
    }

    #[test]
    fn where_one_way_fails_the_next_is_tried() {
        let mut two = state(None, "cargo no-such-subcommand", false);
        two.install.push("cargo --version".to_owned());
        assert!(settle(&two, false));
    }

    #[test]
    fn apt_needs_root_and_debian() {
        assert!(apt_obstacle(true, true).is_ok());
        assert_eq!(apt_obstacle(false, true), Err("apt-get needs root".to_owned()));
        assert!(apt_obstacle(true, false).is_err());
    }
}
