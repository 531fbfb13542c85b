//! Output files that are either the old one or the new one, never half of it.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Why an output file could not be written. Every message names the path and the way out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The path is an existing folder.
    #[error("cannot write {}: it is a folder; give the name of a file in it", path.display())]
    IsFolder {
        /// The path as given.
        path: PathBuf,
    },
    /// The path has no last component, as in an empty path or `..`.
    #[error("cannot write \"{}\": it names no file; give a file name", path.display())]
    NoFileName {
        /// The path as given.
        path: PathBuf,
    },
    /// The folder that should hold the file does not exist or is not a folder.
    #[error("cannot write {}: there is no folder {}; create it first", path.display(), folder.display())]
    MissingFolder {
        /// The path as given.
        path: PathBuf,
        /// The folder that was not found.
        folder: PathBuf,
    },
    /// The operating system refused.
    #[error("cannot write {}: {source}; check the permissions and the free space of its folder", path.display())]
    Refused {
        /// The path as given.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
}

/// Where bytes for a path really go.
enum Target {
    /// A file in a folder that exists: written beside it and renamed.
    File { path: PathBuf, folder: PathBuf },
    /// A device or pipe: written directly, because it cannot be replaced.
    Direct,
}

fn target_of(path: &Path) -> Result<Target, Error> {
    let refused = |source| Error::Refused { path: path.to_owned(), source };
    let target = match fs::metadata(path) {
        Ok(existing) if existing.is_dir() => return Err(Error::IsFolder { path: path.to_owned() }),
        Ok(existing) if existing.is_file() => fs::canonicalize(path).map_err(refused)?,
        Ok(_) => return Ok(Target::Direct),
        Err(_) => path.to_owned(),
    };
    let folder = folder_of(&target).ok_or_else(|| Error::NoFileName { path: path.to_owned() })?;
    if !folder.is_dir() {
        return Err(Error::MissingFolder { path: path.to_owned(), folder });
    }
    Ok(Target::File { path: target, folder })
}

/// Checks, before any work is done for it, that [`write_atomic`] would find a place for `path`.
///
/// # Errors
/// [`Error`] when `path` is a folder, names no file or lies in a missing folder. Permissions and free space show only when writing.
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), Error> {
    target_of(path.as_ref()).map(|_| ())
}

/// Writes `bytes` to `path` so that a reader sees the old content or the whole new one, also after a power cut.
///
/// A temporary file in the same folder is written, synchronised to disk and renamed over `path`. A symbolic link is kept and its
/// target replaced; a device or pipe (`/dev/stdout`) is written directly because it cannot be replaced.
///
/// # Errors
/// [`Error`] when `path` is a folder, names no file, lies in a missing folder, or the operating system refuses. The old file is then
/// untouched and no temporary file stays behind.
pub fn write_atomic(path: impl AsRef<Path>, bytes: impl AsRef<[u8]>) -> Result<(), Error> {
    let path = path.as_ref();
    let refused = |source| Error::Refused { path: path.to_owned(), source };
    let (target, folder) = match target_of(path)? {
        Target::Direct => return fs::write(path, bytes).map_err(refused),
        Target::File { path, folder } => (path, folder),
    };
    let mut temporary = temporary_in(&folder).map_err(refused)?;
    temporary.write_all(bytes.as_ref()).map_err(refused)?;
    temporary.as_file().sync_all().map_err(refused)?;
    temporary.persist(&target).map_err(|error| refused(error.error))?;
    sync_folder(&folder).map_err(refused)
}

/// Prints a program's result to standard output. A reader that closes the pipe early (`... | head`) has seen enough: that is no
/// error.
///
/// # Errors
/// What the operating system refuses otherwise, a full disk for instance.
pub fn print(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|why| io::Error::new(why.kind(), format!("standard output: {why}"))),
    }
}

/// The folder that holds `path`; `None` when `path` names no file (or only a folder, as a trailing slash says).
fn folder_of(path: &Path) -> Option<PathBuf> {
    path.file_name()?;
    if path.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return None;
    }
    let parent = path.parent()?;
    Some(if parent.as_os_str().is_empty() { PathBuf::from(".") } else { parent.to_owned() })
}

fn temporary_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".quadlab-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Readable like any other output; the process' umask takes away what the user does not want. The default would be 0600.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Makes the rename itself durable: on Unix the folder entry is data of the folder.
fn sync_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    match fs::File::open(folder).and_then(|handle| handle.sync_all()) {
        // Some file systems cannot synchronise a folder, and a folder may be writable without being readable; the file is complete.
        Err(error)
            if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::PermissionDenied) => {}
        other => other?,
    }
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_the_whole_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.html");
        write_atomic(&path, "a long first version").unwrap();
        write_atomic(&path, "second").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(names_in(folder.path()), ["out.html"]);
    }

    #[test]
    fn a_folder_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_atomic(folder.path(), "x").unwrap_err();
        assert!(matches!(error, Error::IsFolder { .. }), "{error}");
        let line = error.to_string();
        assert!(line.contains(folder.path().to_str().unwrap()) && !line.contains('\n'), "{line}");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("absent");
        let error = write_atomic(missing.join("out.svg"), "x").unwrap_err();
        assert!(matches!(&error, Error::MissingFolder { folder, .. } if *folder == missing), "{error}");
        assert!(names_in(folder.path()).is_empty());
        assert_eq!(check_writable(missing.join("out.svg")).unwrap_err().to_string(), error.to_string());
        check_writable(folder.path().join("out.svg")).unwrap();
        assert!(names_in(folder.path()).is_empty(), "a check writes nothing");
    }

    #[test]
    fn a_file_used_as_folder_is_a_missing_folder() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "x").unwrap();
        let error = write_atomic(file.join("out.svg"), "x").unwrap_err();
        assert!(matches!(error, Error::MissingFolder { .. }), "{error}");
    }

    #[test]
    fn a_path_without_a_file_name_is_refused() {
        for path in ["", "absent-folder/"] {
            let error = write_atomic(path, "x").unwrap_err();
            assert!(matches!(error, Error::NoFileName { .. }), "{path}: {error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_kept_and_a_device_survives() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "old").unwrap();
        symlink(&real, &link).unwrap();
        write_atomic(&link, "new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&real).unwrap(), "new");

        write_atomic("/dev/null", "gone").unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }

    #[cfg(unix)]
    #[test]
    fn the_file_is_not_private() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_atomic(&ours, "x").unwrap();
        fs::write(&plain, "x").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
