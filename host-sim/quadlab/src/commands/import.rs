//! `quadlab import`: flight files and a vehicle file from the logs of other programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use diagnosis::workflow::Reading;
use flights::ColumnMap;
use logs::{Cause, ClockPair, Draft, Format, Import, Part, Sources};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::colour;
use crate::cli::faults;
use crate::cli::logs::{Read, draft, imported, read_logs, refused, vehicle_beside};
use crate::cli::model_files::VEHICLE;
use crate::cli::motion_clocks;
use crate::cli::output::{Outcome, OverwritesInput};
use crate::render::import_text;

/// Make flight files from logs of other programs.
///
/// Reads PX4 ULog, ArduPilot DataFlash, Betaflight and INAV blackbox, Crazyflie SD-card logs, ROS 1 and ROS 2 bags, MCAP,
/// Parquet, CSV under any names (a columns.toml beside them says which column is which), and recordings of `quadlab ground`. Prints how
/// far the log's clocks are apart, and what was cut out. Writes a flight file for each part that was flown, and a vehicle file that marks what you still have to measure; an
/// existing one is kept unless --force is given. Every command that takes flights also takes logs: import only saves the flights
/// as files. Exit status 2 if a log is refused; the others are still imported.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab import log1.ulg log2.ulg --out flights")]
pub(crate) struct Options {
    /// Logs: files, folders, patterns such as '*.ulg', or - for standard input
    #[arg(value_name = "LOG", num_args = 1.., required = true)]
    logs: Vec<PathBuf>,

    /// Folder to write the flight files and the vehicle file to; created if missing, for example: --out flights
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Overwrite existing flight files and an existing vehicle file
    #[arg(long)]
    force: bool,

    /// Fix wrong axes, signs and motor orders of tables: write the proposed corrections to columns.toml beside them, and continue
    #[arg(long)]
    apply: bool,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    refuse_map_in(&options.out)?;
    let mut read = read_and_named(options)?;
    // Before anything is written, a map of columns too.
    free_paths(&read, options)?;
    if options.apply && mended(&read)? {
        read = read_and_named(options)?;
    }
    let known = known_vehicle(&read)?;
    for import in read.iter_mut().filter_map(|read| read.import.as_mut().ok()) {
        // What decides about a flight first.
        import.clocks.splice(0..0, motion_clocks::of(import));
    }
    let (draft, two_craft) = match draft(&read) {
        Ok(draft) => (draft.map(|draft| known.unwrap_or(draft)), None),
        Err(why) => (None, Some(why.to_string())),
    };
    let paths = free_paths(&read, options)?;
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("{}: cannot make the folder", options.out.display()))?;
    for (part, path) in parts(&read).zip(&paths) {
        report::write_atomic(path, part.flight.to_csv())?;
    }
    let vehicle = options.out.join(VEHICLE);
    // A vehicle file has been edited: measured values are not written over.
    let keeps = vehicle.exists() && !options.force;
    if let (Some(draft), false) = (&draft, keeps) {
        report::write_atomic(&vehicle, vehicle_text(draft)?)?;
    }
    let vehicle = draft.as_ref().map(|_| vehicle);
    if let Some(why) = &two_craft {
        colour::warn(&format!("no vehicle file is written: {why}"));
    }
    warn_of_flights_without_motors(&read);
    let outcome = if options.json {
        let mut document = document(&read, &paths, vehicle.as_deref(), draft.as_ref());
        document.missing.extend(two_craft);
        Outcome::json(&document)?
    } else {
        Outcome::done(import_text::of(
            &read,
            &options.out,
            vehicle.as_deref().map(|path| (path, keeps)),
            draft.as_ref(),
        ))
    };
    Ok(Outcome { refused: refused(&read), ..outcome })
}

fn read_and_named(options: &Options) -> anyhow::Result<Vec<Read>> {
    let mut read = read_logs(&options.logs, options.json)?;
    name_apart(&mut read);
    Ok(read)
}

fn parts(read: &[Read]) -> impl Iterator<Item = &Part> {
    imported(read).flat_map(|import| &import.flights)
}

/// Without motor commands and rotor speeds a flight says how the craft moved and not why: nothing can be fitted to it.
fn warn_of_flights_without_motors(read: &[Read]) {
    for import in imported(read).filter(|import| !import.flights.is_empty()) {
        if import.sources.commands.is_none() && import.sources.rotor_speed.is_none() {
            colour::warn(&format!(
                "{}: no motor commands were found in this log: identify, diagnose and explain cannot use its flights",
                import.path.display()
            ));
        }
    }
}

/// Where the flight files go, if they may.
fn free_paths(read: &[Read], options: &Options) -> anyhow::Result<Vec<PathBuf>> {
    let paths: Vec<PathBuf> = parts(read).map(|part| options.out.join(&part.flight.name)).collect();
    if let Some(there) = paths.iter().find(|path| path.exists() && !options.force) {
        anyhow::bail!(
            "{}: already exists; give --force to overwrite it, or choose another folder",
            there.display()
        );
    }
    refuse_inputs_among(&paths, read)?;
    Ok(paths)
}

/// A map of columns among the flight files would be applied to them, which need none.
fn refuse_map_in(folder: &Path) -> anyhow::Result<()> {
    let map = ColumnMap::file_beside(&folder.join(VEHICLE));
    anyhow::ensure!(
        !map.exists(),
        "{}: would be applied to the flight files that are written beside it; choose another folder for --out",
        map.display()
    );
    Ok(())
}

/// A flight file is not written over the table that it is made of.
fn refuse_inputs_among(outputs: &[PathBuf], read: &[Read]) -> anyhow::Result<()> {
    let is_input = |output: &PathBuf| {
        let Ok(output) = output.canonicalize() else { return false };
        read.iter().any(|read| read.path.canonicalize().is_ok_and(|input| input == output))
    };
    match outputs.iter().find(|output| is_input(output)) {
        Some(output) => Err(OverwritesInput(output.clone()).into()),
        None => Ok(()),
    }
}

/// The vehicle of the file beside tables, in our columns; nothing where logs tell of their craft themselves.
fn known_vehicle(read: &[Read]) -> anyhow::Result<Option<Draft>> {
    if imported(read).any(|import| !is_table(import)) {
        return Ok(None);
    }
    for read in read {
        if let Some(vehicle) = vehicle_beside(&read.path)? {
            return Ok(Some(Draft { vehicle: vehicle.with_our_columns(), missing: Vec::new() }));
        }
    }
    Ok(None)
}

/// A vehicle file without anything to measure is that of a known vehicle.
fn vehicle_text(draft: &Draft) -> anyhow::Result<String> {
    Ok(if draft.missing.is_empty() { toml::to_string(&draft.vehicle)? } else { draft.to_toml() })
}

/// Writes the maps of columns that mend what was read; whether there were any.
fn mended(read: &[Read]) -> anyhow::Result<bool> {
    let mut vehicle = draft(read)?.map(|draft| draft.vehicle);
    for read in read {
        // Its own columns are read as it says.
        vehicle = vehicle_beside(&read.path)?.or(vehicle);
    }
    let Some(vehicle) = vehicle else { return Ok(false) };
    let is_read = |read: &&Read| read.import.as_ref().is_ok_and(|import| !import.flights.is_empty());
    let paths: Vec<&PathBuf> = read.iter().filter(is_read).map(|read| &read.path).collect();
    faults::apply(&paths, &vehicle, Reading::default())
}

fn is_table(import: &Import) -> bool {
    matches!(import.format, Format::Csv | Format::Parquet)
}

/// Logs of one name in two folders give flights of two names.
fn name_apart(read: &mut [Read]) {
    let mut taken = BTreeSet::new();
    for read in read {
        let Ok(import) = &mut read.import else { continue };
        for part in &mut import.flights {
            let stem = part.flight.name.trim_end_matches(".csv").to_owned();
            let mut count = 1;
            while !taken.insert(part.flight.name.clone()) {
                count += 1;
                part.flight.name = format!("{stem}_{count}.csv");
            }
        }
    }
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    logs: Vec<LogEntry<'a>>,
    /// The vehicle file, where there is a flight.
    vehicle: Option<String>,
    /// What to measure for it.
    missing: Vec<String>,
}

#[derive(Serialize, JsonSchema)]
struct LogEntry<'a> {
    file: String,
    format: Option<logs::Format>,
    firmware: Option<&'a str>,
    /// Kinds of messages by the format's own name.
    messages: BTreeMap<&'a str, MessagesEntry>,
    /// The format's own name of what became each quantity.
    sources: Option<&'a Sources>,
    /// Every pair of clocks that stamp the same rows or see the same motion.
    clocks: &'a [ClockPair],
    flights: Vec<FlightEntry>,
    /// Times at which the craft could not write fast enough, and what they lost.
    dropouts: usize,
    dropouts_s: f64,
    /// Damage, one sentence each.
    damage: &'a [String],
    /// What this log cannot tell, one sentence each.
    limits: &'a [String],
    /// What was done to it, one sentence each.
    notes: &'a [String],
    /// Why no flight was made of it.
    refused: Option<String>,
}

#[derive(Serialize, JsonSchema)]
struct MessagesEntry {
    count: usize,
    first: Option<f64>,
    last: Option<f64>,
}

#[derive(Serialize, JsonSchema)]
struct FlightEntry {
    file: String,
    /// First and last time on the log's clock, s.
    start_s: f64,
    end_s: f64,
    rows: usize,
    rate_hz: f64,
    columns: Vec<String>,
    /// Time without rows in between, s.
    lost_s: f64,
    /// What was left out in between.
    cuts: Vec<CutEntry>,
}

#[derive(Serialize, JsonSchema)]
struct CutEntry {
    /// First and last time on the log's clock, s.
    start_s: f64,
    end_s: f64,
    /// Rows: `gap` (the log has none for more than 3.5 periods), `dropout` (the craft could not write). `position` and
    /// `attitude`: these columns only, where the estimator was not sure of them, or they jumped.
    why: Cause,
}

fn document<'a>(
    read: &'a [Read],
    paths: &[PathBuf],
    vehicle: Option<&Path>,
    draft: Option<&Draft>,
) -> Document<'a> {
    let mut paths = paths.iter();
    let logs = read.iter().map(|read| match &read.import {
        Ok(import) => entry(read, import, &mut paths),
        Err(error) => LogEntry::refused(read, error),
    });
    Document {
        logs: logs.collect(),
        vehicle: vehicle.map(|path| path.display().to_string()),
        missing: draft.map_or(Vec::new(), |draft| {
            draft.missing.iter().map(|(field, how)| format!("{field}: {how}")).collect()
        }),
    }
}

fn entry<'a>(read: &Read, import: &'a Import, paths: &mut std::slice::Iter<'_, PathBuf>) -> LogEntry<'a> {
    let messages = import.messages.iter().map(|messages| {
        let [first, last] = messages.first_last.map_or([None; 2], |ends| ends.map(Some));
        (messages.name.as_str(), MessagesEntry { count: messages.count, first, last })
    });
    let flights = import.flights.iter().zip(paths).map(|(part, path)| FlightEntry {
        file: path.display().to_string(),
        start_s: part.span[0],
        end_s: part.span[1],
        rows: part.flight.len(),
        rate_hz: part.rate_hz,
        columns: part.flight.logged_columns().map(ToOwned::to_owned).collect(),
        lost_s: part.lost_s,
        cuts: part
            .cuts
            .iter()
            .map(|cut| CutEntry { start_s: cut.span[0], end_s: cut.span[1], why: cut.why })
            .collect(),
    });
    LogEntry {
        file: read.path.display().to_string(),
        format: Some(import.format),
        firmware: import.firmware.as_deref(),
        messages: messages.collect(),
        sources: Some(&import.sources),
        clocks: &import.clocks,
        flights: flights.collect(),
        dropouts: import.losses.dropouts,
        dropouts_s: import.losses.dropouts_s,
        damage: &import.losses.damage,
        limits: &import.limits,
        notes: &import.notes,
        refused: import
            .flights
            .is_empty()
            .then(|| "nothing in it is long enough in the air to be a flight".into()),
    }
}

impl LogEntry<'_> {
    fn refused(read: &Read, error: &logs::LogError) -> Self {
        Self {
            file: read.path.display().to_string(),
            format: logs::format_of(&read.path),
            firmware: None,
            messages: BTreeMap::new(),
            sources: None,
            clocks: &[],
            flights: Vec::new(),
            dropouts: 0,
            dropouts_s: 0.0,
            damage: &[],
            limits: &[],
            notes: &[],
            refused: Some(error.to_string()),
        }
    }
}
