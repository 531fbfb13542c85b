//! Maps of columns that mend flights with wrong axes, signs, units or motor orders: found, tried, and handed over to be written.
//!
//! Flights of one folder share its `columns.toml`, so they are mended alike or not at all. A map is handed over only when the
//! flights, read through it, have none of these faults left.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use flights::{Column, ColumnMap, Flight, FlightError, Mend, MendedColumn, Source, header_names};
use model::Vehicle;
use sysid::{Fault, FaultKind, Severity};

use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::{Reading, bytes_of};

/// Faults that hide one another: a motor order is looked at in right frames only, an accelerometer once the tracker is right.
const MOST_ROUNDS: usize = 4;

/// A map of columns to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct MapToWrite {
    /// `columns.toml` beside the flights.
    pub file: PathBuf,
    /// Its whole text.
    pub text: String,
    /// The lines that are new: `[columns] q = "-q"`.
    pub lines: Vec<String>,
}

/// The maps that mend flights; none where nothing is wrong.
pub fn mends(
    paths: &[&PathBuf],
    vehicle: &Vehicle,
    reading: Reading,
) -> Result<Vec<MapToWrite>, WorkflowError> {
    let mut folders: BTreeMap<PathBuf, Vec<&Path>> = BTreeMap::new();
    for path in paths {
        if path.as_path() == Path::new(logs::STANDARD_INPUT) {
            continue;
        }
        match logs::format_of(path) {
            Some(_) => refuse_faulty_log(path, vehicle, reading)?,
            None => folders.entry(ColumnMap::file_beside(path)).or_default().push(path),
        }
    }
    let mended = folders.into_iter().map(|(file, paths)| of_folder(&file, &paths, vehicle, reading));
    mended.filter_map(Result::transpose).collect()
}

/// Formats say which column is which: what is wrong in a log cannot be the naming of its columns.
fn refuse_faulty_log(path: &Path, vehicle: &Vehicle, reading: Reading) -> Result<(), WorkflowError> {
    for part in logs::import(path, &ColumnMap::of_flight(path, vehicle)?)?.flights {
        let flight = part.flight.completed(path)?;
        if let Some(fault) = fault_of(&flight, vehicle, reading, path)? {
            return Err(cannot(
                path,
                &fault,
                "it fixes flight files only; quadlab import makes them from this log",
            ));
        }
    }
    Ok(())
}

fn of_folder(
    file: &Path,
    paths: &[&Path],
    vehicle: &Vehicle,
    reading: Reading,
) -> Result<Option<MapToWrite>, WorkflowError> {
    let before = ColumnMap::of_flight(paths[0], vehicle)?;
    let mut map = before.clone();
    for _ in 0..MOST_ROUNDS {
        let Some(wrong) = first_fault(paths, &map, vehicle, reading)? else { break };
        let Some(mend) = &wrong.fault.mend else {
            return Err(cannot(wrong.path, &wrong.fault, "columns.toml cannot express the fix"));
        };
        let mend = with_velocity(mend, &wrong.flight);
        let refuse = |why: String| cannot(wrong.path, &wrong.fault, &format!("{} {why}", file.display()));
        let sources = sources_of(wrong.path, &map)?;
        for other in paths {
            if sources_of(other, &map)? != sources {
                let why = format!("would not suit {}: it has other columns", other.display());
                return Err(refuse(why));
            }
        }
        // What has been mended once is not mended back: then the flights do not need the same.
        map = map.mended(&mend, &sources).map_err(|_| match before.mended(&mend, &sources) {
            Err(why) => refuse(why),
            Ok(_) => refuse(
                "cannot suit all of these flights; put those that need another map into another folder"
                    .into(),
            ),
        })?;
    }
    if map == before {
        return Ok(None);
    }
    if let Some(wrong) = first_fault(paths, &map, vehicle, reading)? {
        return Err(cannot(wrong.path, &wrong.fault, "columns.toml alone cannot correct it"));
    }
    let old = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
        Err(source) => return Err(FlightError::Read { path: file.into(), source }.into()),
    };
    let lines = map.lines_beyond(&before);
    match map.written_into(&old) {
        Some(text) => Ok(Some(MapToWrite { file: file.into(), text, lines })),
        None => Err(WorkflowError::CannotMend {
            path: file.into(),
            fault: format!("these lines are missing: {}", lines.join("; ")),
            why: "the file is written in a way that is not edited; add them by hand".into(),
        }),
    }
}

/// A flight with its fault.
struct Wrong<'a> {
    path: &'a Path,
    flight: Flight,
    fault: Fault,
}

fn first_fault<'a>(
    paths: &[&'a Path],
    map: &ColumnMap,
    vehicle: &Vehicle,
    reading: Reading,
) -> Result<Option<Wrong<'a>>, WorkflowError> {
    for &path in paths {
        let flight = Flight::parse_with(&bytes_of(path)?, path, map)?;
        if let Some(fault) = fault_of(&flight, vehicle, reading, path)? {
            return Ok(Some(Wrong { path, flight, fault }));
        }
    }
    Ok(None)
}

/// Wrong frames or motors of a flight.
fn fault_of(
    flight: &Flight,
    vehicle: &Vehicle,
    reading: Reading,
    path: &Path,
) -> Result<Option<Fault>, WorkflowError> {
    flight.check_against(vehicle, path)?;
    let parts = reading.parts(Some(path))?;
    let examined = sysid::examine_parts(flight, vehicle, &parts)
        .map_err(|why| WorkflowError::Unusable { path: path.into(), why })?;
    let is_one = |fault: &Fault| {
        let kinds = [FaultKind::WrongFrame, FaultKind::WrongMotors];
        fault.severity == Severity::Refused && kinds.contains(&fault.kind)
    };
    Ok(examined.faults.into_iter().find(is_one))
}

fn sources_of(path: &Path, map: &ColumnMap) -> Result<BTreeMap<String, Source>, WorkflowError> {
    Ok(map.sources_in(&header_names(&bytes_of(path)?), path)?)
}

fn cannot(path: &Path, fault: &Fault, why: &str) -> WorkflowError {
    WorkflowError::CannotMend { path: path.into(), fault: fault.sentence.clone(), why: why.into() }
}

/// A velocity that is that of the position as logged is in its axes and its unit, and is mended with it.
fn with_velocity(mend: &Mend, flight: &Flight) -> Mend {
    use Column::{Vx, Vy, Vz, X, Y, Z};
    let Mend::Columns(columns) = mend else { return mend.clone() };
    let velocity = |column: Column| [X, Y, Z].iter().position(|own| *own == column).map(|i| [Vx, Vy, Vz][i]);
    let moved: Option<Vec<MendedColumn>> = columns
        .iter()
        .map(|c| Some(MendedColumn::new(velocity(c.own)?, velocity(c.from)?, c.scale, c.offset)))
        .collect();
    match moved {
        Some(moved) if is_of_position(flight) => Mend::Columns([&columns[..], &moved].concat()),
        _ => mend.clone(),
    }
}

/// Whether the logged velocity is the slope of the logged position.
fn is_of_position(flight: &Flight) -> bool {
    let position = flight.group([Column::X, Column::Y, Column::Z]);
    let velocity = flight.group([Column::Vx, Column::Vy, Column::Vz]);
    let (Some(position), Some(velocity)) = (position, velocity) else { return false };
    let t = flight.required(Column::T);
    let (mut product, mut square) = (0.0, 0.0);
    for (x, v) in position.iter().zip(velocity) {
        for k in 1..t.len() {
            let slope = (x[k] - x[k - 1]) / (t[k] - t[k - 1]);
            if slope.is_finite() && v[k].is_finite() {
                product += slope * v[k];
                square += v[k] * v[k];
            }
        }
    }
    // Noise of the position makes its slope uncertain, and not its product with the velocity.
    (0.5..2.0).contains(&(product / square))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, fly, truth};

    /// A folder with flights of which some columns are written with the other sign.
    fn folder(turned: &[&[Column]]) -> (tempfile::TempDir, Vec<PathBuf>) {
        let folder = tempfile::tempdir().unwrap();
        let write = |(seed, columns): (usize, &&[Column])| {
            let mut flight = fly(&truth(), seed as u64 + 1, 12.0, &ORDINARY);
            for column in *columns {
                let values = flight.required(*column).iter().map(|value| -value).collect();
                flight.replace(*column, values);
            }
            let path = folder.path().join(format!("{seed}.csv"));
            std::fs::write(&path, flight.to_csv()).unwrap();
            path
        };
        let paths = turned.iter().enumerate().map(write).collect();
        (folder, paths)
    }

    fn found(paths: &[PathBuf]) -> Result<Vec<MapToWrite>, String> {
        let paths: Vec<&PathBuf> = paths.iter().collect();
        mends(&paths, &truth().vehicle, Reading::default()).map_err(|why| why.to_string())
    }

    #[test]
    fn flights_that_are_right_need_no_map() {
        assert_eq!(found(&folder(&[&[]]).1).unwrap(), []);
    }

    #[test]
    fn flights_with_one_fault_are_mended_together() {
        let (folder, paths) = folder(&[&[Column::Y], &[Column::Y]]);
        let [map] = &found(&paths).unwrap()[..] else { panic!("one map") };
        assert_eq!(map.file, folder.path().join("columns.toml"));
        assert_eq!(map.text, "[columns]\ny = \"-y\"\n");
        assert_eq!(map.lines, ["[columns] y = \"-y\""]);
    }

    #[test]
    fn flights_of_one_folder_that_need_different_maps_are_refused() {
        let why = found(&folder(&[&[Column::Y], &[]]).1).unwrap_err();
        assert!(why.contains("put those that need another map into another folder"), "{why}");
        assert_eq!(why.lines().count(), 1);
    }

    #[test]
    fn a_map_that_says_something_else_is_left_alone() {
        let (folder, paths) = folder(&[&[Column::Y]]);
        std::fs::write(folder.path().join("columns.toml"), "[columns]\ny = \"y\"\n").unwrap();
        let why = found(&paths).unwrap_err();
        assert!(why.contains("columns.toml says something else about y already"), "{why}");
    }
}
