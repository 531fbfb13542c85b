//! `cargo xtask docs`: the book, and what the user's program writes of itself.
//!
//! The book's sources are `host-sim/book/`. Man pages, shell completions, JSON Schemas and a page for each effect come
//! from the program, which knows its arguments, types and effects: `quadlab reference --out DIR` writes
//!
//! ```text
//! DIR/man/*.1  DIR/completions/*  DIR/schema/*.json  DIR/effects/*.md  DIR/effects/SUMMARY.md
//! ```
//!
//! `effects/SUMMARY.md` has a line `- [Name](effects/id.md)` for each page. The pages go into a copy of the book's
//! sources, below the page `effects/index.md`; the schemas go into its folder `schema`.

mod commands;
mod pages;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail, ensure};

use self::commands::{Checker, Help, commands};
use self::pages::{SUMMARY, Sources};
use crate::base::markdown::resolved;
use crate::base::process::{cargo, output_of, shown, succeeds};
use crate::base::tools::MDBOOK;
use crate::base::workspace;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for the output; the content of its folders book, man, completions and schema is replaced
    #[arg(long, value_name = "DIR", default_value = "target/docs")]
    out: PathBuf,
    /// Also check the book's links and commands, as `cargo xtask test` does
    #[arg(long)]
    check: bool,
}

/// The book's folder, from the top.
const BOOK: &str = "host-sim/book";
/// The page that the pages of single effects stand below.
const EFFECTS: &str = "effects/index.md";

/// Builds everything; status 1 when a check fails.
pub(crate) fn run(options: &Options) -> Result<ExitCode> {
    ensure!(MDBOOK.found().is_some(), "mdbook is not installed: {}", MDBOOK.install);
    let out = std::path::absolute(&options.out).context("the folder of --out has no absolute path")?;
    build(&out)?;
    for folder in ["book", "man", "completions", "schema"].map(|name| out.join(name)) {
        if folder.is_dir() {
            println!("{}", folder.display());
        }
    }
    let problems = if options.check { problems(&out)? } else { Vec::new() };
    for problem in &problems {
        println!("{problem}");
    }
    Ok(ExitCode::from(u8::from(!problems.is_empty())))
}

/// Builds the book; links and commands in it that lead nowhere.
pub(crate) fn check() -> Result<Vec<String>> {
    let out = workspace::root().join("target/docs");
    build(&out)?;
    problems(&out)
}

/// Links and commands of a built book that lead nowhere.
fn problems(out: &Path) -> Result<Vec<String>> {
    let sources = Sources::read(&staging(out).join("src"))?;
    let mut problems = sources.problems();
    let mut checker = Checker::new(Programs);
    for (page, text) in &sources.pages {
        for shown in commands(text) {
            let problem = checker.problem(&shown.words);
            problems.extend(problem.map(|problem| format!("{page}:{}: {problem}", shown.line)));
        }
    }
    Ok(problems.into_iter().map(|problem| format!("{BOOK}/src/{problem}")).collect())
}

/// Where the book's sources are put together: below a folder that stands for the top, since pages can include files from
/// there.
fn staging(out: &Path) -> PathBuf {
    out.join("sources").join(BOOK)
}

/// Builds all of it below `out`.
fn build(out: &Path) -> Result<()> {
    let sources = staging(out);
    let reference = out.join("reference");
    for folder in [&out.join("sources"), &reference, &out.join("book")] {
        removed(folder)?;
    }
    copy(&workspace::root().join(BOOK), &sources)?;
    copy_included(&workspace::root(), &out.join("sources"))?;
    reference_of_program(&reference)?;
    for name in ["man", "completions", "schema"] {
        removed(&out.join(name))?;
        copy(&reference.join(name), &out.join(name))?;
    }
    // Pages of the book link to the schemas.
    copy(&reference.join("schema"), &sources.join("src/schema"))?;
    with_effects(&sources.join("src"), &reference.join("effects"))?;
    make_book(&sources, &out.join("book"))
}

/// Runs mdBook. It goes on where it cannot include a file, and only says so.
fn make_book(sources: &Path, out: &Path) -> Result<()> {
    let mut mdbook = Command::new(MDBOOK.name);
    mdbook.arg("build").arg(sources).arg("--dest-dir").arg(out);
    let output = mdbook.output().context("cannot start mdbook")?;
    let said =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    let error = said.lines().find(|line| line.contains("ERROR"));
    if !output.status.success() || error.is_some() {
        bail!("`{}` failed: {}", shown(&mdbook), error.unwrap_or(said.trim()));
    }
    Ok(())
}

/// Copies what pages include from outside of the book: `{{#include ../../../README.md}}`.
fn copy_included(top: &Path, to: &Path) -> Result<()> {
    let sources = Sources::read(&top.join(BOOK).join("src"))?;
    for (page, text) in &sources.pages {
        for path in included(text) {
            let place = format!("{BOOK}/src/{page}");
            let Some(path) = resolved(&place, path).filter(|path| !path.starts_with(BOOK)) else { continue };
            let (from, to) = (top.join(&path), to.join(&path));
            std::fs::create_dir_all(to.parent().unwrap_or(&to))
                .and_then(|()| std::fs::copy(&from, &to))
                .with_context(|| format!("{place} includes {path}, which cannot be copied"))?;
        }
    }
    Ok(())
}

/// Files that a page includes, without the part of them that it wants.
fn included(text: &str) -> Vec<&str> {
    let inside = text.split("{{#include ").skip(1).filter_map(|rest| rest.split("}}").next());
    inside.filter_map(|path| path.trim().split(':').next()).collect()
}

/// Lets the program write its part.
fn reference_of_program(out: &Path) -> Result<()> {
    build_program()?;
    let mut command = quadlab();
    command.args(["reference", "--out"]).arg(out);
    ensure!(succeeds(&mut command)?, "`{}` failed", shown(&command));
    for name in ["man", "completions", "schema", "effects"].map(|name| out.join(name)) {
        ensure!(name.is_dir(), "`{}` wrote no {}", shown(&command), name.display());
    }
    Ok(())
}

/// Puts the pages of single effects into the book's sources.
fn with_effects(sources: &Path, effects: &Path) -> Result<()> {
    let read = |path: PathBuf| {
        std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let contents = inserted(&read(sources.join(SUMMARY))?, &read(effects.join(SUMMARY))?)?;
    copy(effects, &sources.join("effects"))?;
    let stray = sources.join("effects").join(SUMMARY);
    std::fs::remove_file(&stray).with_context(|| format!("cannot remove {}", stray.display()))?;
    let path = sources.join(SUMMARY);
    std::fs::write(&path, contents).with_context(|| format!("cannot write {}", path.display()))
}

/// The table of contents with lines more below the page of all effects.
fn inserted(contents: &str, lines: &str) -> Result<String> {
    let link = format!("({EFFECTS})");
    ensure!(
        contents.contains(&link),
        "{BOOK}/src/{SUMMARY} has no line for {EFFECTS}, where the effects belong"
    );
    let mut text = String::new();
    for line in contents.lines() {
        text += &format!("{line}\n");
        if line.contains(&link) {
            let indent = " ".repeat(line.len() - line.trim_start().len() + 2);
            for below in lines.lines().filter(|below| !below.trim().is_empty()) {
                text += &format!("{indent}{below}\n");
            }
        }
    }
    Ok(text)
}

fn removed(folder: &Path) -> Result<()> {
    if folder.exists() {
        std::fs::remove_dir_all(folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    Ok(())
}

/// Copies a folder and all in it.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let failed = || format!("cannot copy {} to {}", from.display(), to.display());
    std::fs::create_dir_all(to).with_context(failed)?;
    for entry in std::fs::read_dir(from).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        let target = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy(&path, &target)?;
        } else {
            std::fs::copy(&path, &target).with_context(failed)?;
        }
    }
    Ok(())
}

/// Builds the user's program just as the tests do: alone it has fewer features, with which all that it uses would be
/// compiled once more.
fn build_program() -> Result<()> {
    let mut command = cargo(["test", "--workspace", "--quiet", "--no-run", "--test", "book"]);
    ensure!(succeeds(&mut command)?, "`{}` failed", shown(&command));
    Ok(())
}

/// The user's program, which lies beside this one.
fn quadlab() -> Command {
    let name = format!("quadlab{}", std::env::consts::EXE_SUFFIX);
    let beside = std::env::current_exe().map(|xtask| xtask.with_file_name(&name));
    Command::new(beside.unwrap_or_else(|_| name.into()))
}

/// The project's programs, asked for their help.
struct Programs;

impl Help for Programs {
    fn help(&mut self, words: &[String]) -> Option<String> {
        let (mut command, arguments) = match words {
            [first, rest @ ..] if first == "quadlab" => (quadlab(), rest),
            // What these are given goes on to programs that would have to be built first.
            [_, _, word] if word == "sil" || word == "demo" => return None,
            [_, _, rest @ ..] => (Command::new(std::env::current_exe().ok()?), rest),
            _ => return None,
        };
        output_of(command.args(arguments).arg("--help"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_effects_stand_below_the_page_of_all() {
        let contents =
            "# Summary\n\n- [Use](use.md)\n  - [Effects](effects/index.md)\n- [Method](method.md)\n";
        let lines =
            "- [Ground effect](effects/ground-effect.md)\n\n- [Steady wind](effects/steady-wind.md)\n";
        let expected = "# Summary\n\n- [Use](use.md)\n  - [Effects](effects/index.md)\n    \
                        - [Ground effect](effects/ground-effect.md)\n    \
                        - [Steady wind](effects/steady-wind.md)\n- [Method](method.md)\n";
        assert_eq!(inserted(contents, lines).unwrap(), expected);
        assert!(inserted("# Summary\n", lines).is_err());
    }

    #[test]
    fn generated_pages_are_in_the_book_without_their_table_of_contents() {
        let folder = tempfile::tempdir().unwrap();
        let (sources, effects) = (folder.path().join("src"), folder.path().join("effects"));
        for (path, text) in [
            (sources.join("SUMMARY.md"), "- [Effects](effects/index.md)\n"),
            (sources.join("effects/index.md"), "# Effects\n\n[wind](steady-wind.md)\n"),
            (effects.join("SUMMARY.md"), "- [Steady wind](effects/steady-wind.md)\n"),
            (effects.join("steady-wind.md"), "# Steady wind\n"),
        ] {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        assert_eq!(Sources::read(&sources).unwrap().problems().len(), 1);
        with_effects(&sources, &effects).unwrap();
        assert_eq!(Sources::read(&sources).unwrap().problems(), [""; 0]);
    }

    #[test]
    fn what_a_page_includes_from_outside_is_copied_along() {
        let (top, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let page = top.path().join(BOOK).join("src/a.md");
        std::fs::create_dir_all(page.parent().unwrap()).unwrap();
        std::fs::write(&page, "{{#include ../../../README.md:table}} {{#include b.md}}").unwrap();
        let error = copy_included(top.path(), to.path()).unwrap_err().to_string();
        assert_eq!(error, "host-sim/book/src/a.md includes README.md, which cannot be copied");
        std::fs::write(top.path().join("README.md"), "text").unwrap();
        copy_included(top.path(), to.path()).unwrap();
        assert!(to.path().join("README.md").is_file());
    }

    #[test]
    fn a_program_that_cannot_say_what_it_does_has_no_help() {
        assert_eq!(Programs.help(&["cargo", "xtask", "sil"].map(String::from)), None);
    }
}
