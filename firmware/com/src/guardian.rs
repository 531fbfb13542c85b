//! Two processes, so that the motors idle whichever way the program ends.
//!
//! ```text
//!   guardian (what systemd knows)                    loop (its child)
//!     holds the outputs                                holds the same outputs
//!     feeds the watchdogs     <--- one byte a tick ---   100 Hz loop
//!                             --- its end, or "s" ---->  sees that the guardian is gone, or wants it to stop
//! ```
//!
//! - The loop dies in whatever way (return, panic, SIGKILL): the kernel closes its end of the pipe;
//!   the guardian idles the outputs at once.
//! - The loop hangs (SIGSTOP, an endless loop, a dead lock): no byte for [`Terms::silence`]; the
//!   guardian idles the outputs, kills the loop, and idles them again, since the loop may have
//!   written in between.
//! - The guardian dies: its end of the pipe closes, and the loop idles the outputs in its next
//!   tick. The board's watchdog, which only the guardian feeds, then resets the board.
//! - Both are killed at the same moment: only the board's watchdog is left.
//! - SIGTERM or SIGINT: the guardian asks the loop to stop, which idles the outputs itself. SIGHUP
//!   is ignored: a closed terminal is no reason to fall.
//!
//! The loop is started by `fork`, before there is any thread, and so shares what has been opened
//! and checked; no file has to be found again, even if the program has been replaced meanwhile. The
//! guardian never restarts the loop: a human or systemd starts a craft whose program died, and it
//! starts disarmed.

use std::fmt;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use fork::Fork;
use proto::Ending;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::{Errno, retry_on_intr};
use rustix::pipe::{PipeFlags, pipe_with};
use rustix::process::{Pid, Signal, WaitOptions, kill_process, waitpid};
use rustix::time::Timespec;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::error::{Error, Result, log, system};
use crate::last_end::LastEnd;
use crate::realtime;
use crate::watchdog::Watchdogs;

/// How long the loop's first sign of life may take: it opens ports and stores packet numbers first.
const START_PATIENCE: Duration = Duration::from_secs(10);
/// How long a loop that was asked to stop may take.
const STOP_PATIENCE: Duration = Duration::from_secs(1);
/// The guardian looks for signals this often even if the loop says nothing.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The rules of the guardian.
#[derive(Debug)]
pub struct Terms {
    /// So long without a sign of life is death.
    pub silence: Duration,
    /// The loop's real-time priority; the guardian's is one more, or a loop that never sleeps would
    /// keep it from looking.
    pub priority: u8,
    /// Where the end is written down.
    pub last_end: LastEnd,
}

/// How the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// It was asked to stop by SIGTERM or SIGINT, and did.
    Stopped,
    /// It returned by itself, with this status.
    Returned(i32),
    /// A signal ended it.
    Killed(i32),
    /// It gave no sign of life for this many ms.
    Silent(u128),
    /// It never gave a sign of life.
    NeverBegan,
}

impl End {
    /// As the ground is told at the next start.
    fn as_told(self) -> Ending {
        match self {
            Self::Stopped => Ending::Stopped,
            Self::Returned(_) | Self::Killed(_) | Self::Silent(_) | Self::NeverBegan => Ending::LoopDied,
        }
    }
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped => f.write_str("stopped by SIGTERM or SIGINT"),
            Self::Returned(status) => write!(f, "the loop ended with status {status}"),
            Self::Killed(signal) => write!(f, "the loop was killed by signal {signal}"),
            Self::Silent(ms) => write!(f, "the loop gave no sign of life for {ms} ms and was killed"),
            Self::NeverBegan => f.write_str("the loop did not start and was killed"),
        }
    }
}

/// What the loop has to do after a sign of life.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// Go on.
    Go,
    /// Idle the outputs and return.
    Stop,
    /// The guardian is gone: idle the outputs and return.
    Orphaned,
}

/// The loop's ends of the pipes.
#[derive(Debug)]
pub struct Heart {
    beats: OwnedFd,
    orders: OwnedFd,
}

impl Heart {
    /// Gives a sign of life and returns what to do. Never waits.
    pub fn beat(&mut self) -> Sign {
        // A full pipe means that the guardian has not looked for minutes; the other pipe says
        // whether it is alive.
        let _ = rustix::io::write(&self.beats, b".");
        let mut order = [0];
        match rustix::io::read(&self.orders, &mut order) {
            Ok(0) => Sign::Orphaned,
            Ok(_) => Sign::Stop,
            Err(_) => Sign::Go,
        }
    }
}

/// Runs `fly` in a child and watches it; `idle` idles the outputs. Returns in the guardian only.
///
/// # Errors
/// What keeps the child from being started.
pub fn watch(
    terms: Terms,
    mut watchdogs: Watchdogs,
    mut idle: impl FnMut() -> bool,
    fly: impl FnOnce(Heart) -> Result<()>,
) -> Result<End> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(system("listen for signals"))?;
    }
    // Registered so that it does not kill, and ignored.
    signal_hook::flag::register(SIGHUP, Arc::default()).map_err(system("listen for signals"))?;
    let pipe = || pipe_with(PipeFlags::CLOEXEC | PipeFlags::NONBLOCK).map_err(system("make a pipe"));
    let ((beats_out, beats_in), (orders_out, orders_in)) = (pipe()?, pipe()?);
    match fork::fork().map_err(system("start the loop's process"))? {
        Fork::Child => {
            drop((beats_out, orders_in));
            let status = run_loop(&terms.last_end, Heart { beats: beats_in, orders: orders_out }, fly);
            std::process::exit(status)
        }
        Fork::Parent(child) => {
            drop((beats_in, orders_out));
            let child =
                Pid::from_raw(child).ok_or_else(|| Error::Other("the loop has no process number".into()))?;
            let [scheduling, _] = realtime::ask_for(terms.priority + 1);
            log(&format!("guardian: {}", scheduling.replace("the loop's thread", "its thread")));
            let guard = Guard { child, beats: beats_out, orders: orders_in, stop, silence: terms.silence };
            let end = guard.until_the_end(&mut watchdogs, &mut idle);
            let idled = idle();
            if let Err(error) = terms.last_end.end(&end.to_string(), end.as_told()) {
                log(&error.to_string());
            }
            if idled {
                log(&format!("{end}; the outputs are idle"));
                watchdogs.close();
            } else {
                log(&format!("{end}; NOT ALL OUTPUTS COULD BE IDLED: disconnect the battery"));
            }
            Ok(end)
        }
    }
}

/// The child's life; its exit status.
fn run_loop(last_end: &LastEnd, heart: Heart, fly: impl FnOnce(Heart) -> Result<()>) -> i32 {
    match fly(heart) {
        Ok(()) => 0,
        Err(Error::Orphaned) => {
            log(&Error::Orphaned.to_string());
            let _ = last_end.end(&Error::Orphaned.to_string(), Ending::GuardianKilled);
            1
        }
        Err(error) => {
            log(&error.to_string());
            2
        }
    }
}

/// The guardian's ends of the pipes.
struct Guard {
    child: Pid,
    beats: OwnedFd,
    orders: OwnedFd,
    stop: Arc<AtomicBool>,
    silence: Duration,
}

/// What came over the pipe.
enum Heard {
    Beats,
    Nothing,
    End,
}

impl Guard {
    /// Watches until the loop has ended and has been waited for.
    fn until_the_end(self, watchdogs: &mut Watchdogs, idle: &mut impl FnMut() -> bool) -> End {
        let mut last = Instant::now();
        let mut patience = START_PATIENCE;
        let mut began = false;
        let mut stopping = false;
        loop {
            if !stopping && self.stop.load(Ordering::Relaxed) {
                stopping = true;
                let _ = rustix::io::write(&self.orders, b"s");
                (last, patience) = (Instant::now(), STOP_PATIENCE);
            }
            let left = (patience.saturating_sub(last.elapsed())).min(LOOK_EVERY);
            match self.listen(left) {
                Heard::End => {
                    idle();
                    let status = self.reap();
                    return if stopping && status == End::Returned(0) { End::Stopped } else { status };
                }
                Heard::Beats => {
                    let now = Instant::now();
                    watchdogs.feed(now);
                    if !stopping {
                        (last, patience, began) = (now, self.silence, true);
                    }
                }
                Heard::Nothing if last.elapsed() >= patience => {
                    idle();
                    let _ = kill_process(self.child, Signal::KILL);
                    self.reap();
                    return if began { End::Silent(last.elapsed().as_millis()) } else { End::NeverBegan };
                }
                Heard::Nothing => {}
            }
        }
    }

    /// Waits for signs of life, for a limited time.
    fn listen(&self, at_most: Duration) -> Heard {
        let timeout = Timespec { tv_sec: 0, tv_nsec: at_most.subsec_nanos() as _ };
        let mut pipes = [PollFd::from_borrowed_fd(self.beats.as_fd(), PollFlags::IN)];
        // Interrupted or refused: the read below shows it, and the next round waits.
        let _ = poll(&mut pipes, Some(&timeout));
        let mut bytes = [0; 64];
        match rustix::io::read(&self.beats, &mut bytes) {
            Ok(0) => Heard::End,
            Ok(_) => Heard::Beats,
            Err(Errno::AGAIN | Errno::INTR) => Heard::Nothing,
            Err(_) => Heard::End,
        }
    }

    /// Waits for the child, which has ended or is about to.
    fn reap(&self) -> End {
        match retry_on_intr(|| waitpid(Some(self.child), WaitOptions::empty())) {
            Ok(Some((_, status))) => match (status.exit_status(), status.terminating_signal()) {
                (Some(status), _) => End::Returned(status),
                (_, Some(signal)) => End::Killed(signal),
                _ => End::Returned(-1),
            },
            _ => End::Returned(-1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loop's ends of two pipes, and the guardian's.
    fn heart() -> (Heart, OwnedFd, OwnedFd) {
        let pipe = || pipe_with(PipeFlags::CLOEXEC | PipeFlags::NONBLOCK).unwrap();
        let ((beats_out, beats), (orders, orders_in)) = (pipe(), pipe());
        (Heart { beats, orders }, beats_out, orders_in)
    }

    #[test]
    fn a_beat_is_a_byte_and_brings_the_order_back() {
        let (mut heart, beats, orders) = heart();
        assert_eq!([heart.beat(), heart.beat()], [Sign::Go, Sign::Go]);
        let mut bytes = [0; 8];
        assert_eq!(rustix::io::read(&beats, &mut bytes), Ok(2), "one byte a tick");
        rustix::io::write(&orders, b"s").unwrap();
        assert_eq!([heart.beat(), heart.beat()], [Sign::Stop, Sign::Go]);
        drop(orders);
        assert_eq!(heart.beat(), Sign::Orphaned);
    }

    #[test]
    fn each_end_is_a_sentence() {
        assert_eq!(End::Killed(9).to_string(), "the loop was killed by signal 9");
        assert_eq!(End::Silent(81).to_string(), "the loop gave no sign of life for 81 ms and was killed");
    }
}
