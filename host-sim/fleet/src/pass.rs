//! A pass over the files: what is new is read, all else is kept.
//!
//! A file counts as known if its size and time of change are those that were kept, or else its content is; and if all that its row
//! depends on beside it is as it was. New files are read side by side, a batch at a time, and each batch is written as a part
//! beside the index, whole or not at all: a pass that is stopped or killed goes on from there, and ends with the same bytes.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::UNIX_EPOCH;

use diagnosis::workflow::{Observer, Progress, sha256};
use rayon::prelude::*;
use serde_json::Value;

use crate::error::FleetError;
use crate::index::{Index, KeptReference};
use crate::layout::{Craft, Fleet, PARTS};
use crate::reference::{Reference, context};
use crate::row::{Row, State};

/// Files between one part and the next: what is read again at most after a kill.
const BATCH: usize = 32;

/// How a pass is made.
#[derive(Debug, Clone, Copy, Default)]
pub struct PassOptions {
    /// Hash every file, whatever its size and time say.
    pub verify: bool,
    /// Make the reference models anew.
    pub refresh: bool,
    /// Forget flights whose files are gone.
    pub forget: bool,
}

/// An index that is up to date.
pub struct Indexed {
    /// What is kept.
    pub index: Index,
    /// The reference of each craft that has one.
    pub references: BTreeMap<String, Reference>,
    /// Files that were read now.
    pub read: usize,
    /// Megabytes of them.
    pub read_mb: f64,
    /// Files that are gone; their flights are still known.
    pub gone: Vec<String>,
}

/// A file as it lies there.
struct Found<'a> {
    craft: &'a Craft,
    path: &'a Path,
    file: String,
    bytes: u64,
    changed_ns: i64,
    context: String,
}

/// Where the parts of a pass lie until it is done.
pub(crate) fn parts_folder(index: &Path) -> PathBuf {
    index.with_extension(PARTS)
}

/// Reads what is new, with the references as they are. Whether any row is new.
pub(crate) fn update(
    fleet: &Fleet,
    indexed: &mut Indexed,
    files: &mut BTreeSet<String>,
    path: &Path,
    (options, observer): (PassOptions, &dyn Observer),
) -> Result<bool, FleetError> {
    let Indexed { index, references, .. } = indexed;
    let found = found(fleet, references)?;
    let mut known: BTreeMap<(String, String), Vec<Row>> = BTreeMap::new();
    for row in std::mem::take(&mut index.rows) {
        known.entry((row.craft.clone(), row.file.clone())).or_default().push(row);
    }
    let is_current = |own: &Found<'_>, rows: &Vec<Row>| {
        rows.iter().all(|row| {
            row.context == own.context && row.bytes == own.bytes && row.changed_ns == own.changed_ns
        })
    };
    let key = |own: &Found<'_>| (own.craft.name.clone(), own.file.clone());
    let is_known =
        |own: &Found<'_>| !options.verify && known.get(&key(own)).is_some_and(|rows| is_current(own, rows));
    let new: Vec<&Found<'_>> = found.iter().filter(|own| !is_known(own)).collect();
    let content = |(key, rows): (&(String, String), &Vec<Row>)| {
        Some(((key.0.clone(), rows.first()?.sha256.clone()), key.clone()))
    };
    let contents = known.iter().filter_map(content).collect();
    let mut reader = Reader { references, known, contents, read: Mutex::default(), mb: 0.0 };
    let changed = reader.read(&new, index, path, observer)?;
    let Reader { mut known, read, mb, .. } = reader;
    let gone = gone(fleet, &found, &mut known, options);
    index.rows = known.into_values().flatten().collect();
    index.rows.sort_by(|a, b| a.place().cmp(&b.place()));
    files.extend(read.into_inner().unwrap_or_default());
    indexed.read_mb += mb;
    indexed.gone = gone;
    Ok(changed)
}

/// Writes the index whole.
pub(crate) fn save(
    index: &Index,
    references: &BTreeMap<String, Reference>,
    more_causes: &BTreeMap<String, Value>,
    path: &Path,
) -> Result<(), FleetError> {
    let bytes = index.encode(references, more_causes).map_err(|why| FleetError::write(path, why))?;
    report::write_atomic(path, bytes).map_err(|why| FleetError::write(path, why))
}

/// Takes in what an earlier pass read before it was stopped.
pub(crate) fn take_parts(index: &mut Index, path: &Path) -> Result<(), FleetError> {
    let Ok(entries) = std::fs::read_dir(parts_folder(path)) else { return Ok(()) };
    let mut parts: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    parts.sort();
    for part in parts.iter().filter(|part| part.extension().is_some_and(|ending| ending == "parquet")) {
        let Ok(Some(part)) = Index::read(part) else { continue };
        let is_again =
            |row: &Row| part.rows.iter().any(|new| (&new.craft, &new.file) == (&row.craft, &row.file));
        index.rows.retain(|row| !is_again(row));
        index.rows.extend(part.rows);
        index.references.extend(part.references);
    }
    Ok(())
}

/// The reference of each craft: the user's, that which is kept, or a new one.
pub(crate) fn references(
    fleet: &Fleet,
    index: &mut Index,
    path: &Path,
    options: PassOptions,
    observer: &dyn Observer,
) -> Result<BTreeMap<String, Reference>, FleetError> {
    let mut all = BTreeMap::new();
    for craft in &fleet.crafts {
        let vehicle_sha256 = sha256(&craft.vehicle_bytes);
        let kept = index.references.get(&craft.name).filter(|kept| {
            let is_of_same = kept.vehicle_sha256 == vehicle_sha256 && !kept.is_given;
            // A craft that had too few flights may have enough of them now.
            is_of_same && !options.refresh && !kept.model.is_empty()
        });
        let own = match (&craft.model, kept) {
            (Some((_, model)), _) => {
                KeptReference { model: model.to_toml(), why: String::new(), vehicle_sha256, is_given: true }
            }
            (None, Some(kept)) => kept.clone(),
            (None, None) => {
                let made = Reference::identified(fleet, craft, None, observer);
                if observer.is_cancelled() {
                    return Err(FleetError::Cancelled);
                }
                let (model, why) = match made {
                    Ok(text) => (text, String::new()),
                    Err(why) => (String::new(), why),
                };
                KeptReference { model, why, vehicle_sha256, is_given: false }
            }
        };
        if !own.model.is_empty() {
            let origin = craft.model.as_ref().map_or(path, |(path, _)| path);
            all.insert(craft.name.clone(), Reference::of_text(&own.model, craft, origin)?);
        }
        index.references.insert(craft.name.clone(), own);
    }
    Ok(all)
}

/// The files that are there.
fn found<'a>(
    fleet: &'a Fleet,
    references: &BTreeMap<String, Reference>,
) -> Result<Vec<Found<'a>>, FleetError> {
    let mut all = Vec::new();
    for craft in &fleet.crafts {
        let of_craft = match references.get(&craft.name) {
            Some(reference) => reference.context.clone(),
            None => context(craft, "no model"),
        };
        for path in &craft.files {
            let file = fleet.relative(path);
            if fleet.settings.excludes(&file) {
                continue;
            }
            // A file that vanished since the folder was read is as good as gone.
            let Ok(about) = std::fs::metadata(path) else { continue };
            let changed = about.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
            let changed_ns = changed.map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(i64::MAX));
            let context = match beside(path) {
                text if text.is_empty() => of_craft.clone(),
                text => sha256(format!("{of_craft}\n{text}").as_bytes()),
            };
            all.push(Found { craft, path, file, bytes: about.len(), changed_ns, context });
        }
    }
    Ok(all)
}

/// The texts of the files beside a flight that say how to read it: names of columns, and parts to use.
fn beside(path: &Path) -> String {
    let mut text = String::new();
    for file in [flights::ColumnMap::file_beside(path), flights::parts_file(path)] {
        if let Ok(own) = std::fs::read_to_string(file) {
            text.push_str(&own);
            text.push('\n');
        }
    }
    text
}

/// What is gone, moved files aside; forgotten, where that is asked for. Files that are excluded for now are not gone, and what was read of
/// them stays for when they are not.
fn gone(
    fleet: &Fleet,
    found: &[Found<'_>],
    known: &mut BTreeMap<(String, String), Vec<Row>>,
    options: PassOptions,
) -> Vec<String> {
    let there: HashMap<(&str, &str), ()> =
        found.iter().map(|own| ((own.craft.name.as_str(), own.file.as_str()), ())).collect();
    let is_there = |craft: &str, file: &str| {
        let is_excluded = || fleet.settings.excludes(file) && fleet.folder.join(file).exists();
        there.contains_key(&(craft, file)) || is_excluded()
    };
    let contents: HashMap<(String, String), ()> = known
        .iter()
        .filter(|((craft, file), _)| there.contains_key(&(craft.as_str(), file.as_str())))
        .flat_map(|((craft, _), rows)| rows.iter().map(|row| ((craft.clone(), row.sha256.clone()), ())))
        .collect();
    known.retain(|(craft, file), rows| {
        let was_moved = rows.iter().any(|row| contents.contains_key(&(craft.clone(), row.sha256.clone())));
        is_there(craft, file) || !was_moved && !options.forget
    });
    // What is excluded, or of a craft that is gone as well, does not count.
    let counts = |craft: &str, file: &str| {
        fleet.crafts.iter().any(|own| own.name == craft) && !fleet.settings.excludes(file)
    };
    let gone = known.keys().filter(|(craft, file)| !is_there(craft, file) && counts(craft, file));
    gone.map(|(_, file)| file.clone()).collect()
}

/// What reads new files.
struct Reader<'a> {
    references: &'a BTreeMap<String, Reference>,
    known: BTreeMap<(String, String), Vec<Row>>,
    /// Where a craft's content lies, by craft and hash.
    contents: HashMap<(String, String), (String, String)>,
    read: Mutex<BTreeSet<String>>,
    mb: f64,
}

impl Reader<'_> {
    /// Reads files batch by batch. Whether any row is new.
    fn read(
        &mut self,
        new: &[&Found<'_>],
        index: &Index,
        path: &Path,
        observer: &dyn Observer,
    ) -> Result<bool, FleetError> {
        let done = AtomicUsize::new(0);
        let tell = |done| {
            observer.progress(Progress { activity: "reading flights", steps: Some((done, new.len())) });
        };
        if !new.is_empty() {
            tell(0);
        }
        let mut changed = false;
        for batch in new.chunks(BATCH) {
            if observer.is_cancelled() {
                return Err(FleetError::Cancelled);
            }
            let read: Vec<Option<Vec<Row>>> = batch
                .par_iter()
                .map(|own| {
                    if observer.is_cancelled() {
                        return None;
                    }
                    let rows = self.rows(own);
                    tell(done.fetch_add(1, Ordering::Relaxed) + 1);
                    Some(rows)
                })
                .collect();
            let mut part = Index { references: index.references.clone(), ..Index::default() };
            for (own, rows) in batch.iter().zip(read) {
                let Some(rows) = rows else { continue };
                self.mb += own.bytes as f64 * 1e-6;
                let key = (own.craft.name.clone(), own.file.clone());
                if self.known.get(&key) == Some(&rows) {
                    continue;
                }
                changed = true;
                part.rows.extend(rows.clone());
                let sha256 = rows.first().map(|row| row.sha256.clone()).unwrap_or_default();
                self.contents.entry((key.0.clone(), sha256)).or_insert_with(|| key.clone());
                self.known.insert(key, rows);
            }
            let is_last = new.len() <= BATCH && !observer.is_cancelled();
            if !is_last && !part.rows.is_empty() {
                self.write_part(&mut part, path)?;
            }
        }
        if observer.is_cancelled() { Err(FleetError::Cancelled) } else { Ok(changed) }
    }

    fn write_part(&self, part: &mut Index, path: &Path) -> Result<(), FleetError> {
        let folder = parts_folder(path);
        std::fs::create_dir_all(&folder).map_err(|why| FleetError::write(&folder, why))?;
        let names: Vec<String> =
            part.rows.iter().map(|row| format!("{}\n{}", row.craft, row.sha256)).collect();
        let name = &sha256(names.join("\n").as_bytes())[..16];
        save(part, self.references, &BTreeMap::new(), &folder.join(format!("{name}.parquet")))
    }

    /// The rows of a file: read, or those of the same content.
    fn rows(&self, own: &Found<'_>) -> Vec<Row> {
        let (mut rows, context) = match std::fs::read(own.path) {
            Ok(bytes) => (self.rows_of(own, bytes), own.context.as_str()),
            // Without a context it is tried again.
            Err(why) => (vec![Row::without_flight(State::NotReadable, format!("cannot be read: {why}"))], ""),
        };
        for row in &mut rows {
            // A flight file is called as it lies there; flights of a log have names of their own.
            if Some(row.name.as_str()) == row.file.rsplit('/').next() && !row.file.is_empty() {
                row.name = own.file.rsplit('/').next().unwrap_or_default().to_owned();
            }
            row.craft.clone_from(&own.craft.name);
            row.file.clone_from(&own.file);
            row.context = context.to_owned();
            (row.bytes, row.changed_ns) = (own.bytes, own.changed_ns);
        }
        rows
    }

    fn rows_of(&self, own: &Found<'_>, bytes: Vec<u8>) -> Vec<Row> {
        let content = sha256(&bytes);
        if let Some(rows) = self.same_content(own, &content) {
            return rows;
        }
        if let Ok(mut read) = self.read.lock() {
            read.insert(own.file.clone());
        }
        let reference = self.references.get(&own.craft.name);
        let mut rows = crate::read::rows(bytes, own.path, &own.craft.vehicle, reference);
        rows.iter_mut().for_each(|row| row.sha256.clone_from(&content));
        rows
    }

    /// The rows of a file of the craft with the same content, under this name or another one.
    fn same_content(&self, own: &Found<'_>, content: &str) -> Option<Vec<Row>> {
        let is_same =
            |rows: &&Vec<Row>| rows.iter().all(|row| row.sha256 == content && row.context == own.context);
        let key = (own.craft.name.clone(), own.file.clone());
        let elsewhere = || {
            let at = self.contents.get(&(own.craft.name.clone(), content.to_owned()))?;
            self.known.get(at).filter(is_same)
        };
        self.known.get(&key).filter(is_same).or_else(elsewhere).cloned()
    }
}
