//! Passes until no reference is from both sides of a change: with a new one, flights are read again.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use diagnosis::workflow::Observer;

use crate::error::FleetError;
use crate::index::Index;
use crate::layout::Fleet;
use crate::pass::{Indexed, PassOptions, parts_folder, references, save, take_parts, update};
use crate::sides;

/// How often references are made anew at most: each time, what changed and when comes out a little otherwise.
const ROUNDS: usize = 3;

/// Brings the index of a fleet up to date.
pub fn pass(
    fleet: &Fleet,
    path: &Path,
    options: PassOptions,
    observer: &dyn Observer,
) -> Result<Indexed, FleetError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|why| FleetError::write(folder, why))?;
    let mut index = Index::read(path)?.unwrap_or_default();
    let state = |index: &Index| (index.rows.len(), index.references.clone(), index.judged.clone());
    let mut before = state(&index);
    take_parts(&mut index, path)?;
    let references = references(fleet, &mut index, path, options, observer)?;
    let mut indexed = Indexed { index, references, read: 0, read_mb: 0.0, gone: Vec::new() };
    let mut files = BTreeSet::new();
    for round in 0..=ROUNDS {
        let options = if round == 0 { options } else { PassOptions::default() };
        let changed = update(fleet, &mut indexed, &mut files, path, (options, observer))?;
        let settled = match round {
            ROUNDS => Ok(false),
            _ => sides::settle(fleet, &mut indexed, observer),
        };
        if changed || before != state(&indexed.index) || !path.exists() {
            save(&indexed.index, &indexed.references, &BTreeMap::new(), path)?;
            before = state(&indexed.index);
        }
        let parts = parts_folder(path);
        if parts.exists() {
            std::fs::remove_dir_all(&parts).map_err(|why| FleetError::write(&parts, why))?;
        }
        if !settled? {
            break;
        }
    }
    indexed.read = files.len();
    Ok(indexed)
}
