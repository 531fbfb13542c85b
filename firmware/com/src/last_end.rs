//! How the program ended last, kept in a file for the next start.
//!
//! While the program runs the file says so, with the machine's boot. If it still says so at the
//! next start, nothing could record the end: in the same boot the guardian itself was killed; in
//! another one the power failed or the board was reset.

use std::fs;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, access};

/// Written at the start, replaced at the end.
const RUNNING: &str = "running";

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Record {
    /// [`RUNNING`], or how it ended.
    state: String,
    /// The kernel's number of the boot.
    boot: String,
    process: u32,
}

/// The file.
#[derive(Debug, Clone)]
pub struct LastEnd {
    path: Option<PathBuf>,
}

impl LastEnd {
    /// Kept in this file; without one nothing is kept.
    pub fn new(path: Option<PathBuf>) -> Self {
        Self { path }
    }

    /// Says in a sentence how the program ended last, and records that it runs from now on.
    ///
    /// # Errors
    /// A file that cannot be written: the next start would report something wrong.
    pub fn begin(&self) -> Result<String> {
        let Some(path) = &self.path else { return Ok("no file records how the last run ended".into()) };
        let boot = boot();
        let sentence = match fs::read_to_string(path) {
            Err(_) => "this is the first start here".to_owned(),
            Ok(text) => match toml::from_str::<Record>(&text) {
                Err(_) => format!("{}: not readable; how the last run ended is unknown", path.display()),
                Ok(last) => sentence(&last, &boot),
            },
        };
        self.write(RUNNING, boot)?;
        Ok(sentence)
    }

    /// Records how the program ends.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn end(&self, how: &str) -> Result<()> {
        self.write(how, boot())
    }

    fn write(&self, state: &str, boot: String) -> Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let record = Record { state: state.into(), boot, process: std::process::id() };
        let text = toml::to_string(&record).map_err(|error| Error::Other(error.to_string()))?;
        let temporary = path.with_extension("new");
        fs::write(&temporary, text).map_err(access(&temporary, "write how the program ends"))?;
        fs::rename(&temporary, path).map_err(access(path, "replace the file of the last end"))
    }
}

fn sentence(last: &Record, boot: &str) -> String {
    match last.state.as_str() {
        RUNNING if last.boot == boot => {
            format!(
                "the last run's guardian (process {}) was killed; the loop, if it was alive, idled the outputs",
                last.process
            )
        }
        RUNNING => "the machine stopped during the last run: power lost, or reset".into(),
        how => format!("the last run ended: {how}"),
    }
}

/// The kernel's number of this boot.
fn boot() -> String {
    let id = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    id.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_end_is_reported_at_the_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("last-end.toml");
        let kept = LastEnd::new(Some(path.clone()));
        assert!(kept.begin().unwrap().contains("first start"));
        assert!(kept.begin().unwrap().contains("guardian"), "it still says running");
        kept.end("the loop was killed by signal 9").unwrap();
        assert_eq!(kept.begin().unwrap(), "the last run ended: the loop was killed by signal 9");
        let text = fs::read_to_string(&path).unwrap().replace(&boot(), "another");
        fs::write(&path, text).unwrap();
        assert!(kept.begin().unwrap().contains("power lost"));
        fs::write(&path, "x").unwrap();
        assert!(kept.begin().unwrap().contains("not readable"));
        let nowhere = LastEnd::new(Some("/nonexistent/last-end.toml".into()));
        assert!(nowhere.begin().unwrap_err().to_string().contains("/nonexistent"));
    }
}
