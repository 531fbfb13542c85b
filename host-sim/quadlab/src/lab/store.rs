//! What the lab keeps beside the flights, in `lab/`: written whole or not at all, by one server at a time.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use model::Model;
use model::user_effects::MAX_FILE_BYTES;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::flights::Use;
use super::node::Node;

const FOLDER: &str = "lab";
const STATE: &str = "state.json";
const LOCK: &str = "lock";
const EFFECTS: &str = "effects";
/// Characters of a note at most.
pub(super) const LONGEST_NOTE: usize = 4000;

/// File of an effect of the user's own, beside the flights.
pub(super) fn effect_file(id: &str) -> String {
    format!("{FOLDER}/{EFFECTS}/{id}.toml")
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
    folder: PathBuf,
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
        let folder = flights.join(FOLDER);
        make(&folder)?;
        let path = folder.join(LOCK);
        let lock = match File::options().create(true).truncate(false).write(true).open(&path) {
            Ok(lock) => lock,
            Err(source) => return Err(StoreError::Io { path, source }),
        };
        match lock.try_lock() {
            Ok(()) => Ok(Self { folder, _lock: lock }),
            Err(TryLockError::WouldBlock) => Err(StoreError::Taken(flights.to_owned())),
            Err(TryLockError::Error(source)) => Err(StoreError::Io { path, source }),
        }
    }

    /// What was kept; nothing in a new folder.
    pub(super) fn read(&self) -> Result<(Saved, Vec<Node>), StoreError> {
        let path = self.folder.join(STATE);
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
        let path = self.model_path(id);
        let model = Model::read(&path)
            .map_err(|error| StoreError::Damaged { path: self.folder.clone(), why: error.to_string() })?;
        let found = |path: PathBuf| -> Option<Value> {
            serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
        };
        let [diagnosis, changes] = [self.diagnosis_path(id), self.changes_path(id)].map(found);
        Ok(Node { id, parent, effect, supported, command, note, model: model.into(), diagnosis, changes })
    }

    /// Keeps all but the models.
    pub(super) fn write(&self, saved: &Saved) -> Result<(), StoreError> {
        // Somebody may have tidied up while the lab was open.
        make(&self.folder)?;
        let text = serde_json::to_string_pretty(saved).unwrap_or_default() + "\n";
        Ok(report::write_atomic(self.folder.join(STATE), text)?)
    }

    /// Keeps a model and what was found in it.
    pub(super) fn write_node(&self, node: &Node) -> Result<(), StoreError> {
        make(&self.folder)?;
        report::write_atomic(self.model_path(node.id), node.model.to_toml())?;
        for (path, found) in
            [(self.diagnosis_path(node.id), &node.diagnosis), (self.changes_path(node.id), &node.changes)]
        {
            match found {
                Some(found) => report::write_atomic(path, found.to_string())?,
                None => remove(path)?,
            }
        }
        Ok(())
    }

    /// A file beside the others that is gone when it is dropped.
    pub(super) fn temporary(&self) -> Result<tempfile::NamedTempFile, StoreError> {
        make(&self.folder)?;
        tempfile::NamedTempFile::new_in(&self.folder)
            .map_err(|source| StoreError::Io { path: self.folder.clone(), source })
    }

    /// The user's own effects that are kept, by name.
    pub(super) fn read_effects(&self) -> Result<Vec<EffectFile>, StoreError> {
        let path = self.folder.join(EFFECTS);
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
                files.push(EffectFile { id, text: effect_text(&path) });
            }
        }
        files.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(files)
    }

    /// Keeps an effect of the user's own; its identifier has been checked.
    pub(super) fn write_effect(&self, id: &str, text: &str) -> Result<(), StoreError> {
        make(&self.folder.join(EFFECTS))?;
        Ok(report::write_atomic(self.effect_path(id), text)?)
    }

    /// Keeps an effect no longer; its name is one of those that were read or written.
    pub(super) fn remove_effect(&self, id: &str) -> Result<(), StoreError> {
        remove(self.effect_path(id))
    }

    fn effect_path(&self, id: &str) -> PathBuf {
        self.folder.join(EFFECTS).join(format!("{id}.toml"))
    }

    fn model_path(&self, id: u32) -> PathBuf {
        self.folder.join(format!("model-{id}.toml"))
    }

    fn diagnosis_path(&self, id: u32) -> PathBuf {
        self.folder.join(format!("diagnosis-{id}.json"))
    }

    fn changes_path(&self, id: u32) -> PathBuf {
        self.folder.join(format!("changes-{id}.json"))
    }
}

/// What a file of effects says; one that is far too large is not read.
fn effect_text(path: &Path) -> Result<String, String> {
    let size = std::fs::metadata(path).map_err(|error| error.to_string())?.len();
    if size > MAX_FILE_BYTES {
        return Err(format!("is larger than {MAX_FILE_BYTES} bytes, which no file of effects is"));
    }
    std::fs::read_to_string(path).map_err(|error| format!("cannot be read: {error}"))
}

/// Removes a file, if it is there.
fn remove(path: PathBuf) -> Result<(), StoreError> {
    match std::fs::remove_file(&path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(StoreError::Io { path, source }),
        _ => Ok(()),
    }
}

fn make(folder: &Path) -> Result<(), StoreError> {
    std::fs::create_dir_all(folder).map_err(|source| StoreError::Io { path: folder.to_owned(), source })
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
