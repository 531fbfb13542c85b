//! What the lab keeps beside the flights, in `lab/`: written whole or not at all, by one server at a time.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use model::Model;
use model::user_effects::MAX_FILE_BYTES;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::flights::Use;
use super::links::{self, LeadsOut};
use super::node::Node;

const FOLDER: &str = "lab";
const STATE: &str = "state.json";
const LOCK: &str = "lock";
const EFFECTS: &str = "effects";
/// Characters of a note at most.
pub(super) const LONGEST_NOTE: usize = 4000;

/// File of an effect of the user's own, beside the flights.
pub(super) fn effect_file(id: &str) -> String {
    format!("{FOLDER}/{}", own_file(id))
}

/// A file of effects as it lies in the folder.
#[derive(Debug)]
pub(super) struct EffectFile {
    /// Its name without the ending.
    pub(super) id: String,
    /// Its text, or why it cannot be read.
    pub(super) text: Result<String, String>,
}

/// The folder, held by this server.
#[derive(Debug)]
pub(super) struct Store {
    /// The folder of the flights: nothing outside of it is read or written.
    flights: PathBuf,
    /// Whoever has it has the folder; the system lets go of it however the program ends.
    _lock: File,
}

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    #[error("{}: another lab has this folder open: use its page, or end it first", .0.display())]
    Taken(PathBuf),
    #[error("{}: cannot be written: {source}; the lab keeps its models there", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: {why}; move the folder away to begin anew", path.display())]
    Damaged { path: PathBuf, why: String },
    #[error(transparent)]
    LeadsOut(#[from] LeadsOut),
    #[error(transparent)]
    Write(#[from] report::Error),
}

/// What is in `state.json`.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Saved {
    /// What the user chose for flights, by file name.
    #[serde(default)]
    pub(super) chosen: BTreeMap<String, Use>,
    /// What the user wrote about flights, by file name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) notes: BTreeMap<String, String>,
    #[serde(default)]
    pub(super) models: Vec<SavedModel>,
    #[serde(default)]
    pub(super) current: Option<u32>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SavedModel {
    id: u32,
    parent: Option<u32>,
    effect: Option<String>,
    supported: Option<bool>,
    command: String,
    /// What the user wrote about it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    note: String,
}

impl Store {
    /// Takes the folder beside the flights.
    pub(super) fn open(flights: &Path) -> Result<Self, StoreError> {
        let store = |lock| Self { flights: flights.to_owned(), _lock: lock };
        let path = place_for(flights, LOCK)?;
        let lock = match File::options().create(true).truncate(false).write(true).open(&path) {
            Ok(lock) => lock,
            Err(source) => return Err(StoreError::Io { path, source }),
        };
        match lock.try_lock() {
            Ok(()) => Ok(store(lock)),
            Err(TryLockError::WouldBlock) => Err(StoreError::Taken(flights.to_owned())),
            Err(TryLockError::Error(source)) => Err(StoreError::Io { path, source }),
        }
    }

    /// What was kept; nothing in a new folder.
    pub(super) fn read(&self) -> Result<(Saved, Vec<Node>), StoreError> {
        let path = self.place_of(STATE)?;
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Default::default()),
            Err(source) => return Err(StoreError::Io { path, source }),
        };
        let mut saved: Saved = serde_json::from_str(&text)
            .map_err(|error| StoreError::Damaged { path, why: format!("is damaged: {error}") })?;
        let models = std::mem::take(&mut saved.models);
        let nodes = models.into_iter().map(|model| self.node(model)).collect::<Result<_, _>>()?;
        Ok((saved, nodes))
    }

    fn node(&self, saved: SavedModel) -> Result<Node, StoreError> {
        let SavedModel { id, parent, effect, supported, command, note } = saved;
        let model = Model::read(&self.place_of(&model_file(id))?).map_err(|error| StoreError::Damaged {
            path: self.flights.join(FOLDER),
            why: error.to_string(),
        })?;
        let found = |name: String| -> Result<Option<Value>, StoreError> {
            let text = std::fs::read_to_string(self.place_of(&name)?);
            Ok(text.ok().and_then(|text| serde_json::from_str(&text).ok()))
        };
        Ok(Node {
            id,
            parent,
            effect,
            supported,
            command,
            note,
            model: model.into(),
            diagnosis: found(diagnosis_file(id))?,
            changes: found(changes_file(id))?,
            discovery: found(discovery_file(id))?,
        })
    }

    /// Keeps all but the models.
    pub(super) fn write(&self, saved: &Saved) -> Result<(), StoreError> {
        let text = serde_json::to_string_pretty(saved).unwrap_or_default() + "\n";
        self.put(STATE, &text)
    }

    /// Keeps a model and what was found in it.
    pub(super) fn write_node(&self, node: &Node) -> Result<(), StoreError> {
        self.put(&model_file(node.id), &node.model.to_toml())?;
        for (name, found) in [
            (diagnosis_file(node.id), &node.diagnosis),
            (changes_file(node.id), &node.changes),
            (discovery_file(node.id), &node.discovery),
        ] {
            match found {
                Some(found) => self.put(&name, &found.to_string())?,
                None => self.remove(&name)?,
            }
        }
        Ok(())
    }

    /// A file beside the others that is gone when it is dropped.
    pub(super) fn temporary(&self) -> Result<tempfile::NamedTempFile, StoreError> {
        let path = place_for(&self.flights, STATE)?.with_file_name("");
        tempfile::NamedTempFile::new_in(&path).map_err(|source| StoreError::Io { path, source })
    }

    /// The user's own effects that are kept, by name.
    pub(super) fn read_effects(&self) -> Result<Vec<EffectFile>, StoreError> {
        let path = self.place_of(EFFECTS)?;
        let failed = |source| StoreError::Io { path: path.clone(), source };
        let entries = match std::fs::read_dir(&path) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(failed(error)),
        };
        let mut files = Vec::new();
        for entry in entries {
            let path = entry.map_err(failed)?.path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                let id = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let text = self.place_of(&own_file(&id)).map_err(|error| error.to_string());
                files.push(EffectFile { id, text: text.and_then(|path| effect_text(&path)) });
            }
        }
        files.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(files)
    }

    /// Keeps an effect of the user's own; its identifier has been checked.
    pub(super) fn write_effect(&self, id: &str, text: &str) -> Result<(), StoreError> {
        self.put(&own_file(id), text)
    }

    /// Keeps an effect no longer; its name is one of those that were read or written.
    pub(super) fn remove_effect(&self, id: &str) -> Result<(), StoreError> {
        self.remove(&own_file(id))
    }

    /// Where a file of this name is.
    fn place_of(&self, name: &str) -> Result<PathBuf, StoreError> {
        place_of(&self.flights, name)
    }

    /// Writes a file whole. Somebody may have tidied up while the lab was open.
    fn put(&self, name: &str, text: &str) -> Result<(), StoreError> {
        Ok(report::write_atomic(place_for(&self.flights, name)?, text)?)
    }

    /// Removes a file, if it is there.
    fn remove(&self, name: &str) -> Result<(), StoreError> {
        let path = self.place_of(name)?;
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                Err(StoreError::Io { path, source })
            }
            _ => Ok(()),
        }
    }
}

/// Where a file of this name is, beside these flights.
fn place_of(flights: &Path, name: &str) -> Result<PathBuf, StoreError> {
    let path = flights.join(FOLDER).join(name);
    links::check(flights, &path)?;
    Ok(path)
}

/// The same, with the folder that it needs.
fn place_for(flights: &Path, name: &str) -> Result<PathBuf, StoreError> {
    let path = place_of(flights, name)?;
    let folder = path.parent().unwrap_or(flights);
    std::fs::create_dir_all(folder).map_err(|source| StoreError::Io { path: folder.to_owned(), source })?;
    Ok(path)
}

/// Names of files in the folder.
fn model_file(id: u32) -> String {
    format!("model-{id}.toml")
}

fn diagnosis_file(id: u32) -> String {
    format!("diagnosis-{id}.json")
}

fn changes_file(id: u32) -> String {
    format!("changes-{id}.json")
}

fn discovery_file(id: u32) -> String {
    format!("discovery-{id}.json")
}

fn own_file(id: &str) -> String {
    format!("{EFFECTS}/{id}.toml")
}

/// What a file of effects says; one that is far too large is not read.
fn effect_text(path: &Path) -> Result<String, String> {
    let size = std::fs::metadata(path).map_err(|error| error.to_string())?.len();
    if size > MAX_FILE_BYTES {
        return Err(format!("is larger than {MAX_FILE_BYTES} bytes, which no file of effects is"));
    }
    std::fs::read_to_string(path).map_err(|error| format!("cannot be read: {error}"))
}

impl From<&Node> for SavedModel {
    fn from(node: &Node) -> Self {
        Self {
            id: node.id,
            parent: node.parent,
            effect: node.effect.clone(),
            supported: node.supported,
            command: node.command.clone(),
            note: node.note.clone(),
        }
    }
}
