//! The two watchdogs behind the guardian: the board's, which resets it, and systemd's, which starts
//! the program anew.
//!
//! `/dev/watchdog` begins to count when it is opened; any byte feeds it, and only a `V` before it
//! is closed stops it ("magic close": Linux, Documentation/watchdog/watchdog-api.rst). So if the
//! guardian is killed the board is reset, and comes up disarmed. Its time is the driver's
//! (`/sys/class/watchdog/watchdog0/timeout`).

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use sd_notify::NotifyState;

use crate::error::{Result, access, log};

/// How often the board's watchdog is fed. The usual timeouts are 10 s to 60 s, the shortest 1 s.
const FEED_EVERY: Duration = Duration::from_millis(200);

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
    /// Opens the board's watchdog, if one is named, and checks whether systemd expects signs of
    /// life.
    ///
    /// # Errors
    /// A watchdog that is named and cannot be opened.
    pub fn open(board: Option<&Path>) -> Result<Self> {
        let open = |path: &Path| {
            let file = OpenOptions::new().write(true).open(path);
            file.map_err(access(path, "open the watchdog; is another program feeding it?"))
        };
        let board = board.map(open).transpose()?;
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
        let mut watchdogs = Watchdogs::open(Some(&path)).unwrap();
        let start = Instant::now();
        for tick in 0..100 {
            watchdogs.feed(start + Duration::from_millis(10 * tick));
        }
        let fed = std::fs::read(&path).unwrap();
        assert_eq!(fed, [0; 5], "at 0, 200, 400, 600, 800 ms");
        watchdogs.close();
        assert_eq!(std::fs::read(&path).unwrap(), [0, 0, 0, 0, 0, b'V']);
        let none = Watchdogs::open(Some(&folder.path().join("none"))).unwrap_err().to_string();
        assert!(none.contains("none: cannot open the watchdog"), "{none}");
    }

    /// What is dropped without a close leaves the board's watchdog counting.
    #[test]
    fn a_guardian_that_is_gone_writes_no_magic_letter() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("watchdog");
        std::fs::write(&path, "").unwrap();
        let mut watchdogs = Watchdogs::open(Some(&path)).unwrap();
        watchdogs.feed(Instant::now());
        drop(watchdogs);
        assert_eq!(std::fs::read(&path).unwrap(), [0]);
    }
}
