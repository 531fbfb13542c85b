//! The commands inside another program's process.

use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{CommandFactory as _, Parser as _};
use diagnosis::workflow::Silent;
use flights::Flight;
use model::Model;

use crate::cli::invocation::{self, Invocation};
use crate::cli::logs::import;
use crate::cli::model_files::read_model;
use crate::{Arguments, mistake, outcome, with_causes};

/// What a command that ran hands back.
#[derive(Debug, Clone)]
pub struct Ran {
    /// What the program prints.
    pub text: String,
    /// Whether what the command checks holds.
    pub holds: bool,
    /// Why inputs were refused while the job was done with the others, one line each.
    pub refused: Vec<String>,
}

/// The commands with their options.
pub fn program() -> clap::Command {
    Arguments::command()
}

/// Runs a command, given by its words without the program's name. Long work stops at its next step once `stop` is set.
///
/// # Errors
/// The one line that the program would print.
pub fn run(words: &[OsString], stop: Arc<AtomicBool>) -> Result<Ran, String> {
    let words: Vec<OsString> = std::iter::once("quadlab".into()).chain(words.iter().cloned()).collect();
    let arguments =
        Arguments::try_parse_from(&words).map_err(|error| mistake(&error, words.iter().cloned()))?;
    let _within = invocation::enter(Invocation { words, stop });
    let outcome = outcome(arguments.command, Arguments::command).map_err(|error| with_causes(&error))?;
    Ok(Ran {
        text: anstream::adapter::strip_str(&outcome.text).to_string(),
        holds: outcome.holds,
        refused: outcome.refused,
    })
}

/// The flights of a flight file or of a log, read as the commands read them.
///
/// # Errors
/// What is wrong with the file, in one line.
pub fn read_flights(path: &Path) -> Result<Vec<Flight>, String> {
    let read = || -> anyhow::Result<Vec<Flight>> {
        if logs::format_of(path).is_none() {
            return Ok(vec![Flight::read(path)?]);
        }
        let parts = import(path, &Silent)??.flights;
        anyhow::ensure!(!parts.is_empty(), logs::LogError::nothing_flown(path));
        Ok(parts.into_iter().map(|part| part.flight).collect())
    };
    read().map_err(|error| with_causes(&error))
}

/// Whether a file is a model.
///
/// # Errors
/// Why it is none, in one line.
pub fn check_model(path: &Path) -> Result<(), String> {
    read_model(path).map(drop).map_err(|error| with_causes(&error.into()))
}

/// A craft and the law that flies it: gains designed for it, else the thesis'.
///
/// # Errors
/// A model whose motors cannot be commanded, or gains that are not for it.
pub fn craft_to_fly(model: &Path, gains: Option<&Path>) -> Result<(Model, control::Config), String> {
    let read = || -> anyhow::Result<(Model, control::Config)> {
        let own = sil::flyable(model, gains.is_some())?;
        let config = match gains {
            Some(gains) => design::gains_match::read_for(gains, &own)?.config,
            None => sil::designed_config()?,
        };
        Ok((own, config))
    };
    read().map_err(|error| with_causes(&error))
}
