//! What cargo knows about this workspace: its members, their targets, and every dependency.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use cargo_metadata::{Metadata, MetadataCommand, Package, TargetKind};

/// The workspace as `cargo metadata` describes it, for all platforms.
pub(crate) struct Workspace {
    pub(crate) metadata: Metadata,
}

/// The workspace's top folder. `cargo xtask` is always built inside the tree it works on.
pub(crate) fn root() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().unwrap_or(xtask).to_path_buf()
}

impl Workspace {
    /// Asks cargo.
    pub(crate) fn load() -> Result<Self> {
        let metadata = MetadataCommand::new()
            .manifest_path(root().join("Cargo.toml"))
            .exec()
            .context("`cargo metadata` does not understand the workspace")?;
        Ok(Self { metadata })
    }

    /// The workspace's own crates, in the order of cargo.
    pub(crate) fn members(&self) -> Vec<&Package> {
        self.metadata.workspace_packages()
    }

    /// A member's folder relative to the root, with `/` between its parts.
    pub(crate) fn folder_of(&self, member: &Package) -> String {
        let folder = member.manifest_path.parent().unwrap_or(&member.manifest_path);
        folder.strip_prefix(&self.metadata.workspace_root).unwrap_or(folder).as_str().replace('\\', "/")
    }

    /// Every target of a kind as (package name, target name, source file).
    pub(crate) fn targets(&self, kind: &TargetKind) -> Vec<(String, String, PathBuf)> {
        let mut targets = Vec::new();
        for member in self.members() {
            for target in member.targets.iter().filter(|target| target.kind.contains(kind)) {
                let source = target.src_path.clone().into_std_path_buf();
                targets.push((member.name.to_string(), target.name.clone(), source));
            }
        }
        targets
    }

    /// Version of a package in the lock file, or nothing when no crate uses it.
    pub(crate) fn locked_version(&self, package: &str) -> Option<String> {
        let found = self.metadata.packages.iter().find(|candidate| candidate.name.as_str() == package)?;
        Some(found.version.to_string())
    }
}
