//! Faults of flights, vehicle files and fits: told on standard error and in JSON, or refused.

use std::path::PathBuf;

use diagnosis::workflow::{self, Faults, LoadedFlight, MapToWrite, Reading};
use flights::COLUMNS;
use model::Vehicle;
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

    /// Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside the flights, and continue
    #[arg(long, conflicts_with = "accept_faults")]
    apply: bool,

    /// Use the flights from this time on (column t, in s), even where the craft is not flying, for example: --from 12.5
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,

    /// Use the flights up to this time (column t, in s), even where the craft is not flying, for example: --to 61
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
}

/// Times between which there is nothing.
#[derive(Debug, thiserror::Error)]
#[error("--from {from} --to {to}: the first time has to be before the last; both are in s, in the column t")]
pub(crate) struct NoTimeBetween {
    from: f64,
    to: f64,
}

impl FaultOptions {
    /// How flights are taken with these options.
    pub(crate) fn reading(self) -> Result<Reading, NoTimeBetween> {
        let (from, to) = (self.from.unwrap_or(f64::NEG_INFINITY), self.to.unwrap_or(f64::INFINITY));
        if !(from < to) {
            return Err(NoTimeBetween { from, to });
        }
        let window_s = (self.from.is_some() || self.to.is_some()).then_some([from, to]);
        Ok(Reading { accept_faults: self.accept_faults, window_s, ..Reading::default() })
    }
}

impl FaultOptions {
    /// With `--apply`, writes the maps of columns that mend the flights, and says so.
    pub(crate) fn apply(self, flights: &[&PathBuf], vehicle: &Vehicle) -> anyhow::Result<()> {
        if self.apply {
            apply(flights, vehicle, self.reading()?)?;
        }
        Ok(())
    }
}

/// Writes the maps of columns that mend flights, and says so; whether there were any.
pub(crate) fn apply(flights: &[&PathBuf], vehicle: &Vehicle, reading: Reading) -> anyhow::Result<bool> {
    let maps = workflow::mends(flights, vehicle, reading)?;
    for MapToWrite { file, text, lines } in &maps {
        report::write_atomic(file, text)?;
        colour::note(&format!("{}: written: {}", file.display(), lines.join("; ")));
    }
    Ok(!maps.is_empty())
}

/// Warns on standard error. For the end of a command: one that is refused says why in one line and nothing else.
pub(crate) fn warn(faults: &Faults) {
    let told = faults.listed().iter().filter(|listed| listed.fault.severity != Severity::Note);
    for warning in grouped(told.map(|listed| (listed.whose.as_str(), listed.fault.sentence.as_str()))) {
        colour::warn(&warning);
    }
    for sentence in faults.withdrawn() {
        colour::note(sentence);
    }
}

/// One line for what is said of several flights in the same words, and for what is found in several places of one and has the same
/// remedy: a remedy that is told eighteen times hides everything else.
fn grouped<'a>(told: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<String> {
    let mut by_sentence: Vec<(Vec<&str>, &str)> = Vec::new();
    for (whose, sentence) in told {
        match by_sentence.iter_mut().find(|(_, known)| *known == sentence) {
            Some((all, _)) => all.push(whose),
            None => by_sentence.push((vec![whose], sentence)),
        }
    }
    let mut by_remedy: Vec<(Vec<&str>, Vec<&str>, Option<&str>)> = Vec::new();
    for (whose, sentence) in by_sentence {
        let (found, remedy) = sentence.split_once(": ").map_or((sentence, None), |(a, b)| (a, Some(b)));
        let same = |known: &&mut (Vec<&str>, _, Option<&str>)| {
            remedy.is_some() && known.0 == whose && known.2 == remedy
        };
        match by_remedy.iter_mut().find(same) {
            Some((_, all, _)) => all.push(found),
            None => by_remedy.push((whose, vec![found], remedy)),
        }
    }
    let line = |(whose, found, remedy): (Vec<&str>, Vec<&str>, Option<&str>)| {
        let remedy = remedy.map_or_else(String::new, |remedy| format!(": {remedy}"));
        format!("{}: {}{remedy}", whose.join(", "), found.join("; "))
    };
    by_remedy.into_iter().map(line).collect()
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
    /// What of each flight was used.
    used: Vec<UsedEntry<'a>>,
}

/// What of a flight was used.
#[derive(Serialize, JsonSchema)]
struct UsedEntry<'a> {
    flight: &'a str,
    /// First and last time of each part, s.
    parts: &'a [[f64; 2]],
    /// What does not fly, and is left out.
    left_out: Vec<LeftOutEntry>,
    /// Values that were taken for outliers and replaced before the fit.
    outliers: Vec<OutlierEntry>,
}

#[derive(Serialize, JsonSchema)]
struct LeftOutEntry {
    /// First time, s.
    from_s: f64,
    /// Last time, s.
    to_s: f64,
    /// What the craft does there: `standing`, `carried` or `tumbling`.
    why: &'static str,
}

#[derive(Serialize, JsonSchema)]
struct OutlierEntry {
    /// Time, s.
    t_s: f64,
    /// Column of the flight file.
    column: &'static str,
    /// The value as logged, in the unit of the column; an angle unwrapped.
    value: f64,
}

impl<'a> UsedEntry<'a> {
    fn of(flight: &'a LoadedFlight) -> Self {
        let left_out = flight.taken.left_out.iter();
        let outliers = flight.prepared.outliers.iter();
        Self {
            flight: &flight.prepared.name,
            parts: &flight.taken.parts,
            left_out: left_out
                .map(|p| LeftOutEntry { from_s: p.from_s, to_s: p.to_s, why: p.why.id() })
                .collect(),
            outliers: outliers
                .map(|o| OutlierEntry { t_s: o.t_s, column: COLUMNS[o.column as usize], value: o.value })
                .collect(),
        }
    }
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
    let (clocks, used) = flights.into_iter().map(|flight| (entry(flight), UsedEntry::of(flight))).unzip();
    Outcome::json(&WithFaults { document, faults: faults.all(), withdrawn: faults.withdrawn(), clocks, used })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_words_and_the_same_remedy_are_told_once() {
        let told = [
            ("A.csv", "rates are smoothed: log p, q, r"),
            ("craft", "C_u = 1 should be negative: check z"),
            ("B.csv", "rates are smoothed: log p, q, r"),
            ("craft", "C_v = 2 should be negative: check z"),
            ("craft", "no remedy"),
        ];
        assert_eq!(
            grouped(told.into_iter()),
            [
                "A.csv, B.csv: rates are smoothed: log p, q, r",
                "craft: C_u = 1 should be negative; C_v = 2 should be negative: check z",
                "craft: no remedy",
            ]
        );
    }
}
