//! The commands of the program.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::builder::ValueRange;
use clap::{Arg, ArgAction, Command};
use pyo3::prelude::*;
use quadlab::Level;
use serde_json::{Value, json};

use crate::QuadlabError;
use crate::waiting::beside;

/// Runs a command given by its words: what it prints, whether what it checks holds, and why inputs were refused.
#[pyfunction]
pub(crate) fn run(py: Python<'_>, words: Vec<OsString>) -> PyResult<(String, bool, Vec<String>)> {
    let ran = beside(py, move |stop| quadlab::run(&words, stop))?;
    ran.map(|ran| (ran.text, ran.holds, ran.refused)).map_err(QuadlabError::new_err)
}

/// Whether a file is a model, with the program's sentence where it is none.
#[pyfunction]
pub(crate) fn check_model(path: PathBuf) -> PyResult<()> {
    quadlab::check_model(&path).map_err(QuadlabError::new_err)
}

/// All commands and their options, as JSON.
#[pyfunction]
pub(crate) fn describe() -> String {
    json!(leaves(&quadlab::program(), &[])).to_string()
}

/// Commands that do something, each with the words that call it.
fn leaves(command: &Command, words: &[String]) -> Vec<Value> {
    let below = command.get_subcommands().filter(|one| !one.is_hide_set() && one.get_name() != "help");
    let mut all: Vec<Value> =
        below.flat_map(|one| leaves(one, &[words, &[one.get_name().to_owned()]].concat())).collect();
    let needs_more = command.is_subcommand_required_set() || words.is_empty();
    if !needs_more {
        let about = command.get_long_about().or(command.get_about()).map(ToString::to_string);
        let options: Vec<Value> = command.get_arguments().filter(|one| is_offered(one)).map(option).collect();
        all.insert(0, json!({ "words": words, "about": about.unwrap_or_default(), "options": options }));
    }
    all
}

fn is_offered(option: &Arg) -> bool {
    !option.is_hide_set() && !matches!(option.get_id().as_str(), "help" | "version")
}

fn option(option: &Arg) -> Value {
    let takes = match option.get_action() {
        ArgAction::SetTrue | ArgAction::SetFalse => "nothing",
        ArgAction::Append => "many",
        _ if option.get_num_args().unwrap_or(ValueRange::SINGLE).max_values() > 1 => "many",
        _ => "one",
    };
    let values: Vec<String> =
        option.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect();
    json!({
        "name": option.get_id().as_str(),
        "flag": option.get_long(),
        "takes": takes,
        "is_required": option.is_required_set(),
        "value": option.get_value_names().and_then(|names| names.first()).map(ToString::to_string),
        "values": if takes == "nothing" { Vec::new() } else { values },
        "help": option.get_help().map(ToString::to_string),
    })
}

/// Warnings and notes of the commands go to Python's `logging`, as `quadlab`.
pub(crate) fn listen() {
    quadlab::tell_to(|level, text| {
        Python::attach(|py| {
            let method = match level {
                Level::Note => "info",
                Level::Warning => "warning",
                Level::Error => "error",
            };
            let logged = py
                .import("logging")
                .and_then(|logging| logging.call_method1("getLogger", ("quadlab",)))
                .and_then(|logger| logger.call_method1(method, ("%s", text)));
            if let Err(error) = logged {
                error.print(py);
            }
        });
    });
}
