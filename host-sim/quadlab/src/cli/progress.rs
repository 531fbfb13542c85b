//! Progress on standard error: a bar where a person watches, a plain line now and then where no terminal is (a log, a pipe),
//! nothing with `--json`.

use std::sync::{Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Shorter work needs no line.
const FIRST_LINE: Duration = Duration::from_secs(10);
/// Between one line and the next.
const NEXT_LINE: Duration = Duration::from_secs(30);

/// Between one look at whether a line is due and the next.
const LOOK: Duration = Duration::from_millis(500);

/// How far a piece of work is.
pub(crate) struct Progress {
    bar: ProgressBar,
    /// Where there is no bar to see.
    lines: Option<Mutex<Lines>>,
}

/// When the steps that are counted now began, and when the next line is due.
struct Lines {
    began: Instant,
    due: Instant,
}

/// Work of so many steps, of which what is done is set.
pub(crate) fn bar(steps: usize, json: bool) -> Progress {
    Progress::new(ProgressBar::new(steps as u64), "{bar:20} {pos} of {len}, about {eta} left  {msg}", json)
}

/// Work whose number of steps is not known.
pub(crate) fn spinner(json: bool) -> Progress {
    let progress = Progress::new(ProgressBar::new_spinner(), "{spinner} {elapsed} {msg}", json);
    if progress.lines.is_none() {
        progress.bar.enable_steady_tick(Duration::from_millis(100));
    }
    progress
}

/// Does long work that cannot say how far it is, and shows that it goes on.
pub(crate) fn during<T>(message: &str, json: bool, work: impl FnOnce() -> T) -> T {
    let progress = spinner(json);
    progress.set_message(message);
    let made = std::thread::scope(|scope| {
        let (working, ended) = mpsc::channel::<()>();
        let progress = &progress;
        scope.spawn(move || {
            while ended.recv_timeout(LOOK) == Err(mpsc::RecvTimeoutError::Timeout) {
                progress.line();
            }
        });
        let made = work();
        drop(working);
        made
    });
    progress.finish_and_clear();
    made
}

impl Progress {
    fn new(bar: ProgressBar, template: &str, json: bool) -> Self {
        if json {
            return Self { bar: ProgressBar::hidden(), lines: None };
        }
        let style =
            ProgressStyle::with_template(template).expect("the template in the source is well-formed");
        let bar = bar.with_style(style);
        let now = Instant::now();
        let lines = bar.is_hidden().then(|| Mutex::new(Lines { began: now, due: now + FIRST_LINE }));
        Self { bar, lines }
    }

    /// Says what is being done.
    pub(crate) fn set_message(&self, message: impl Into<String>) {
        self.bar.set_message(message.into());
        self.line();
    }

    /// When the next plain line is due.
    pub(crate) fn next_line(&self) -> Option<Instant> {
        let lines = self.lines.as_ref()?;
        Some(lines.lock().unwrap_or_else(PoisonError::into_inner).due)
    }

    /// With the next plain line due when that of the work before was: work in many short parts is long work.
    pub(crate) fn due(self, due: Option<Instant>) -> Self {
        if let (Some(lines), Some(due)) = (&self.lines, due) {
            lines.lock().unwrap_or_else(PoisonError::into_inner).due = due;
        }
        self
    }

    /// Says what is being done, as a step of so many.
    pub(crate) fn set_activity(&self, activity: &str, done: u64, all: u64) {
        self.bar.set_message(activity.to_owned());
        self.set_steps(done, all);
    }

    /// So many of so many steps are done. Steps of another number, or fewer than were done, are other ones: what is left is
    /// then told by how long those take.
    fn set_steps(&self, done: u64, all: u64) {
        let are_others = self.bar.length() != Some(all) || done < self.bar.position();
        self.bar.set_length(all);
        self.bar.set_position(done);
        if are_others {
            self.bar.reset_eta();
            if let Some(lines) = &self.lines {
                lines.lock().unwrap_or_else(PoisonError::into_inner).began = Instant::now();
            }
        }
        self.line();
    }

    /// Prints in place of the bar, which comes back afterwards.
    pub(crate) fn suspend(&self, print: impl FnOnce()) {
        self.bar.suspend(print);
    }

    /// The work is done.
    pub(crate) fn finish_and_clear(&self) {
        self.bar.finish_and_clear();
    }

    /// A plain line, if one is due.
    fn line(&self) {
        let Some(lines) = &self.lines else { return };
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        if now >= lines.due {
            lines.due = now + NEXT_LINE;
            let elapsed = now - lines.began;
            eprintln!("{}", told(&self.bar.message(), self.bar.position(), self.bar.length(), elapsed));
        }
    }
}

/// "flying: 3 of 12, about 40 s left", or "fitting: 40 s so far" where nobody knows how many steps there are.
fn told(message: &str, done: u64, steps: Option<u64>, elapsed: Duration) -> String {
    let seconds = elapsed.as_secs_f64();
    match steps {
        Some(steps) if done > 0 => {
            let left = seconds * steps.saturating_sub(done) as f64 / done as f64;
            format!("{message}: {done} of {steps}, about {left:.0} s left")
        }
        Some(steps) => format!("{message}: {done} of {steps}"),
        None => format!("{message}: {seconds:.0} s so far"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_how_far_it_is_and_how_long_it_takes() {
        let after = |seconds| Duration::from_secs(seconds);
        assert_eq!(told("flying", 3, Some(12), after(12)), "flying: 3 of 12, about 36 s left");
        assert_eq!(told("flying", 0, Some(12), after(12)), "flying: 0 of 12");
        assert_eq!(told("trying tether", 7, None, after(41)), "trying tether: 41 s so far");
    }

    #[test]
    fn a_line_is_due_after_a_while_and_then_seldom() {
        // Tests have no terminal on standard error, or else a bar.
        let progress = bar(3, false);
        let Some(lines) = &progress.lines else { return };
        progress.set_steps(1, 3);
        assert!(lines.lock().unwrap().due <= Instant::now() + FIRST_LINE);
        lines.lock().unwrap().due = Instant::now();
        progress.set_steps(2, 3);
        assert!(lines.lock().unwrap().due > Instant::now() + FIRST_LINE);
    }

    #[test]
    fn what_is_left_of_other_steps_is_counted_from_their_beginning() {
        let progress = bar(3, false);
        let Some(lines) = &progress.lines else { return };
        let began = || lines.lock().unwrap().began;
        let first = began();
        progress.set_steps(1, 3);
        progress.set_steps(2, 3);
        assert_eq!(began(), first);
        progress.set_steps(0, 3);
        let second = began();
        assert!(second > first);
        progress.set_steps(0, 4);
        assert!(began() > second);
    }

    #[test]
    fn work_beside_a_spinner_gives_what_it_made() {
        assert_eq!(during("counting", false, || 6 * 7), 42);
        assert_eq!(during("counting", true, || 6 * 7), 42);
    }

    #[test]
    fn with_json_there_is_nothing() {
        let progress = spinner(true);
        assert!(progress.lines.is_none() && progress.bar.is_hidden());
    }
}
