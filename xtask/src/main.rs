//! The developer's front door: `cargo xtask COMMAND`.
//!
//! Everything a developer or the continuous integration runs is a command here, so that there is one
//! way to do it on every machine. Each module is one command or one check; a check is a function from
//! plain data to a list of problems, so that it can be shown a bad example in its unit test.
//!
//! Deliberately absent: any knowledge of quadcopters. `xtask` uses no crate of the workspace, hence it
//! builds quickly and still works when one of them does not compile.
#![forbid(unsafe_code)]

mod arm;
mod base;
mod bench;
mod book;
mod checks;
mod flash;
mod known;
mod levels;
mod nightly;
mod setup;
mod source;
mod step;
mod supply;
mod test;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::base::process::{Program, run_program};
use crate::base::workspace::Workspace;

/// Developer commands of quadlab.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Fly the controller against the simulated craft; `sil --help` lists its arguments
    #[command(disable_help_flag = true)]
    Sil(PassedThrough),
    /// Run the whole workflow, from flights to a better model; `demo --help` lists its arguments
    #[command(disable_help_flag = true)]
    Demo(PassedThrough),
    /// Install a new program on a craft, or go back to the previous one
    Flash(flash::Options),
    /// Check everything: format, lints, tests, docs, dependencies between crates, licences, rules of the project
    Test(test::Options),
    /// Show the levels of dependency among the files of each crate, and any cycles
    Levels(levels::Options),
    /// Delete the entries that have been fixed from the list of known violations
    Known(known::Options),
    /// Build the book, man pages, shell completions and JSON Schemas
    Docs(book::Options),
    /// Run the benchmarks: times, and instruction counts where valgrind is installed
    Bench(bench::Options),
    /// Build the programs of the craft's processors, and report sizes, stack and instructions per period
    Arm(arm::Options),
    /// Write the bill of materials of each program that flies (CycloneDX)
    Sbom(supply::Options),
    /// Install the tools that the other commands use, or say what is missing
    Setup(setup::Options),
}

/// Arguments that belong to the program behind the command, `--help` among them.
#[derive(clap::Args)]
struct PassedThrough {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGS")]
    arguments: Vec<OsString>,
}

/// What a shell reports of a program that writes to a pipe nobody reads any more.
const OUTPUT_CLOSED: i32 = 141;

fn main() -> ExitCode {
    end_quietly_when_output_closes();
    let command = Arguments::parse().command;
    match run(command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// `cargo xtask ... | head`: every `println!` of every command panics when its reader has seen enough, and would say so at
/// length. Here is the one place where such an end is a quiet one.
fn end_quietly_when_output_closes() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let said = panic.payload().downcast_ref::<String>().map_or("", String::as_str);
        if said.starts_with("failed printing to stdout") && said.contains("Broken pipe") {
            std::process::exit(OUTPUT_CLOSED);
        }
        usual(panic);
    }));
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Sil(mut passed) => {
            let more = arm::arguments_of_sil(&Workspace::load()?, &passed.arguments)?;
            passed.arguments.extend(more);
            run_program(&Program::SIL, &passed.arguments)
        }
        Command::Demo(passed) => run_program(&Program::demo(&passed.arguments), &passed.arguments),
        Command::Flash(options) => flash::run(options),
        Command::Test(options) => test::run(&Workspace::load()?, &options),
        Command::Levels(options) => levels::run(&Workspace::load()?, &options),
        Command::Known(options) => known::run(&Workspace::load()?, &options),
        Command::Docs(options) => book::run(&options),
        Command::Bench(options) => bench::run(&Workspace::load()?, &options),
        Command::Arm(options) => arm::run(&Workspace::load()?, &options),
        Command::Sbom(options) => supply::run(&Workspace::load()?, &options),
        Command::Setup(options) => setup::run(&Workspace::load()?, &options),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The arguments of `sil`, as clap hands them on.
    fn passed_to_sil(line: &[&str]) -> Vec<OsString> {
        match Arguments::try_parse_from(line).expect("every argument is passed through").command {
            Command::Sil(passed) => passed.arguments,
            _ => panic!("parsed as another command"),
        }
    }

    #[test]
    fn every_argument_of_sil_is_passed_through_untouched() {
        for arguments in [
            vec!["--help"],
            vec!["-h"],
            vec!["--scenario", "hover", "roll-10", "--json"],
            vec!["--delay=3", "--", "--seed", "-1"],
            vec!["help"],
            vec![],
        ] {
            let line = [vec!["cargo xtask", "sil"], arguments.clone()].concat();
            assert_eq!(passed_to_sil(&line), arguments, "{line:?}");
        }
    }

    #[test]
    fn arguments_of_lab_are_passed_through() {
        let line = ["cargo xtask", "bench", "lab", "--quick", "--out", "somewhere"];
        let parsed = Arguments::try_parse_from(line).expect("lab takes arguments");
        let Command::Bench(options) = parsed.command else { panic!("parsed as another command") };
        assert_eq!(options.arguments(), ["--quick", "--out", "somewhere"]);
    }

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }
}
