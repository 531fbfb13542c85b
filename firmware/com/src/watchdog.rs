//! The two watchdogs behind the guardian: the board's, which resets it, and systemd's, which starts
//! the program anew.
//!
//! `/dev/watchdog` begins to count when it is opened; any byte feeds it, and only a `V` before it
//! is closed stops it ("magic close": Linux, Documentation/watchdog/watchdog-api.rst). So if the
//! guardian is killed the board is reset, and comes up disarmed. Its time is the driver's
//! (`/sys/class/watchdog/watchdog0/timeout`). The kernel's usual one is used wherever there is one;
//! a configuration names another, or `"none"`.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sd_notify::NotifyState;

use crate::error::{Result, access, log};

/// How often the board's watchdog is fed. The usual timeouts are 10 s to 60 s, the shortest 1 s.
const FEED_EVERY: Duration = Duration::from_millis(200);

/// The kernel's first watchdog.
const USUAL: &str = "/dev/watchdog";

/// Which watchdog of the board is fed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BoardWatchdog {
    /// The usual one, if there is one and it can be had.
    Usual,
    /// This one; without it the program does not start.
    Named(PathBuf),
    /// None.
    Off,
}

impl BoardWatchdog {
    /// By the configuration's word, in its folder.
    pub(crate) fn of(word: Option<&Path>, folder: &Path) -> Self {
        match word {
            None => Self::Usual,
            Some(word) if word == Path::new("none") => Self::Off,
            Some(path) => Self::Named(folder.join(path)),
        }
    }
}

/// Both watchdogs; each only if there is one.
#[derive(Debug)]
pub struct Watchdogs {
    board: Option<File>,
    fed: Option<Instant>,
    systemd_every: Option<Duration>,
    told: Option<Instant>,
    ready: bool,
}

impl Watchdogs {
    /// Opens the board's watchdog, and checks whether systemd expects signs of life.
    ///
    /// # Errors
    /// A watchdog that is named and cannot be opened.
    pub fn open(board: &BoardWatchdog) -> Result<Self> {
        let board = match board {
            BoardWatchdog::Off => None,
            BoardWatchdog::Named(path) => Some(open(path)?),
            BoardWatchdog::Usual => usual(Path::new(USUAL)),
        };
        // A third of what systemd allows leaves room for one that goes missing.
        let systemd_every = sd_notify::watchdog_enabled().map(|timeout| timeout / 3);
        Ok(Self { board, fed: None, systemd_every, told: None, ready: false })
    }

    /// The loop is alive: feeds both watchdogs if it is time.
    pub fn feed(&mut self, now: Instant) {
        let due = |last: Option<Instant>, every| last.is_none_or(|last| now.duration_since(last) >= every);
        if let Some(board) = self.board.as_mut().filter(|_| due(self.fed, FEED_EVERY)) {
            let _ = board.write_all(b"\0");
            self.fed = Some(now);
        }
        if !self.ready {
            self.ready = true;
            notify(&[NotifyState::Ready, NotifyState::Status("100 Hz loop running")]);
        }
        if self.systemd_every.is_some_and(|every| due(self.told, every)) {
            notify(&[NotifyState::Watchdog]);
            self.told = Some(now);
        }
    }

    /// The outputs are idle and stay so: stops the watchdog, no reset is needed.
    pub fn close(mut self) {
        if let Some(board) = &mut self.board
            && let Err(error) = board.write_all(b"V")
        {
            log(&format!("the watchdog cannot be stopped ({error}) and will reset the board"));
        }
        notify(&[NotifyState::Stopping]);
    }
}

fn open(path: &Path) -> Result<File> {
    let file = OpenOptions::new().write(true).open(path);
    file.map_err(access(path, "open the watchdog; is another program feeding it?"))
}

/// The watchdog that is there, or a line that says what goes without it.
fn usual(path: &Path) -> Option<File> {
    if !path.exists() {
        log(&format!(
            "no watchdog of the board ({}): if the kernel stops, nothing resets it",
            path.display()
        ));
        return None;
    }
    open(path)
        .inspect_err(|error| {
            log(&format!(
                "the board's watchdog is not used: {error}; \"none\" in [guardian] watchdog if that is meant"
            ));
        })
        .ok()
}

/// Without systemd this does nothing.
fn notify(state: &[NotifyState]) {
    let _ = sd_notify::notify(state);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_board_is_fed_now_and_then_and_stopped_by_the_magic_letter() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("watchdog");
        std::fs::write(&path, "").unwrap();
        let mut watchdogs = Watchdogs::open(&BoardWatchdog::Named(path.clone())).unwrap();
        let start = Instant::now();
        for tick in 0..100 {
            watchdogs.feed(start + Duration::from_millis(10 * tick));
        }
        let fed = std::fs::read(&path).unwrap();
        assert_eq!(fed, [0; 5], "at 0, 200, 400, 600, 800 ms");
        watchdogs.close();
        assert_eq!(std::fs::read(&path).unwrap(), [0, 0, 0, 0, 0, b'V']);
        let none =
            Watchdogs::open(&BoardWatchdog::Named(folder.path().join("none"))).unwrap_err().to_string();
        assert!(none.contains("none: cannot open the watchdog"), "{none}");
    }

    #[test]
    fn the_usual_watchdog_is_used_where_there_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("watchdog");
        assert!(usual(&path).is_none(), "there is none");
        std::fs::write(&path, "").unwrap();
        assert!(usual(&path).is_some());
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert!(usual(&path).is_none(), "it cannot be opened, and the craft flies without it");
    }

    #[test]
    fn the_configuration_says_which() {
        let of = |word: Option<&str>| BoardWatchdog::of(word.map(Path::new), Path::new("/etc/quadlab"));
        assert_eq!((of(None), of(Some("none"))), (BoardWatchdog::Usual, BoardWatchdog::Off));
        assert_eq!(of(Some("/dev/watchdog1")), BoardWatchdog::Named("/dev/watchdog1".into()));
        assert_eq!(of(Some("dog")), BoardWatchdog::Named("/etc/quadlab/dog".into()));
    }

    /// What is dropped without a close leaves the board's watchdog counting.
    #[test]
    fn a_guardian_that_is_gone_writes_no_magic_letter() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("watchdog");
        std::fs::write(&path, "").unwrap();
        let mut watchdogs = Watchdogs::open(&BoardWatchdog::Named(path.clone())).unwrap();
        watchdogs.feed(Instant::now());
        drop(watchdogs);
        assert_eq!(std::fs::read(&path).unwrap(), [0]);
    }
}
