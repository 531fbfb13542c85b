//! What the tests of this crate share.

pub(crate) mod damage;
pub(crate) mod motion;

use std::path::{Path, PathBuf};

/// A place in the shared data (beside the repository, or where `QUADLAB_SHARED` points); nothing, and says so, where it is not there.
pub(crate) fn shared(inside: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let path = std::env::var_os("QUADLAB_SHARED").map_or_else(beside, PathBuf::from).join(inside);
    if path.exists() {
        return Some(path);
    }
    println!(
        "SKIPPED: {} is not there (set QUADLAB_SHARED to the folder that holds {inside})",
        path.display()
    );
    None
}
