//! Links in the folder: what leads out of it is neither read nor written. A folder of flights may come from somebody else.

use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

/// A link, or a file behind one, that is not in the folder.
#[derive(Debug, thiserror::Error)]
#[error("{}: is a link that leads out of the folder: put a copy of what it leads to in its place", .0.display())]
pub(crate) struct LeadsOut(PathBuf);

/// Refuses a path of the folder that leads out of it, whether there is a file at its end or not. A path that the system cannot follow is
/// let through: neither can whoever opens it.
pub(super) fn check(folder: &Path, path: &Path) -> std::result::Result<(), LeadsOut> {
    let leads_out = match (folder.canonicalize(), real(path)) {
        (Ok(folder), Ok(path)) => !path.starts_with(folder),
        _ => path.is_symlink(),
    };
    if leads_out { Err(LeadsOut(path.to_owned())) } else { Ok(()) }
}

/// Refuses a folder with a file of these names that leads out.
pub(super) fn check_all(folder: &Path, is_meant: impl Fn(&str) -> bool) -> std::result::Result<(), LeadsOut> {
    // A folder that cannot be read has no file that could be.
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut meant = entries.filter(|entry| entry.file_name().to_str().is_some_and(&is_meant));
    meant.try_for_each(|entry| check(folder, &entry.path()))
}

/// Where a path really is: that of a file which is not there is in its folder.
fn real(path: &Path) -> Result<PathBuf> {
    match path.canonicalize() {
        Err(error) if error.kind() == ErrorKind::NotFound && !path.is_symlink() => {
            let (folder, name) =
                path.parent().zip(path.file_name()).ok_or(Error::from(ErrorKind::NotFound))?;
            Ok(real(folder)?.join(name))
        }
        other => other,
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn links_within_the_folder_are_followed_and_others_refused() {
        let outer = tempfile::tempdir().unwrap();
        let (folder, beside) = (outer.path().join("flights"), outer.path().join("flights-of-others"));
        for folder in [&folder, &beside] {
            fs::create_dir(folder).unwrap();
            fs::write(folder.join("A.csv"), "").unwrap();
        }
        let link = |name: &str, to: &Path| symlink(to, folder.join(name)).unwrap();
        link("same.csv", Path::new("A.csv"));
        link("around.csv", Path::new("../flights/A.csv"));
        link("out.csv", Path::new("../flights-of-others/A.csv"));
        link("absolute.csv", &beside.join("A.csv"));
        link("chain.csv", Path::new("out.csv"));
        link("nowhere.csv", &beside.join("new.csv"));
        link("lab", &beside);
        symlink(&folder, outer.path().join("named")).unwrap();
        for folder in [folder.clone(), outer.path().join("named")] {
            for inside in ["A.csv", "none.csv", "none/none.csv", "same.csv", "around.csv"] {
                assert!(check(&folder, &folder.join(inside)).is_ok(), "{inside}");
            }
            for out in
                ["out.csv", "absolute.csv", "chain.csv", "nowhere.csv", "lab", "lab/A.csv", "lab/new.csv"]
            {
                assert!(check(&folder, &folder.join(out)).is_err(), "{out}");
            }
        }
        assert!(check_all(&folder, |name| name.starts_with('a')).is_err());
        assert!(check_all(&folder, |name| name.contains("A.") || name == "same.csv").is_ok());
    }
}
