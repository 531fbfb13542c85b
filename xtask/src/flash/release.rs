//! What goes onto a craft: the program, its configuration and the files that it names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use sha2::{Digest, Sha256};

use crate::base::process::{shown, succeeds};

/// Name of the program on the craft.
pub(crate) const PROGRAM: &str = "com";
/// Name of its configuration there.
pub(crate) const CONFIG: &str = "com.toml";

/// What goes onto the craft.
pub(crate) struct Release {
    /// The first digits of the hash of all of it.
    pub(crate) id: String,
    pub(crate) files: BTreeMap<String, Vec<u8>>,
}

impl Release {
    /// A program with the files that lie beside it, named by the hash of all of them.
    pub(crate) fn new(mut files: BTreeMap<String, Vec<u8>>, program: &Path) -> Result<Self> {
        let bytes = std::fs::read(program).with_context(|| format!("cannot read {}", program.display()))?;
        files.insert(PROGRAM.into(), bytes);
        let mut all = Sha256::new();
        for (name, bytes) in &files {
            all.update(name.as_bytes());
            all.update(hash(bytes).as_bytes());
        }
        let mut id = hex(&all.finalize());
        id.truncate(12);
        Ok(Self { id, files })
    }
}

/// Without what only a debugger needs: a tenth of the bytes for the radio.
pub(crate) fn stripped(program: &Path) -> Result<PathBuf> {
    let small = program.with_extension("stripped");
    let mut command = Command::new("arm-linux-gnueabihf-strip");
    command.arg("-o").arg(&small).arg(program);
    ensure!(succeeds(&mut command)?, "`{}` failed", shown(&command));
    Ok(small)
}

/// A configuration and the files it names, which lie beside it.
pub(crate) fn files_of(config: &Path) -> Result<BTreeMap<String, Vec<u8>>> {
    let text =
        std::fs::read_to_string(config).with_context(|| format!("cannot read {}", config.display()))?;
    let table: toml::Table = text.parse().with_context(|| format!("{} is not TOML", config.display()))?;
    let mut files = BTreeMap::from([(CONFIG.to_owned(), text.into_bytes())]);
    for field in ["vehicle", "gains"] {
        let name = table.get("files").and_then(|files| files.get(field)).and_then(toml::Value::as_str);
        let name = name.with_context(|| format!("{}: [files] {field} is missing", config.display()))?;
        let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c));
        ensure!(
            plain && !name.starts_with(['.', '-']) && name != PROGRAM && name != CONFIG,
            "{}: [files] {field} is {name:?}: put it beside the configuration, with a name of letters, digits and ._-",
            config.display()
        );
        let path = config.with_file_name(name);
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        files.insert(name.to_owned(), bytes);
    }
    Ok(files)
}

/// SHA-256 in hexadecimal digits.
pub(crate) fn hash(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_takes_its_files_along() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.toml");
        std::fs::write(&path, "[files]\nvehicle = 'v.toml'\ngains = 'g.toml'\n").unwrap();
        assert!(files_of(&path).unwrap_err().to_string().contains("v.toml"));
        std::fs::write(folder.path().join("v.toml"), "v").unwrap();
        std::fs::write(folder.path().join("g.toml"), "g").unwrap();
        let files = files_of(&path).unwrap();
        assert_eq!(files.keys().collect::<Vec<_>>(), ["com.toml", "g.toml", "v.toml"]);
        for name in ["../v.toml", "/etc/passwd", "a b", "com", "$(x)"] {
            std::fs::write(&path, format!("[files]\nvehicle = 'v.toml'\ngains = '{name}'\n")).unwrap();
            assert!(files_of(&path).is_err(), "{name}");
        }
    }
}
