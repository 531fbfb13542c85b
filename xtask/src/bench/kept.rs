//! Figures by commit: a JSON file for each, and a page with all of them side by side, the newest first.
//!
//! Figures of one commit that are measured in several runs, each of another bench, come together in its file.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use super::figures::{Comparison, Figures, Instructions, Row, grouped, rounded};
use crate::base::process::output_of;
use crate::base::workspace;

/// The page beside the files.
const PAGE: &str = "speed.md";
/// Commits that the page has room for.
const SHOWN: usize = 6;

/// What was measured of a commit.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Kept {
    /// The first digits of its hash; with `-changed` where files differed from it.
    commit: String,
    /// When it was committed, in ISO 8601.
    committed: String,
    /// What it was measured on.
    processor: String,
    figures: Figures,
}

impl Kept {
    /// Room in a folder for figures of the files as they are now: what is wrong with either is told before anything is measured.
    pub(super) fn begun(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        read_all(folder)?;
        Self::now()
    }

    /// The files as they are now, without figures.
    fn now() -> Result<Self> {
        let git = |arguments: &[&str]| {
            output_of(Command::new("git").current_dir(workspace::root()).args(arguments))
                .with_context(|| "`git` names no commit here: measure in a clone of the repository")
        };
        let head = git(&["rev-parse", "--short=10", "HEAD"])?;
        let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
        let mark = if changed.trim().is_empty() { "" } else { "-changed" };
        Ok(Self {
            commit: format!("{}{mark}", head.trim()),
            committed: git(&["show", "--no-patch", "--format=%cI", "HEAD"])?.trim().to_owned(),
            processor: processor(),
            figures: Figures::default(),
        })
    }

    /// With what was measured of these files.
    pub(super) fn of(self, figures: Figures) -> Self {
        Self { figures, ..self }
    }

    /// Puts these into a folder that is there, and writes its page anew; the file.
    pub(super) fn keep(mut self, folder: &Path) -> Result<PathBuf> {
        let file = folder.join(format!("{}.json", self.commit));
        let mut all = read_all(folder)?;
        if let Some(before) = all.iter().position(|kept| kept.commit == self.commit) {
            self.figures = all.remove(before).figures.with(self.figures);
        }
        write_whole(&file, &(serde_json::to_string_pretty(&self)? + "\n"))?;
        all.push(self);
        all.sort_by(|one, other| other.committed.cmp(&one.committed).then(other.commit.cmp(&one.commit)));
        write_whole(&folder.join(PAGE), &page(&all[..all.len().min(SHOWN)]))?;
        Ok(file)
    }
}

impl Figures {
    /// These, with newer ones in the place of older ones of the same name.
    fn with(mut self, newer: Self) -> Self {
        self.rows.retain(|row| newer.rows.iter().all(|new| new.name() != row.name()));
        let is_same =
            |one: &Comparison, other: &Comparison| (&one.work, &one.peer) == (&other.work, &other.peer);
        self.comparisons.retain(|own| newer.comparisons.iter().all(|new| !is_same(own, new)));
        self.rows.extend(newer.rows);
        self.comparisons.extend(newer.comparisons);
        self
    }
}

/// Every file of a folder.
fn read_all(folder: &Path) -> Result<Vec<Kept>> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let text =
                std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let about = || format!("{} holds no figures of this command: take it away", path.display());
            all.push(serde_json::from_str(&text).with_context(about)?);
        }
    }
    Ok(all)
}

/// A file that is there whole or not at all.
fn write_whole(path: &Path, text: &str) -> Result<()> {
    let about = || format!("cannot write {}", path.display());
    let folder = path.parent().with_context(about)?;
    let mut file = tempfile::NamedTempFile::new_in(folder).with_context(about)?;
    file.write_all(text.as_bytes()).with_context(about)?;
    file.persist(path).map(drop).with_context(about)
}

/// The processor's name, as the system gives it.
fn processor() -> String {
    let about = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = about.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim().to_owned());
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// The page of some commits.
fn page(all: &[Kept]) -> String {
    let tables = [
        (
            "## Beside other programs",
            "Ours over theirs, in turn on the same core; in brackets ours per CPU-second.",
            against(all),
        ),
        ("## Throughput", "Per second of one core, each run in a fresh process.", throughput(all)),
        (
            "## Instructions",
            "Counted by valgrind; in brackets the change since the commit before.",
            instructions(all),
        ),
    ];
    let mut text = "# Speed by commit\n\n`cargo xtask bench --against FOLDER --keep FOLDER` writes this page. Ratios and instruction \
                    counts hold on any machine of the kind, times only on the one that is named.\n\n"
        .to_owned();
    for kept in all {
        let day = kept.committed.get(..10).unwrap_or_default();
        text += &format!("- `{}` of {day}, on {}\n", kept.commit, kept.processor);
    }
    for (heading, words, table) in tables {
        if let Some(table) = table {
            text += &format!("\n{heading}\n\n{words}\n\n{table}");
        }
    }
    text
}

fn against(all: &[Kept]) -> Option<String> {
    let cell = |own: &Comparison| format!("{:.2} ({})", own.ratio, rounded(own.ours));
    let name = |own: &Comparison| format!("{}, beside {}", own.work, own.peer);
    let column = |kept: &Kept| kept.figures.comparisons.iter().map(|own| (name(own), cell(own))).collect();
    side_by_side(all, column)
}

fn throughput(all: &[Kept]) -> Option<String> {
    let cell = |row: &Row| row.rate.as_ref().map(|(rate, work)| (work.clone(), rounded(*rate)));
    side_by_side(all, |kept| kept.figures.rows.iter().filter_map(cell).collect())
}

fn instructions(all: &[Kept]) -> Option<String> {
    let of = |kept: &Kept, name: &str| {
        let row = kept.figures.rows.iter().find(|row| row.name() == name);
        row.and_then(|row| row.instructions).map(|count| count.now)
    };
    let cell = |kept: &Kept, row: &Row| {
        let (now, name) = (row.instructions?.now, row.name());
        let mut older = all.iter().skip_while(|other| other.commit != kept.commit).skip(1);
        let count = Instructions { now, before: older.find_map(|older| of(older, &name)) };
        let change = count.percent().map(|percent| format!(" ({percent:+.1} %)")).unwrap_or_default();
        Some((name, format!("{}{change}", grouped(now as f64))))
    };
    side_by_side(all, |kept| kept.figures.rows.iter().filter_map(|row| cell(kept, row)).collect())
}

/// A table in Markdown: a row for each name, a column for each commit; nothing without a figure.
fn side_by_side(all: &[Kept], column: impl Fn(&Kept) -> BTreeMap<String, String>) -> Option<String> {
    let columns: Vec<BTreeMap<String, String>> = all.iter().map(column).collect();
    let mut names: Vec<&String> = columns.iter().flat_map(BTreeMap::keys).collect();
    names.sort_unstable();
    names.dedup();
    names.first()?;
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let heads = std::iter::once(String::new()).chain(all.iter().map(|kept| format!("`{}`", kept.commit)));
    let mut text = line(heads.collect()) + &line(vec!["---".into(); all.len() + 1]);
    for name in names {
        let cells = columns.iter().map(|column| column.get(name).cloned().unwrap_or_default());
        text += &line(std::iter::once(name.clone()).chain(cells).collect());
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::super::figures::Throughput;
    use super::*;

    fn kept(commit: &str, day: u32, count: u64, seconds: f64) -> Kept {
        let mut figures = Figures::default();
        let run = |cpu_s: f64| [Throughput { work: "steps".into(), amount: 3e6, cpu_s }];
        figures.add_instructions(
            "tick_instructions",
            "pid".into(),
            Instructions { now: count, before: None },
        );
        figures.add_throughput("flight_throughput", &run(seconds));
        figures.add_comparison("C", &run(seconds), &run(1.0));
        let committed = format!("2026-11-{day:02}T10:00:00+00:00");
        Kept { commit: commit.into(), committed, processor: "a processor".into(), figures }
    }

    #[test]
    fn the_page_has_every_commit_the_newest_first() {
        let folder = tempfile::tempdir().unwrap();
        for one in [kept("older", 1, 1000, 2.0), kept("newer", 3, 900, 1.5), kept("between", 2, 1000, 2.0)] {
            one.keep(folder.path()).unwrap();
        }
        let text = std::fs::read_to_string(folder.path().join(PAGE)).unwrap();
        assert!(text.contains("|  | `newer` | `between` | `older` |\n| --- | --- | --- | --- |\n"), "{text}");
        assert!(text.contains("| tick pid | 900 (-10.0 %) | 1,000 (+0.0 %) | 1,000 |\n"), "{text}");
        assert!(text.contains("| steps | 2,000,000 | 1,500,000 | 1,500,000 |\n"), "{text}");
        assert!(
            text.contains("| steps, beside C | 0.67 (2,000,000) | 0.50 (1,500,000) | 0.50 (1,500,000) |\n"),
            "{text}"
        );
    }

    #[test]
    fn runs_of_one_commit_come_together_and_the_newest_holds() {
        let folder = tempfile::tempdir().unwrap();
        kept("one", 1, 1000, 2.0).keep(folder.path()).unwrap();
        let mut again = kept("one", 1, 800, 2.0);
        again.figures.comparisons.clear();
        again.figures.rows.truncate(1);
        let file = again.keep(folder.path()).unwrap();
        let all = read_all(folder.path()).unwrap();
        assert_eq!((all.len(), file.file_name().unwrap().to_str()), (1, Some("one.json")));
        let figures = &all[0].figures;
        assert_eq!((figures.rows.len(), figures.comparisons.len()), (2, 1));
        assert!(figures.rows.iter().any(|row| row.instructions.is_some_and(|count| count.now == 800)));
    }

    #[test]
    fn another_file_in_the_folder_is_named_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("other.json"), "{}").unwrap();
        let why = kept("one", 1, 1000, 2.0).keep(folder.path()).unwrap_err().to_string();
        assert!(why.contains("other.json holds no figures"), "{why}");
        assert!(!folder.path().join(PAGE).exists() && !folder.path().join("one.json").exists());
    }

    #[test]
    fn figures_are_of_the_commit_that_is_checked_out() {
        let Ok(now) = Kept::now() else { return };
        assert!(now.commit.len() >= 10 && now.committed.len() >= 19, "{now:?}");
    }
}
