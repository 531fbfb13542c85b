//! What a link needs of the system, for both of its ends: its key, and random bytes.
//!
//! - A key file is 64 hexadecimal digits (32 bytes) and a line end; `head -c 32 /dev/urandom | xxd
//!   -p -c 64` makes one. It must be readable by its owner alone (mode 0600); otherwise it is
//!   refused.
//! - Random bytes are the system's ([`random`]): each start of a link has its own.
//!
//! Deliberately absent: making keys, and the protocol itself (crate `proto`).
#![forbid(unsafe_code)]

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use proto::Key;

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be opened, read or written.
    #[error("{}: cannot {what}: {source}", path.display())]
    Access {
        /// Which file.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// Others can read the key.
    #[error("{}: mode {mode:04o} lets others read the key: chmod 600 {}", path.display(), path.display())]
    Mode {
        /// Which file.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// The system has no random bytes.
    #[error(
        "the system gives no random bytes, without which no recording could be told from what is new: {0}"
    )]
    NoChance(getrandom::Error),
    /// The content is something else.
    #[error("{}: {found}; {expected}", path.display())]
    Content {
        /// Which file.
        path: PathBuf,
        /// What is there.
        found: String,
        /// What should be.
        expected: &'static str,
    },
}

fn access<'a>(path: &'a Path, what: &'static str) -> impl FnOnce(io::Error) -> FileError + 'a {
    move |source| FileError::Access { path: path.to_owned(), what, source }
}

/// Reads a key.
///
/// # Errors
/// A file that cannot be read, that others can read, or that holds something else than 64
/// hexadecimal digits.
pub fn read_key(path: &Path) -> Result<Key, FileError> {
    read_key_bytes(path).map(Key::new)
}

/// Reads a key to build it into something.
///
/// # Errors
/// As [`read_key`].
pub fn read_key_bytes(path: &Path) -> Result<[u8; 32], FileError> {
    let mut file = File::open(path).map_err(access(path, "open the key file"))?;
    check_mode(&file, path)?;
    let mut text = String::new();
    // The file that was checked is the one that is read. A key has 65 bytes; what is longer is
    // none.
    (&mut file).take(1024).read_to_string(&mut text).map_err(access(path, "read the key file"))?;
    parse_key(text.trim()).ok_or_else(|| FileError::Content {
        path: path.to_owned(),
        found: format!("{} characters that are not a key", text.trim().chars().count()),
        expected: "a key is 64 hexadecimal digits: head -c 32 /dev/urandom | xxd -p -c 64",
    })
}

#[cfg(unix)]
fn check_mode(file: &File, path: &Path) -> Result<(), FileError> {
    use std::os::unix::fs::PermissionsExt;
    let mode = file.metadata().map_err(access(path, "look at the key file"))?.permissions().mode() & 0o7777;
    if mode == 0o600 || mode == 0o400 { Ok(()) } else { Err(FileError::Mode { path: path.to_owned(), mode }) }
}

#[cfg(not(unix))]
fn check_mode(_: &File, _: &Path) -> Result<(), FileError> {
    Ok(())
}

fn parse_key(text: &str) -> Option<[u8; 32]> {
    if text.len() != 64 {
        return None;
    }
    let mut bytes = [0; 32];
    for (byte, digits) in bytes.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
        let digit = |d: u8| char::from(d).to_digit(16);
        let [high, low] = digits else { return None };
        *byte = u8::try_from(digit(*high)? * 16 + digit(*low)?).ok()?;
    }
    Some(bytes)
}

/// Random bytes for one start of a link.
///
/// # Errors
/// A system without any.
pub fn random() -> Result<[u8; 32], FileError> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes).map_err(FileError::NoChance)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[cfg(unix)]
    fn write(path: &Path, text: &str, mode: u32) {
        use std::os::unix::fs::PermissionsExt;
        fs::write(path, text).unwrap();
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_key_that_others_can_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        let text = format!("{}\n", "0123456789abcDEF".repeat(4));
        for mode in [0o600, 0o400] {
            write(&path, &text, mode);
            read_key(&path).unwrap();
        }
        for mode in [0o640, 0o604, 0o644, 0o660, 0o700, 0o620, 0o606] {
            write(&path, &text, mode);
            let message = read_key(&path).unwrap_err().to_string();
            assert!(message.contains("chmod 600") && message.contains(&format!("{mode:04o}")), "{message}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_key_is_refused_by_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        for text in
            ["", "00", &"0".repeat(63), &"0".repeat(65), &"g".repeat(64), &"é".repeat(32), &"a".repeat(5000)]
        {
            write(&path, text, 0o600);
            let message = read_key(&path).unwrap_err().to_string();
            assert!(message.contains("key") && message.contains("64 hexadecimal"), "{message}");
            assert_eq!(message.lines().count(), 1);
        }
        assert!(read_key(&folder.path().join("none")).unwrap_err().to_string().contains("none"));
    }
}
