//! Logs of other programs as they are named on the command line.

use std::path::PathBuf;

use diagnosis::workflow::import_log;
use logs::{Draft, Import};

use crate::cli::flights::{Kind, named_files};
use crate::cli::terminal::Terminal;

/// What became of a log.
pub(crate) struct Read {
    pub(crate) path: PathBuf,
    pub(crate) import: Result<Import, logs::LogError>,
}

/// Reads logs; each that is refused with its reason.
pub(crate) fn read_logs(named: &[PathBuf], json: bool) -> anyhow::Result<Vec<Read>> {
    let paths = named_files(named, Kind::Logs)?;
    let terminal = Terminal::new(json);
    let mut read = Vec::new();
    for path in &paths {
        read.push(Read { path: path.clone(), import: import_log(path, &terminal) });
    }
    terminal.clear();
    Ok(read)
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
