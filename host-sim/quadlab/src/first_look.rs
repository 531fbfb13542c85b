//! The program with the demonstration alone: what `cargo xtask demo` builds, in half of the time that the whole takes.

use clap::Subcommand;

use crate::cli::output::Outcome;
use crate::demo;

#[derive(Subcommand)]
pub(crate) enum Command {
    Demo(demo::Options),
}

/// Runs the command, which does not ask for the program.
pub(crate) fn outcome(command: Command, _program: fn() -> clap::Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Demo(options) => demo::run(&options),
    }
}
