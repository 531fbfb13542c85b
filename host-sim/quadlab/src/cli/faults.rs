//! Faults of flights, vehicle files and fits: told on standard error and in JSON, or refused.

use diagnosis::workflow::{Faults, LoadedFlight, Reading};
use schemars::JsonSchema;
use serde::Serialize;
use sysid::checks::clocks::Clocks;
use sysid::{Fault, Severity};

use crate::cli::colour;
use crate::cli::output::Outcome;

/// What is done about faults.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct FaultOptions {
    /// Continue with flights whose axes, signs or motor order are recognised as wrong; the results will be wrong too
    #[arg(long)]
    pub(crate) accept_faults: bool,
}

impl FaultOptions {
    /// How flights are taken with these options.
    pub(crate) fn reading(self) -> Reading {
        Reading { accept_faults: self.accept_faults }
    }
}

/// Warns on standard error. For the end of a command: one that is refused says why in one line and nothing else.
pub(crate) fn warn(faults: &Faults) {
    for listed in faults.listed().iter().filter(|listed| listed.fault.severity != Severity::Note) {
        colour::warn(&format!("{}: {}", listed.whose, listed.fault.sentence));
    }
    for sentence in faults.withdrawn() {
        colour::note(sentence);
    }
}

/// A document with the faults and the clocks of the flights it is about.
#[derive(Serialize, JsonSchema)]
pub(crate) struct WithFaults<'a, T> {
    #[serde(flatten)]
    document: &'a T,
    faults: Vec<Fault>,
    /// Warnings that an effect explains which has joined the model, one sentence each.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    withdrawn: &'a [String],
    clocks: Vec<ClockEntry<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct ClockEntry<'a> {
    flight: &'a str,
    #[serde(flatten)]
    clocks: Clocks,
}

/// The JSON of a command, with what is wrong with its flights.
pub(crate) fn json<'a>(
    document: &impl Serialize,
    flights: impl IntoIterator<Item = &'a LoadedFlight>,
    faults: &'a Faults,
) -> anyhow::Result<Outcome> {
    warn(faults);
    let entry =
        |flight: &'a LoadedFlight| ClockEntry { flight: &flight.prepared.name, clocks: flight.clocks };
    let clocks = flights.into_iter().map(entry).collect();
    Outcome::json(&WithFaults { document, faults: faults.all(), withdrawn: faults.withdrawn(), clocks })
}
