//! Violations of the rules about files that are known and may only become fewer.
//!
//! The list is `xtask/known-violations.txt`, a line each: what kind, and what it is about. An entry that is no longer
//! violated is an error itself, so that what has been mended stays mended. `cargo xtask known` deletes such entries.

use std::collections::BTreeSet;
use std::fmt;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::base::workspace;

/// What kind of rule is violated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// Files that use each other in a loop: all of them.
    Circle,
    /// One folder uses another and may not: crate, from, to.
    FolderArrow,
    /// A folder without a row in the table, or a row without a folder: crate, folder.
    Folder,
    /// A file that is too long, and its length.
    LongFile,
    /// A function that is too long, and its length.
    LongFunction,
}

impl Kind {
    const ALL: [(Self, &'static str); 5] = [
        (Self::Circle, "circle"),
        (Self::FolderArrow, "folder-arrow"),
        (Self::Folder, "folder"),
        (Self::LongFile, "long-file"),
        (Self::LongFunction, "long-function"),
    ];

    fn word(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, word)| word)
    }
}

/// A violation, without the words about it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Entry {
    pub(crate) kind: Kind,
    pub(crate) subject: Vec<String>,
    /// How long it is; 0 where nothing is measured.
    pub(crate) lines: usize,
}

impl Entry {
    /// Reads a line of the list.
    fn parse(line: &str) -> Result<Self> {
        let mut words: Vec<String> = line.split_whitespace().map(ToOwned::to_owned).collect();
        let named = words.first().and_then(|first| Kind::ALL.iter().find(|(_, word)| word == first));
        let Some((kind, _)) = named else { bail!("{line:?} names no rule") };
        words.remove(0);
        let measured = matches!(kind, Kind::LongFile | Kind::LongFunction);
        let lines = if measured { words.pop().unwrap_or_default() } else { "0".to_owned() };
        let lines = lines.parse().with_context(|| format!("{line:?} does not end with a number of lines"))?;
        Ok(Self { kind: *kind, subject: words, lines })
    }

    /// Is it the same thing? A circle that has shrunk is; so is a function that has grown.
    fn is_about(&self, found: &Self) -> bool {
        let inside = || found.subject.iter().all(|file| self.subject.contains(file));
        self.kind == found.kind && (self.subject == found.subject || (self.kind == Kind::Circle && inside()))
    }

    /// Does the list excuse what was found?
    pub(crate) fn covers(&self, found: &Self) -> bool {
        self.is_about(found) && found.lines <= self.lines
    }
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.kind.word(), self.subject.join(" "))?;
        if self.lines > 0 { write!(f, " {}", self.lines) } else { Ok(()) }
    }
}

/// A violation and the line that tells of it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Violation {
    pub(crate) entry: Entry,
    pub(crate) message: String,
}

/// The list, from the top folder.
pub(crate) const LIST: &str = "xtask/known-violations.txt";

const HEAD: &str = "\
# Violations of the rules about circles, folders and lengths that are known. The list may only become shorter;
# `cargo xtask known` deletes the entries that have been mended.
";

fn path() -> PathBuf {
    workspace::root().join(LIST)
}

/// Reads the list; an absent one is empty.
pub(crate) fn read() -> Result<Vec<Entry>> {
    match std::fs::read_to_string(path()) {
        Ok(text) => parse(&text),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error).with_context(|| format!("cannot read {LIST}")),
    }
}

/// Writes the list.
pub(crate) fn write(entries: &BTreeSet<Entry>) -> Result<()> {
    let lines: String = entries.iter().map(|entry| format!("{entry}\n")).collect();
    std::fs::write(path(), format!("{HEAD}{lines}")).with_context(|| format!("cannot write {LIST}"))
}

fn parse(text: &str) -> Result<Vec<Entry>> {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(Entry::parse).collect::<Result<_>>().with_context(|| format!("cannot understand {LIST}"))
}

/// Violations that are not known, and known ones that are gone.
pub(crate) fn compare(kinds: &[Kind], found: &[Violation], known: &[Entry]) -> Vec<String> {
    let unknown = |violation: &&Violation| !known.iter().any(|entry| entry.covers(&violation.entry));
    let mut problems: Vec<String> =
        found.iter().filter(unknown).map(|violation| violation.message.clone()).collect();
    for entry in known.iter().filter(|entry| kinds.contains(&entry.kind)) {
        if !found.iter().any(|violation| entry.is_about(&violation.entry)) {
            problems.push(format!(
                "{LIST}: `{entry}` is fixed: delete the line, or let `cargo xtask known` do it"
            ));
        }
    }
    problems
}

/// The list as it is now: what was found and is known, and with `add` whatever was found.
pub(crate) fn kept(found: &[Entry], known: &[Entry], add: bool) -> BTreeSet<Entry> {
    let stays = |entry: &&Entry| add || known.iter().any(|known| known.covers(entry));
    found.iter().filter(stays).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(lines: &[&str]) -> Vec<Entry> {
        parse(&lines.join("\n")).unwrap()
    }

    fn found(line: &str) -> Vec<Violation> {
        vec![Violation { entry: Entry::parse(line).unwrap(), message: format!("message: {line}") }]
    }

    const KINDS: [Kind; 2] = [Kind::Circle, Kind::LongFunction];

    #[test]
    fn a_line_is_read_as_it_is_written() {
        for line in ["circle a.rs b.rs", "folder-arrow model effects .", "long-function a.rs A::b 61"] {
            assert_eq!(Entry::parse(line).unwrap().to_string(), line);
        }
        assert!(Entry::parse("long-function a.rs b").unwrap_err().to_string().contains("number of lines"));
        assert!(Entry::parse("odd a.rs").is_err());
        assert_eq!(list(&["# a comment", "", "folder model gone"]).len(), 1);
    }

    #[test]
    fn what_is_known_passes_and_what_is_new_does_not() {
        let known = list(&["long-function a.rs f 70"]);
        assert!(compare(&KINDS, &found("long-function a.rs f 70"), &known).is_empty());
        assert!(compare(&KINDS, &found("long-function a.rs f 65"), &known).is_empty());
        let grown = compare(&KINDS, &found("long-function a.rs f 71"), &known);
        assert_eq!(grown, ["message: long-function a.rs f 71"]);
    }

    #[test]
    fn what_is_mended_has_to_leave_the_list() {
        let known = list(&["long-function a.rs f 70"]);
        let problems = compare(&KINDS, &[], &known);
        assert_eq!(problems.len(), 1);
        assert!(problems[0].contains("`long-function a.rs f 70` is fixed"), "{problems:?}");
        assert!(compare(&[Kind::Circle], &[], &known).is_empty(), "another step's business");
    }

    #[test]
    fn a_known_circle_may_shrink_and_not_grow() {
        let known = list(&["circle a.rs b.rs c.rs"]);
        assert!(compare(&KINDS, &found("circle a.rs c.rs"), &known).is_empty());
        assert_eq!(compare(&KINDS, &found("circle a.rs b.rs c.rs d.rs"), &known).len(), 2);
        assert_eq!(compare(&KINDS, &[], &known).len(), 1);
    }

    #[test]
    fn the_list_takes_in_new_entries_only_when_told() {
        let now = list(&["long-function a.rs f 65", "long-function b.rs g 80"]);
        let known = list(&["long-function a.rs f 70", "circle a.rs b.rs"]);
        let lines = |add| kept(&now, &known, add).iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(lines(false), ["long-function a.rs f 65"]);
        assert_eq!(lines(true), ["long-function a.rs f 65", "long-function b.rs g 80"]);
    }
}
