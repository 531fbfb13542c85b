//! Sentences about damage, a handful and a count of the rest; and other people's code that may panic on
//! damage.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use crate::error::plain;

/// Sentences that are kept.
const KEPT: usize = 5;
/// Longest sentence: names in a file can be as long as the file.
const LONGEST: usize = 300;

/// Damage found in a log.
#[derive(Debug, Default)]
pub(in crate::decode) struct Faults {
    sentences: Vec<String>,
    more: usize,
}

impl Faults {
    /// Adds a sentence, without control characters.
    pub(in crate::decode) fn say(&mut self, sentence: impl AsRef<str>) {
        if self.sentences.len() < KEPT {
            self.sentences.push(plain(sentence.as_ref(), LONGEST));
        } else {
            self.more += 1;
        }
    }

    /// The sentences, the last of which counts what is not said.
    pub(in crate::decode) fn into_sentences(mut self) -> Vec<String> {
        if self.more > 0 {
            self.sentences.push(format!("and {} more places are damaged", self.more));
        }
        self.sentences
    }
}

thread_local! {
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs somebody else's decoder, which may panic on damage: nothing then, and nothing is printed.
pub(in crate::decode) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |information| {
            if !QUIET.get() {
                before(information);
            }
        }));
    });
    let was_quiet = QUIET.replace(true);
    let result = catch_unwind(AssertUnwindSafe(decode)).ok();
    QUIET.set(was_quiet);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_handful_of_sentences_and_a_count() {
        let mut faults = Faults::default();
        (0..8).for_each(|k| faults.say(format!("row\n{k}")));
        let sentences = faults.into_sentences();
        assert_eq!(sentences.len(), 6);
        assert_eq!(sentences[0], "row?0");
        assert_eq!(sentences[5], "and 3 more places are damaged");
    }

    #[test]
    fn a_panic_is_a_missing_value() {
        assert_eq!(guarded(|| 3), Some(3));
        assert_eq!(guarded(|| Vec::<u8>::new()[0]), None);
    }
}
