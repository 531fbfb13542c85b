//! How the program ended last, kept in a file for the next start.
//!
//! While the program runs the file says so, with the machine's boot. If it still says so at the
//! next start, nothing could record the end: in the same boot the guardian itself was killed; in
//! another one the power failed or the board was reset.

use std::fs;
use std::path::PathBuf;

use proto::Ending;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, access};

/// Written at the start, replaced at the end.
const RUNNING: &str = "running";

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Record {
    /// [`RUNNING`], or how it ended.
    state: String,
    /// How it ended, as the ground is told.
    ending: Option<Ending>,
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

    /// Says in a sentence, and as the ground is told, how the program ended last, and records that it runs from now on.
    ///
    /// # Errors
    /// A file that cannot be written: the next start would report something wrong.
    pub fn begin(&self) -> Result<(String, Ending)> {
        let Some(path) = &self.path else {
            return Ok(("no file records how the last run ended".into(), Ending::Unknown));
        };
        let boot = boot();
        let said = match fs::read_to_string(path) {
            Err(_) => ("this is the first start here".to_owned(), Ending::Unknown),
            Ok(text) => match toml::from_str::<Record>(&text) {
                Err(_) => (
                    format!("{}: not readable; how the last run ended is unknown", path.display()),
                    Ending::Unknown,
                ),
                Ok(last) => told(&last, &boot),
            },
        };
        self.write(RUNNING, None, boot)?;
        Ok(said)
    }

    /// Records how the program ends, in words and as the ground is told.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn end(&self, how: &str, ending: Ending) -> Result<()> {
        self.write(how, Some(ending), boot())
    }

    fn write(&self, state: &str, ending: Option<Ending>, boot: String) -> Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let record = Record { state: state.into(), ending, boot, process: std::process::id() };
        let text = toml::to_string(&record).map_err(|error| Error::Other(error.to_string()))?;
        let temporary = path.with_extension("new");
        fs::write(&temporary, text).map_err(access(&temporary, "write how the program ends"))?;
        fs::rename(&temporary, path).map_err(access(path, "replace the file of the last end"))
    }
}

/// How a run ended that has left this: in a sentence, and as the ground is told.
fn told(last: &Record, boot: &str) -> (String, Ending) {
    match last.state.as_str() {
        RUNNING if last.boot == boot => (
            format!(
                "the last run's guardian (process {}) was killed; the loop, if it was alive, idled the outputs",
                last.process
            ),
            Ending::GuardianKilled,
        ),
        RUNNING => {
            ("the machine stopped during the last run: power lost, or reset".into(), Ending::ComputerStopped)
        }
        how => (format!("the last run ended: {how}"), last.ending.unwrap_or(Ending::Unknown)),
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
        let begun = |words: &str, told: Ending| {
            let (sentence, ending) = kept.begin().unwrap();
            assert!(sentence.contains(words), "{sentence}");
            assert_eq!(ending, told, "{sentence}");
        };
        begun("first start", Ending::Unknown);
        // It still says running.
        begun("guardian", Ending::GuardianKilled);
        kept.end("the loop was killed by signal 9", Ending::LoopDied).unwrap();
        begun("the last run ended: the loop was killed by signal 9", Ending::LoopDied);
        let text = fs::read_to_string(&path).unwrap().replace(&boot(), "another");
        fs::write(&path, text).unwrap();
        begun("power lost", Ending::ComputerStopped);
        fs::write(&path, "x").unwrap();
        begun("not readable", Ending::Unknown);
        let nowhere = LastEnd::new(Some("/nonexistent/last-end.toml".into()));
        assert!(nowhere.begin().unwrap_err().to_string().contains("/nonexistent"));
    }
}
