//! What the lab keeps beside the flights, in `lab/`: written whole or not at all, by one server at a time.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use model::Model;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::flights::Use;
use super::node::Node;

const FOLDER: &str = "lab";
const STATE: &str = "state.json";
const LOCK: &str = "lock";

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
    pub(super) chosen: std::collections::BTreeMap<String, Use>,
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
        let SavedModel { id, parent, effect, supported, command } = saved;
        let path = self.model_path(id);
        let model = Model::read(&path)
            .map_err(|error| StoreError::Damaged { path: self.folder.clone(), why: error.to_string() })?;
        let found = |path: PathBuf| -> Option<Value> {
            serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
        };
        let [diagnosis, changes] = [self.diagnosis_path(id), self.changes_path(id)].map(found);
        Ok(Node { id, parent, effect, supported, command, model: model.into(), diagnosis, changes })
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
        if let Some(diagnosis) = &node.diagnosis {
            report::write_atomic(self.diagnosis_path(node.id), diagnosis.to_string())?;
        }
        if let Some(changes) = &node.changes {
            report::write_atomic(self.changes_path(node.id), changes.to_string())?;
        }
        Ok(())
    }

    /// A file beside the others that is gone when it is dropped.
    pub(super) fn temporary(&self) -> Result<tempfile::NamedTempFile, StoreError> {
        make(&self.folder)?;
        tempfile::NamedTempFile::new_in(&self.folder)
            .map_err(|source| StoreError::Io { path: self.folder.clone(), source })
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
        }
    }
}
