//! Colours of words on a terminal.
//!
//! Text is built with colours; what prints it takes them out where they are not wanted: in pipes and files, and with NO_COLOR set
//! (no-color.org). A colour only repeats what a word says.

use std::sync::OnceLock;

use anstyle::{AnsiColor, Style};

const GOOD: Style = AnsiColor::Green.on_default();
const BAD: Style = AnsiColor::Red.on_default().bold();
const DOUBT: Style = AnsiColor::Yellow.on_default().bold();
const SOFT: Style = Style::new().dimmed();
const LEAD: Style = Style::new().bold();

fn styled(style: Style, text: &str) -> String {
    format!("{style}{text}{style:#}")
}

/// "yes" and "no" of a table, with the spaces around them.
pub(crate) fn verdict(text: &str) -> String {
    styled(if text.trim() == "yes" { GOOD } else { SOFT }, text)
}

/// What a command concludes.
pub(crate) fn lead(text: &str) -> String {
    // A style ends with its line, so that a pager does not carry it on.
    text.lines().map(|line| styled(LEAD, line) + "\n").collect()
}

/// How much what is told matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Good to know.
    Note,
    /// Something may be wrong.
    Warning,
    /// An input was refused.
    Error,
}

/// Who is told in place of standard error.
static LISTENER: OnceLock<fn(Level, &str)> = OnceLock::new();

/// Has warnings, notes and errors told to a program that runs commands in its process, instead of printed. The first listener stays.
pub fn tell_to(listener: fn(Level, &str)) {
    let _ = LISTENER.set(listener);
}

fn tell(level: Level, text: &str) {
    if let Some(listener) = LISTENER.get() {
        return listener(level, text);
    }
    let (style, word) = match level {
        Level::Note => (SOFT, "note:"),
        Level::Warning => (DOUBT, "warning:"),
        Level::Error => (BAD, "error:"),
    };
    anstream::eprintln!("{} {text}", styled(style, word));
}

/// Prints `warning: ...` on standard error.
pub(crate) fn warn(text: &str) {
    tell(Level::Warning, &report::plain_line(text));
}

/// Prints `note: ...` on standard error.
pub(crate) fn note(text: &str) {
    tell(Level::Note, &report::plain_line(text));
}

/// Prints `error: ...` on standard error: one short line, whatever a file name or a field holds.
pub(crate) fn error(text: &str) {
    tell(Level::Error, &report::error_line(text));
}

/// `text` as standard output takes it: without colours, but on a terminal that has them.
pub(crate) fn for_stdout(text: &str) -> String {
    match anstream::AutoStream::choice(&std::io::stdout()) {
        anstream::ColorChoice::Never => plain(text),
        _ => text.to_owned(),
    }
}

fn plain(text: &str) -> String {
    anstream::adapter::strip_str(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_colours_the_words_remain() {
        let text = lead("The model lacks\nground-effect.") + &verdict("yes  ") + &verdict("no   ");
        assert!(text.contains("\u{1b}[32myes  \u{1b}[0m"), "{text:?}");
        assert_eq!(plain(&text), "The model lacks\nground-effect.\nyes  no   ");
    }

    #[test]
    fn no_style_runs_over_the_end_of_a_line() {
        assert!(lead("one\ntwo\n").lines().all(|line| line.ends_with("\u{1b}[0m")));
    }
}
