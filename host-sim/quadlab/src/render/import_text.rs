//! What an import found and made, for people.

use std::path::Path;

use logs::{Cause, ClockPair, Draft, Import};
use report::number::{fixed, value_and_error};
use report::significant;

use crate::cli::logs::Read;
use crate::render::counted;
use crate::render::grid::{Grid, number, text};
use crate::render::tables;

/// All logs with what became of them, and what is still to be measured. `vehicle` is the file, and whether it was there before.
pub(crate) fn of(read: &[Read], out: &Path, vehicle: Option<(&Path, bool)>, draft: Option<&Draft>) -> String {
    let mut said = String::new();
    for read in read {
        if let Ok(import) = &read.import {
            said.push_str(&log(import));
        }
    }
    match (vehicle, draft) {
        (Some((path, true)), _) => {
            said.push_str(&format!("{} was there before and is left as it is\n", path.display()));
        }
        (Some((path, false)), Some(draft)) => {
            said.push_str(&format!("{}vehicle file written to {}\n", to_measure(draft), path.display()));
        }
        _ => {}
    }
    let flights: usize =
        read.iter().filter_map(|read| read.import.as_ref().ok()).map(|i| i.flights.len()).sum();
    let plural = if flights == 1 { "" } else { "s" };
    said.push_str(&format!("{flights} flight file{plural} written to {}\n", out.display()));
    said
}

fn log(import: &Import) -> String {
    let rows: usize = import.messages.iter().map(|messages| messages.count).sum();
    let firmware = import.firmware.as_deref().map_or(String::new(), |firmware| format!(", {firmware}"));
    let mut said = format!(
        "{}: {}{firmware}, {} of {} of messages\n",
        import.path.display(),
        import.format.name(),
        counted(rows, "row"),
        counted(import.messages.len(), "kind")
    );
    let mut sources = Grid::new("quantities", [text("quantity"), text("from")]);
    for (name, source) in [
        ("position", &import.sources.position),
        ("attitude", &import.sources.attitude),
        ("rates", &import.sources.rates),
        ("specific force", &import.sources.specific_force),
        ("motor commands", &import.sources.commands),
        ("rotor speeds", &import.sources.rotor_speed),
        ("voltage", &import.sources.voltage),
    ] {
        sources.push([name.to_owned(), source.clone().unwrap_or_else(|| "not logged".into())]);
    }
    said.push_str(&format!("\n{}\n", sources.to_text()));
    let mut flights = Grid::new(
        "flights",
        [
            text("file"),
            number("from", "s"),
            number("to", "s"),
            number("rows", ""),
            number("rate", "Hz"),
            number("lost", "s"),
        ],
    );
    for part in &import.flights {
        flights.push([
            part.flight.name.clone(),
            fixed(part.span[0], 2),
            fixed(part.span[1], 2),
            part.flight.len().to_string(),
            fixed(part.rate_hz, 1),
            fixed(part.lost_s, 2),
        ]);
    }
    for grid in [flights, cuts(import), clocks(import)].iter().filter(|grid| grid.has_rows()) {
        said.push_str(&format!("{}\n", grid.to_text()));
    }
    let dropouts = (import.losses.dropouts > 0).then(|| {
        format!("{} dropouts, {} s lost", import.losses.dropouts, fixed(import.losses.dropouts_s, 2))
    });
    let sentences = dropouts.iter().chain(&import.losses.damage).chain(&import.notes).chain(&import.limits);
    for sentence in sentences {
        said.push_str(&format!("{}\n", tables::paragraph(&format!("- {sentence}"))));
    }
    said.push('\n');
    said
}

/// What was left out of the flights: the longest stretches one by one, the rest of each kind together.
fn cuts(import: &Import) -> Grid {
    const SHOWN: usize = 5;
    let mut grid = Grid::new("cut out", [text("file"), text("what"), number("time", "s"), text("when (s)")]);
    for part in &import.flights {
        for (why, what) in [
            (Cause::Dropout, "rows (the craft could not write)"),
            (Cause::Gap, "rows (missing in the log)"),
            (Cause::Position, "position, velocity (not trusted)"),
            (Cause::Attitude, "attitude (not trusted)"),
        ] {
            let mut spans: Vec<[f64; 2]> =
                part.cuts.iter().filter(|cut| cut.why == why).map(|cut| cut.span).collect();
            if spans.is_empty() {
                continue;
            }
            let all_s: f64 = spans.iter().map(|[from, to]| to - from).sum();
            spans.sort_by(|a, b| (b[1] - b[0]).total_cmp(&(a[1] - a[0])));
            let more = spans.len().saturating_sub(SHOWN);
            spans.truncate(SHOWN);
            spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let shown = spans.iter().map(|[from, to]| format!("{} to {}", fixed(*from, 2), fixed(*to, 2)));
            let further = (more > 0).then(|| format!("{more} shorter ones"));
            let when = shown.chain(further).collect::<Vec<_>>().join(", ");
            grid.push([part.flight.name.clone(), what.into(), fixed(all_s, 2), when]);
        }
    }
    grid
}

/// Pairs of the same two clocks beyond which they are told together.
const PAIRS_SHOWN: usize = 3;

/// Every pair of clocks; those that stamp many kinds of messages in one row, from the least to the greatest offset.
fn clocks(import: &Import) -> Grid {
    let mut grid = Grid::new(
        "clocks (offset: how far the first is ahead of the second in the middle of the log; skew: how much faster it runs)",
        [
            text("rows of"),
            text("clock"),
            text("against"),
            number("offset", "ms"),
            number("±", "ms"),
            number("skew", "ppm"),
            number("±", "ppm"),
            number("scatter", "ms"),
        ],
    );
    let mut groups: Vec<Vec<&ClockPair>> = Vec::new();
    for pair in &import.clocks {
        let of_same = |group: &&mut Vec<&ClockPair>| {
            (&group[0].clock, &group[0].reference) == (&pair.clock, &pair.reference)
        };
        match groups.iter_mut().find(of_same) {
            Some(group) => group.push(pair),
            None => groups.push(vec![pair]),
        }
    }
    for group in groups {
        if group.len() > PAIRS_SHOWN {
            grid.push(together(&group));
        } else {
            group.iter().for_each(|pair| grid.push(one(pair)));
        }
    }
    grid
}

fn one(pair: &ClockPair) -> [String; 8] {
    let [offset, offset_error] = offset(pair.offset_ms, pair.offset_std_error_ms);
    let [skew, skew_error] = match pair.skew_ppm {
        Some(skew) => value_and_error(skew, pair.skew_std_error_ppm),
        None => ["-", "-"].map(Into::into),
    };
    let scatter = pair.scatter_ms.map_or("-".into(), |scatter| significant(scatter, 2));
    let (of, clock, reference) = (pair.of.clone(), pair.clock.clone(), pair.reference.clone());
    [of, clock, reference, offset, offset_error, skew, skew_error, scatter]
}

/// Ranges over several pairs of the same two clocks.
fn together(group: &[&ClockPair]) -> [String; 8] {
    let range = |of: &dyn Fn(&ClockPair) -> Option<f64>, decimals: usize| {
        let values = || group.iter().filter_map(|pair| of(pair));
        let (least, most) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        if least > most {
            "-".into()
        } else {
            format!("{} to {}", fixed(least, decimals), fixed(most, decimals))
        }
    };
    let of = format!("{} kinds of messages", group.len());
    let (clock, reference) = (group[0].clock.clone(), group[0].reference.clone());
    let (offset, skew) = (range(&|pair| Some(pair.offset_ms), 2), range(&|pair| pair.skew_ppm, 0));
    [of, clock, reference, offset, "-".into(), skew, "-".into(), range(&|pair| pair.scatter_ms, 2)]
}

/// An offset and its error in ms: written out, for offsets from UTC have thirteen digits before the point.
fn offset(offset_ms: f64, error_ms: Option<f64>) -> [String; 2] {
    let Some(error_ms) = error_ms.filter(|error| *error > 0.0) else {
        return [fixed(offset_ms, 3), "-".into()];
    };
    let decimals = (1.0 - error_ms.log10().floor()).clamp(0.0, 6.0) as usize;
    [fixed(offset_ms, decimals), fixed(error_ms, decimals)]
}

/// What must be measured, for people.
pub(crate) fn to_measure(draft: &Draft) -> String {
    if draft.missing.is_empty() {
        return String::new();
    }
    let mut text = String::from("To be measured, and written into the vehicle file:\n");
    for (field, how) in &draft.missing {
        let lines = tables::wrap(&format!("{field}: {how}"), 94);
        for (index, line) in lines.iter().enumerate() {
            let indent = if index == 0 { "  " } else { "    " };
            text.push_str(&format!("{indent}{line}\n"));
        }
    }
    text
}
