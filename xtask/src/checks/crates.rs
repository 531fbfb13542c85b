//! Every library and program of the workspace, read.

use std::path::Path;

use anyhow::Result;
use cargo_metadata::TargetKind;

use crate::base::workspace::{self, Workspace};
use crate::source::{Graph, Tree, arrows};

/// A library or program: its files, and which uses which.
pub(crate) struct Crate {
    pub(crate) package: String,
    pub(crate) tree: Tree,
    pub(crate) graph: Graph,
}

impl Crate {
    /// Reads a crate; paths are given from `top`.
    pub(crate) fn read(package: &str, top: &Path, root: &Path) -> Result<Self> {
        let tree = Tree::read(top, root)?;
        let graph = arrows(&tree);
        Ok(Self { package: package.to_owned(), tree, graph })
    }
}

/// Every library and program of the workspace.
pub(crate) fn crates(workspace: &Workspace) -> Result<Vec<Crate>> {
    let top = workspace::root();
    let targets = [TargetKind::Lib, TargetKind::Bin].iter().flat_map(|kind| workspace.targets(kind));
    targets.map(|(package, _, root)| Crate::read(&package, &top, &root)).collect()
}
