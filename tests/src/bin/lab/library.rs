//! What regressions choose from, written for other people's programs (`tests/peers/compare.py`).
//!
//! A folder a trial: `library.json` says what was hidden, what was found and which columns there
//! are; `library.f64` holds, for each flight and axis, the target and the columns, little-endian
//! numbers of eight bytes.

use std::path::Path;

use anyhow::Context;
use diagnosis::planning::library::{Library, library};
use model::Effect;
use rayon::prelude::*;
use serde::Serialize;
use stories::world::Pattern;
use sysid::{Prepared, fit};

use crate::plan::Hidden;
use crate::trial::{Outcome, fly};

#[derive(Serialize)]
struct About {
    group: &'static str,
    hidden: Vec<&'static str>,
    found: Vec<String>,
    coefficients: Vec<Column>,
    /// Indices of the coefficients that act on each axis, in the order of their columns.
    columns: Vec<Vec<usize>>,
    flights: Vec<Rows>,
}

#[derive(Serialize)]
struct Column {
    effect: &'static str,
    name: &'static str,
    unit: &'static str,
    basic: bool,
}

#[derive(Serialize)]
struct Rows {
    role: &'static str,
    rows: usize,
}

/// Writes the libraries of all trials but those of changes and conditions, which ask other questions.
pub(crate) fn write(folder: &Path, outcomes: &[Outcome]) -> anyhow::Result<()> {
    let asks = |o: &&Outcome| o.trial.condition.is_none() && !matches!(o.trial.hidden, Hidden::Change(_));
    outcomes.par_iter().filter(asks).try_for_each(|outcome| {
        let folder = folder.join(outcome.trial.folder_name());
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("{}: cannot create the folder", folder.display()))?;
        let (about, values) = contents(outcome)
            .map_err(anyhow::Error::msg)
            .with_context(|| format!("{}: no library", folder.display()))?;
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        report::write_atomic(folder.join("library.f64"), bytes)?;
        report::write_atomic(folder.join("library.json"), serde_json::to_string_pretty(&about)?)?;
        Ok(())
    })
}

fn contents(outcome: &Outcome) -> Result<(About, Vec<f64>), String> {
    let (world, flights) = fly(&outcome.trial)?;
    let prepared: Vec<Prepared> = flights
        .iter()
        .map(|flight| Prepared::new(flight, &world.vehicle).map_err(|error| error.to_string()))
        .collect::<Result<_, _>>()?;
    let all: Vec<&Prepared> = prepared.iter().collect();
    let (train, _) = all.split_at(Pattern::TRAIN.len());
    let basic: Vec<Effect> = Effect::basic().collect();
    let model = fit(train, &world.vehicle, &basic, None).map_err(|error| error.to_string())?.model;
    let libraries: Vec<_> = all.iter().map(|flight| library(&model, flight)).collect();
    let first = &libraries[0];
    let columns: Vec<Vec<usize>> = (0..6)
        .map(|axis| {
            let acts = |k: &usize| libraries.iter().any(|l| l.columns[*k][axis].is_some());
            (0..first.columns.len()).filter(acts).collect()
        })
        .collect();
    let values = values(&libraries, &columns);
    let rows = libraries.iter().enumerate().map(|(index, library)| Rows {
        role: if index < Pattern::TRAIN.len() { "train" } else { "validate" },
        rows: library.targets[0].len(),
    });
    let names = first.names.iter().map(|column| {
        let info = column.effect.info();
        let coefficient = &info.coefficients[column.coefficient];
        Column {
            effect: info.id,
            name: coefficient.name,
            unit: coefficient.unit,
            basic: model.has(column.effect),
        }
    });
    let about = About {
        group: group(&outcome.trial.hidden),
        hidden: outcome.trial.planted().into_iter().map(|(id, _)| id).collect(),
        found: outcome.found.iter().map(|id| (*id).to_owned()).collect(),
        coefficients: names.collect(),
        columns,
        flights: rows.collect(),
    };
    Ok((about, values))
}

/// Targets and columns of each flight and axis, one after the other; a column that does not act is
/// zero.
fn values(libraries: &[Library], columns: &[Vec<usize>]) -> Vec<f64> {
    let mut values = Vec::new();
    for library in libraries {
        for (axis, columns) in columns.iter().enumerate() {
            values.extend(&library.targets[axis]);
            for &k in columns {
                match &library.columns[k][axis] {
                    Some(column) => values.extend(column),
                    None => values.extend(std::iter::repeat_n(0.0, library.targets[axis].len())),
                }
            }
        }
    }
    values
}

fn group(hidden: &Hidden) -> &'static str {
    match hidden {
        Hidden::Nothing => "nothing",
        Hidden::One(_) => "single",
        Hidden::Together(effects) if effects.len() == 2 => "pair",
        Hidden::Together(_) => "several",
        Hidden::Beside(_) => "beside",
        Hidden::Outside(_) => "outside",
        Hidden::Change(_) => "change",
    }
}
