//! House rules that no compiler checks: heads of crates, the architecture page, links, sizes, leftovers.
//!
//! Sources and pages are read with real parsers (a Rust token stream, CommonMark), so a word in a comment
//! or a link in a code block is neither missed nor mistaken. Only files that git knows or would take in
//! count: what is ignored does not exist in a fresh clone.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result};
use cargo_metadata::TargetKind;
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use pulldown_cmark::Event;

use crate::base::markdown::{events, links, path_of, resolved};
use crate::base::process::{in_continuous_integration, output_of};
use crate::base::workspace::{self, Workspace};
use crate::source::for_tests;

/// Crates that may use `unsafe`, as (crate, why nothing safe does it).
const MAY_USE_UNSAFE: &[(&str, &str)] = &[
    ("fpu", "an instruction of a processor is reached by assembler alone"),
    ("mcu", "registers are addresses, and handlers are the chip's to call"),
    ("law-c", "callers in C hand over pointers"),
];

/// Macros that mark unfinished work or a debugging session.
const LEFTOVERS: [&str; 3] = ["todo", "unimplemented", "dbg"];

/// A clone stays quick: large data are fetched or generated. Bytes.
const LARGEST_FILE: u64 = 1_000_000;

/// Crates in which each module has unit tests beside it: a wrong number of theirs is believed.
const TESTED_BESIDE: [&str; 2] = ["host-sim/diagnosis/src/", "host-sim/sysid/src/"];

/// Where the book is.
const BOOK: &str = "host-sim/book/src/";

const ARCHITECTURE: &str = "ARCHITECTURE.md";

/// Checks all of it.
pub(crate) fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let root = workspace::root();
    let tracked = listed_files(&["--cached"])?;
    let files = listed_files(&["--cached", "--others", "--exclude-standard"])?;
    let known = Paths::new(&files);

    let mut problems: Vec<String> = lock_file_changed().into_iter().collect();
    problems.extend(too_large(&root, &tracked)?);
    for (package, _, source) in roots_of_crates(workspace) {
        let place = source.strip_prefix(&root).unwrap_or(&source).display().to_string();
        problems.extend(crate_head(&place, &package, &read(&source)?));
    }
    for file in files.iter().filter(|file| file.ends_with(".rs")) {
        let source = read(&root.join(file))?;
        problems.extend(leftovers(file, &source));
        if TESTED_BESIDE.iter().any(|crate_source| file.starts_with(crate_source)) {
            problems.extend(untested(file, &source));
        }
    }
    // The book links to pages that are generated, and has a step of its own.
    let pages = files.iter().filter(|file| file.ends_with(".md") && !file.starts_with(BOOK));
    for file in pages {
        problems.extend(broken_links(file, &read(&root.join(file))?, &known));
    }
    let folders: Vec<String> = workspace.members().iter().map(|member| workspace.folder_of(member)).collect();
    problems.extend(architecture(&read(&root.join(ARCHITECTURE))?, &folders, &known));
    Ok(problems)
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Files as git lists them, relative to the root, that are really there.
pub(super) fn listed_files(options: &[&str]) -> Result<Vec<String>> {
    let root = workspace::root();
    let mut git = std::process::Command::new("git");
    git.current_dir(&root).args(["ls-files", "-z"]).args(options);
    let list = output_of(&mut git)
        .context("`git ls-files` does not work here: check in a clone of the repository")?;
    let files = list.split('\0').filter(|file| !file.is_empty() && root.join(file).is_file());
    Ok(files.map(ToOwned::to_owned).collect())
}

/// A fresh clone must build what was committed: in continuous integration, cargo had nothing to change.
fn lock_file_changed() -> Option<String> {
    if !in_continuous_integration() {
        return None;
    }
    let mut git = std::process::Command::new("git");
    git.current_dir(workspace::root()).args(["status", "--porcelain", "--", "Cargo.lock"]);
    let changed = output_of(&mut git).is_some_and(|text| !text.trim().is_empty());
    changed
        .then(|| "Cargo.lock: not up to date with the manifests; commit the one that cargo wrote".to_owned())
}

fn too_large(root: &Path, tracked: &[String]) -> Result<Vec<String>> {
    let mut problems = Vec::new();
    for file in tracked {
        let path = root.join(file);
        let bytes = path.metadata().with_context(|| format!("cannot read {}", path.display()))?.len();
        problems.extend(size_problem(file, bytes));
    }
    Ok(problems)
}

fn size_problem(file: &str, bytes: u64) -> Option<String> {
    (bytes > LARGEST_FILE)
        .then(|| format!("{file}: {bytes} bytes in git, {LARGEST_FILE} at most; generate it or shorten it"))
}

/// Roots of libraries and programs. Tests and benches are held by the workspace's lints alone.
fn roots_of_crates(workspace: &Workspace) -> Vec<(String, String, std::path::PathBuf)> {
    [TargetKind::Lib, TargetKind::Bin].iter().flat_map(|kind| workspace.targets(kind)).collect()
}

/// What the root file of a crate has to begin with: docs that teach, and no way to `unsafe`.
fn crate_head(place: &str, package: &str, source: &str) -> Vec<String> {
    let mut problems = Vec::new();
    if !source.trim_start().starts_with("//!") {
        problems.push(format!("{place}: begin it with `//!` docs that say what the crate is for"));
    }
    let allowed = MAY_USE_UNSAFE.iter().any(|(name, _)| *name == package);
    if !allowed && !forbids_unsafe(source) {
        problems.push(format!("{place}: `#![forbid(unsafe_code)]` is missing"));
    }
    problems
}

/// Is `#![forbid(unsafe_code)]` among the tokens?
fn forbids_unsafe(source: &str) -> bool {
    let Ok(tokens) = source.parse::<TokenStream>() else { return false };
    let wanted = "# ! [forbid (unsafe_code)]".replace(' ', "");
    let trees: Vec<TokenTree> = tokens.into_iter().collect();
    trees.windows(3).any(|three| {
        let text: String = three.iter().map(ToString::to_string).collect();
        text.replace(' ', "") == wanted
    })
}

/// Calls of macros that do not belong into finished code.
fn leftovers(file: &str, source: &str) -> Vec<String> {
    match source.parse::<TokenStream>() {
        Ok(tokens) => leftovers_in(file, tokens),
        Err(error) => vec![format!("{file}: not readable as Rust: {error}")],
    }
}

fn leftovers_in(file: &str, tokens: TokenStream) -> Vec<String> {
    let trees: Vec<TokenTree> = tokens.into_iter().collect();
    let mut problems = Vec::new();
    for (at, tree) in trees.iter().enumerate() {
        match tree {
            TokenTree::Group(group) => problems.extend(leftovers_in(file, group.stream())),
            TokenTree::Ident(name)
                if is_call(&trees[at + 1..]) && LEFTOVERS.iter().any(|word| name == word) =>
            {
                let line = name.span().start().line;
                problems.push(format!("{file}:{line}: `{name}!` is left over: finish it or take it out"));
            }
            _ => {}
        }
    }
    problems
}

/// Do these tokens go on as a macro call: `!` and a bracket?
fn is_call(after: &[TokenTree]) -> bool {
    matches!(after, [TokenTree::Punct(mark), TokenTree::Group(group), ..]
        if mark.as_char() == '!' && group.delimiter() != Delimiter::None)
}

/// A module that does something and has no unit tests beside it.
fn untested(file: &str, source: &str) -> Option<String> {
    // What is no Rust is told of with the leftovers; what is for the tests of other modules is tested by them.
    let module = syn::parse_file(source).ok().filter(|_| !file.ends_with("/testing.rs"))?;
    let works = |item: &syn::Item| match item {
        syn::Item::Fn(_) => true,
        syn::Item::Impl(block) => block.items.iter().any(|item| matches!(item, syn::ImplItem::Fn(_))),
        _ => false,
    };
    let tests = |item: &syn::Item| matches!(item, syn::Item::Mod(inner) if for_tests(&inner.attrs));
    (module.items.iter().any(works) && !module.items.iter().any(tests))
        .then(|| format!("{file}: has no unit tests; write some at its end"))
}

/// Files and folders of the project, relative to its root.
struct Paths {
    files: BTreeSet<String>,
    folders: BTreeSet<String>,
}

impl Paths {
    fn new(files: &[String]) -> Self {
        let parents = files.iter().flat_map(|file| Path::new(file).ancestors().skip(1));
        let folders = parents.map(|folder| folder.to_string_lossy().into_owned()).collect();
        Self { files: files.iter().cloned().collect(), folders }
    }

    fn has(&self, path: &str) -> bool {
        self.files.contains(path) || self.has_folder(path)
    }

    fn has_folder(&self, path: &str) -> bool {
        self.folders.contains(path.trim_end_matches('/'))
    }
}

/// Links of a page to files of the project that are not there.
fn broken_links(page: &str, text: &str, known: &Paths) -> Vec<String> {
    let leads_nowhere = |link: &String| {
        let path = path_of(link);
        !path.is_empty() && !resolved(page, path).is_some_and(|target| known.has(&target))
    };
    let broken = links(text).into_iter().filter(leads_nowhere);
    broken.map(|link| format!("{page}: the link to {link} leads nowhere in the repository")).collect()
}

/// Does the architecture page name every member, and only folders and files that exist?
///
/// A name is a code span: with a slash at its end it is a folder; with one inside, and an existing
/// top-level folder in front, it is a file or folder (so `m/s` is a unit and `proto/src/lib.rs` a file).
fn architecture(text: &str, members: &[String], known: &Paths) -> Vec<String> {
    let spans: Vec<String> = events(text)
        .filter_map(|event| if let Event::Code(span) = event { Some(span.into_string()) } else { None })
        .collect();
    let mut problems = Vec::new();
    for member in members {
        if !spans.iter().any(|span| span.trim_end_matches('/') == member) {
            problems.push(format!("{ARCHITECTURE}: the crate in `{member}/` is not named"));
        }
    }
    for span in &spans {
        let there = if span.ends_with('/') {
            known.has_folder(span)
        } else {
            !is_path(span, known) || known.has(span)
        };
        if !there {
            problems.push(format!("{ARCHITECTURE}: `{span}` does not exist"));
        }
    }
    problems
}

fn is_path(span: &str, known: &Paths) -> bool {
    let top = span.split_once('/').map(|(top, _)| top);
    top.is_some_and(|top| known.has_folder(top)) && !span.contains(char::is_whitespace)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(files: &[&str]) -> Paths {
        Paths::new(&files.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    #[test]
    fn a_crate_begins_with_docs_and_forbids_unsafe() {
        let good =
            "//! What it is for.\n#![cfg_attr(not(test), no_std)]\n#![forbid(unsafe_code)]\nfn main() {}";
        assert_eq!(crate_head("a.rs", "a", good), [""; 0]);
        assert_eq!(crate_head("a.rs", "a", "fn main() {}").len(), 2);
        let commented = "//! Docs.\n// #![forbid(unsafe_code)]\nfn main() {}";
        assert_eq!(crate_head("a.rs", "a", commented).len(), 1);
        let weaker = "//! Docs.\n#![deny(unsafe_code)]\nfn main() {}";
        assert_eq!(crate_head("a.rs", "a", weaker).len(), 1);
    }

    #[test]
    fn leftovers_are_found_in_code_only() {
        let call = |name: &str| format!("fn f() {{\n    let a = [{name}!(1)];\n}}");
        for name in LEFTOVERS {
            let found = leftovers("a.rs", &call(name));
            assert_eq!(found.len(), 1, "{name}");
            assert!(found[0].starts_with("a.rs:2: "), "{found:?}");
        }
        let harmless = "// todo!()\n/// dbg!(x)\nfn todo() -> &'static str { \"todo!()\" }\nfn g() -> bool { todo() != \"\" }";
        assert_eq!(leftovers("a.rs", harmless), [""; 0]);
        assert_eq!(leftovers("a.rs", "fn f() {").len(), 1);
    }

    #[test]
    fn a_module_that_does_something_has_tests() {
        let tests = "#[cfg(test)]\nmod tests {}";
        for works in ["fn f() {}", "struct A;\nimpl A { fn f() {} }"] {
            assert!(untested("a.rs", works).is_some_and(|problem| problem.starts_with("a.rs: ")));
            assert_eq!(untested("a.rs", &format!("{works}\n{tests}")), None);
            assert!(untested("a.rs", &format!("{works}\n// {}", tests.replace('\n', " "))).is_some());
            assert_eq!(untested("b/testing.rs", works), None);
        }
        assert_eq!(untested("a.rs", "pub(crate) mod b;\npub const C: u8 = 1;\nstruct A;"), None);
    }

    #[test]
    fn links_resolve_from_the_pages_folder() {
        let known = paths(&["README.md", "docs/a.md", "docs/pictures/b.svg"]);
        let text = "[up](../README.md#start) ![b](pictures/b.svg) [folder](pictures/) [web](https://x.org/y)\n\
                    [mail](mailto:a@b.c) [here](#part) [root](/docs/a.md)\n\n```\n[code](nowhere.md)\n```\n";
        assert_eq!(broken_links("docs/a.md", text, &known), [""; 0]);
        for bad in ["[x](README.md)", "[x](../../README.md)", "[x](pictures/c.svg)", "![x][y]\n\n[y]: c.png"]
        {
            assert_eq!(broken_links("docs/a.md", bad, &known).len(), 1, "{bad}");
        }
    }

    #[test]
    fn the_architecture_page_names_members_and_nothing_else() {
        let known = paths(&["proto/src/lib.rs", "host-sim/model/Cargo.toml"]);
        let members = ["proto".to_owned(), "host-sim/model".to_owned()];
        let good = "`proto/` speed in `m/s`\n\n| crate |\n|---|\n| `host-sim/model/` |\n\n`proto/src/lib.rs`";
        assert_eq!(architecture(good, &members, &known), [""; 0]);
        assert_eq!(architecture("`proto/`", &members, &known).len(), 1);
        let stale = format!("{good} `gone/` `proto/src/gone.rs`");
        let found = architecture(&stale, &members, &known);
        assert_eq!(
            found,
            [
                "ARCHITECTURE.md: `gone/` does not exist",
                "ARCHITECTURE.md: `proto/src/gone.rs` does not exist"
            ]
        );
    }

    #[test]
    fn a_megabyte_is_the_limit() {
        assert_eq!(size_problem("a.csv", LARGEST_FILE), None);
        assert!(size_problem("a.csv", LARGEST_FILE + 1).is_some());
    }
}
