//! `quadlab`: from flights to a model, and from a model that fails to the physical effect it lacks.
//!
//! One file a command; each returns what goes to standard output and whether what it checks holds. This file parses
//! arguments and turns errors into one line and an exit status: 0 done, 1 the job ran and what it checks does not hold,
//! 2 bad usage or bad input. Progress and warnings go to standard error.
//!
//! Other programs run the same commands in their own process ([`run`]): crate `python`.
//!
//! Deliberately absent: mathematics (crates `model`, `sysid` and `design`) and drawing (crate `report`).
#![forbid(unsafe_code)]
#![cfg_attr(
    not(feature = "all-commands"),
    allow(dead_code, reason = "what commands share is for all of them")
)]

mod cli;
#[cfg(feature = "all-commands")]
mod commands;
mod demo;
#[cfg(feature = "all-commands")]
mod embedded;
#[cfg(not(feature = "all-commands"))]
mod first_look;
#[cfg(feature = "all-commands")]
mod lab;
mod render;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use crate::cli::colour;
use crate::cli::output::Outcome;
#[cfg(feature = "all-commands")]
use crate::commands::{Command, outcome};
#[cfg(not(feature = "all-commands"))]
use crate::first_look::{Command, outcome};

pub use crate::cli::colour::{Level, tell_to};
#[cfg(feature = "all-commands")]
pub use crate::embedded::{Ran, check_model, craft_to_fly, program, read_flights, run};

/// Identify a quadcopter's model from flights, find where it fails, and name the physical effect it lacks.
///
/// Training flights (--train) fit a model; held-out flights (--validate) judge it. Units are SI and radians. u, v, w are velocities along
/// the body axes forward, right and down; p, q, r are the rates in roll, pitch and yaw. "The thesis" is A. Szabo, Wright State
/// University, 2017.
///
/// Exit status: 0 success, 1 the command ran but a check or a requirement failed, 2 bad usage or bad input.
#[derive(Parser)]
#[command(name = "quadlab", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const DOES_NOT_HOLD: u8 = 1;
const BAD_INPUT: u8 = 2;

/// The program.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return usage(&error),
    };
    match outcome(arguments.command, Arguments::command).and_then(finish) {
        Ok(code) => code,
        Err(error) => {
            colour::error(&with_causes(&error));
            ExitCode::from(BAD_INPUT)
        }
    }
}

fn finish(outcome: Outcome) -> anyhow::Result<ExitCode> {
    report::print(&colour::for_stdout(&outcome.text))?;
    outcome.refused.iter().for_each(|why| colour::error(why));
    if !outcome.refused.is_empty() {
        return Ok(ExitCode::from(BAD_INPUT));
    }
    Ok(if outcome.holds { ExitCode::SUCCESS } else { ExitCode::from(DOES_NOT_HOLD) })
}

/// Help as it is; a mistake as one line.
fn usage(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // A reader that closes the pipe early has seen enough.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    colour::error(&mistake(error, std::env::args_os()));
    ExitCode::from(BAD_INPUT)
}

/// A mistake in the words of a command, in one line.
fn mistake(error: &clap::Error, words: impl Iterator<Item = OsString>) -> String {
    let text = error.to_string();
    // No value of ours begins with dashes, so to pass one after `--` is no way out.
    let is_said = |line: &&str| !line.is_empty() && !line.starts_with("tip: to pass");
    let lines = text.lines().map(str::trim).filter(is_said);
    let said: Vec<&str> =
        lines.take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more")).collect();
    let said = match error.kind() {
        // clap would print the whole help as the error.
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => "error: no command given".into(),
        _ => said.join(" "),
    };
    format!("{} (see {} --help)", said.strip_prefix("error: ").unwrap_or(&said), invoked(words))
}

/// The command that was meant, with its subcommands: "quadlab design check".
fn invoked(all: impl Iterator<Item = OsString>) -> String {
    let arguments = Arguments::command();
    let mut command = &arguments;
    let mut words = vec![command.get_name()];
    for argument in all.skip(1) {
        let Some(subcommand) = command.find_subcommand(&argument) else { break };
        words.push(subcommand.get_name());
        command = subcommand;
    }
    words.join(" ")
}

/// The error and its causes, each told once: many errors of the libraries quote their cause themselves.
fn with_causes(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |told, cause| {
        if told.is_empty() {
            cause
        } else if told.contains(&cause) {
            told
        } else {
            format!("{told}: {cause}")
        }
    })
}
