//! Lines for people: each once, and a refusal that persists once in a while.

use std::collections::VecDeque;

use crate::recording::Level;

/// Lines that a view can show.
const REMEMBERED: usize = 200;
/// A refusal that persists is repeated after this, us.
const TOLD_AGAIN_US: u64 = 10_000_000;
/// Different refusals that are remembered: whoever sends junk cannot fill memory with it.
const REFUSALS: usize = 50;

/// A line for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// When, us of the ground's clock.
    pub at_us: u64,
    /// How serious it is.
    pub level: Level,
    /// The line.
    pub text: String,
}

/// The last lines, those that nobody has taken yet, and recent refusals.
#[derive(Debug, Clone, Default)]
pub(super) struct Notices {
    last: VecDeque<Notice>,
    untaken: VecDeque<Notice>,
    refusals: Vec<(String, u64)>,
}

impl Notices {
    /// Adds a line.
    pub(super) fn push(&mut self, notice: Notice) {
        self.last.push_back(notice.clone());
        self.untaken.push_back(notice);
        for lines in [&mut self.last, &mut self.untaken] {
            while lines.len() > REMEMBERED {
                lines.pop_front();
            }
        }
    }

    /// Is it time for a line about this refusal? Only once in a while, however often it comes.
    pub(super) fn is_news(&mut self, now_us: u64, refusal: &str) -> bool {
        self.refusals.retain(|(_, at_us)| at_us + TOLD_AGAIN_US > now_us);
        if self.refusals.len() >= REFUSALS || self.refusals.iter().any(|(told, _)| told == refusal) {
            return false;
        }
        self.refusals.push((refusal.into(), now_us));
        true
    }

    /// Lines that have not been taken yet.
    pub(super) fn take(&mut self) -> impl Iterator<Item = Notice> + use<'_> {
        self.untaken.drain(..)
    }

    /// The last lines, oldest first.
    pub(super) fn last(&self) -> Vec<Notice> {
        self.last.iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_is_news_again_after_ten_seconds_and_junk_is_forgotten() {
        let mut notices = Notices::default();
        assert!(notices.is_news(0, "late"));
        assert!(!notices.is_news(9_999_999, "late"));
        assert!(notices.is_news(10_000_000, "late"));
        let news = (0..200).filter(|k| notices.is_news(10_000_000, &k.to_string())).count();
        assert_eq!(news, REFUSALS - 1);
        assert!(notices.is_news(20_000_000, "another"));
    }

    #[test]
    fn lines_are_taken_once_and_the_last_stay() {
        let mut notices = Notices::default();
        for at_us in 0..250 {
            notices.push(Notice { at_us, level: Level::Info, text: String::new() });
        }
        assert_eq!(notices.take().count(), REMEMBERED);
        assert_eq!(notices.take().count(), 0);
        let last = notices.last();
        assert_eq!((last[0].at_us, last.len()), (50, REMEMBERED));
    }
}
