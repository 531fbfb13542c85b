//! Logs of other programs as they are named on the command line.

use std::path::{Path, PathBuf};

use diagnosis::workflow::{Observer, import_log};
use flights::ColumnMap;
use logs::{Draft, Format, Import, LogError};
use model::Vehicle;

use crate::cli::flights::files;
use crate::cli::model_files::{VEHICLE, read_vehicle};
use crate::cli::terminal::Terminal;

/// What became of a log.
pub(crate) struct Read {
    pub(crate) path: PathBuf,
    pub(crate) import: Result<Import, LogError>,
}

/// Reads logs; each that is refused with its reason.
pub(crate) fn read_logs(named: &[PathBuf], json: bool) -> anyhow::Result<Vec<Read>> {
    let paths = files(named)?;
    let terminal = Terminal::new(json);
    let mut read = Vec::new();
    for path in &paths {
        read.push(Read { path: path.clone(), import: import(path, &terminal)? });
    }
    terminal.clear();
    Ok(read)
}

/// A log; a table of another program through the map of columns beside it, else that of the vehicle file beside it.
pub(crate) fn import(path: &Path, observer: &dyn Observer) -> anyhow::Result<Result<Import, LogError>> {
    let map = match vehicle_beside(path)? {
        Some(vehicle) => ColumnMap::of_flight(path, &vehicle)?,
        None => ColumnMap::beside(path)?,
    };
    Ok(import_log(path, &map, observer))
}

/// The vehicle file beside a table of another program; logs tell of their craft themselves.
pub(crate) fn vehicle_beside(path: &Path) -> anyhow::Result<Option<Vehicle>> {
    let file = path.with_file_name(VEHICLE);
    let is_table = matches!(logs::format_of(path), None | Some(Format::Parquet | Format::Csv));
    Ok(if is_table && file.is_file() { Some(read_vehicle(&file)?) } else { None })
}

/// The logs that were read.
pub(crate) fn imported(read: &[Read]) -> impl Iterator<Item = &Import> {
    read.iter().filter_map(|read| read.import.as_ref().ok())
}

/// Why logs were refused, one line each.
pub(crate) fn refused(read: &[Read]) -> Vec<String> {
    read.iter().filter_map(|read| read.import.as_ref().err()).map(ToString::to_string).collect()
}

/// The vehicle file of the craft that wrote them.
pub(crate) fn draft(read: &[Read]) -> anyhow::Result<Option<Draft>> {
    let all: Vec<Import> = imported(read).cloned().collect();
    logs::draft(&all).map_err(anyhow::Error::msg)
}
