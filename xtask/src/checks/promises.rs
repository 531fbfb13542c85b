//! The page of the book that says which test shows what: each test, drill and step that it names exists.
//!
//! A row of the page's tables is `| number | what must hold | does it | what shows it |`. The third cell begins with `holds`, `in part` or
//! `not here`; the last one names, as code,
//!
//! ```text
//! package::file::function             a test, in the file of that name (without `.rs`) anywhere in the package
//! drill: name                         a flight of the list of failsafes
//! cargo xtask test STEP               a step of the tests, or with --nightly a part of the night
//! ```
//!
//! Deliberately absent: whether a test shows what the row says. That is for whoever reads both.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result};
use proc_macro2::{TokenStream, TokenTree};
use pulldown_cmark::{Event, Tag, TagEnd};

use super::tidy::listed_files;
use crate::base::markdown::events;
use crate::base::workspace::{self, Workspace};

/// The page.
const PAGE: &str = "host-sim/book/src/tests.md";
/// Where the flights of failsafes have their names.
const DRILLS: &str = "host-sim/sil/src/failsafe/list.rs";
/// How many rows there are: none is lost, none is counted twice.
const ROWS: usize = 64;
/// What the third cell begins with.
const STATES: [&str; 3] = ["holds", "in part", "not here"];

/// What a row can name.
#[derive(Debug, Default)]
struct Known {
    /// As `package::file::function`.
    tests: BTreeSet<String>,
    drills: BTreeSet<String>,
    /// The commands of steps and parts.
    commands: BTreeSet<String>,
}

/// Checks the page against the sources; `steps` and `parts` are the names that the commands know.
pub(crate) fn check(workspace: &Workspace, steps: &[&str], parts: &[&str]) -> Result<Vec<String>> {
    let root = workspace::root();
    let read =
        |file: &str| std::fs::read_to_string(root.join(file)).with_context(|| format!("cannot read {file}"));
    let mut known = Known { drills: strings(&read(DRILLS)?), ..Known::default() };
    let command =
        |night: &'static str| move |name: &&str| format!("cargo xtask test {night}{}", quoted(name));
    known.commands.extend(steps.iter().map(command("")));
    known.commands.extend(parts.iter().map(command("--nightly ")));
    let packages: BTreeMap<String, String> = workspace
        .members()
        .into_iter()
        .map(|member| (workspace.folder_of(member), member.name.to_string()))
        .collect();
    for file in listed_files(&["--cached", "--others", "--exclude-standard"])? {
        let Some(package) = package_of(&file, &packages) else { continue };
        let functions = tests_in(&read(&file)?);
        known
            .tests
            .extend(functions.iter().map(|function| format!("{package}::{}::{function}", stem(&file))));
    }
    Ok(problems(&read(PAGE)?, &known))
}

/// A name of two words is one word for a shell.
fn quoted(name: &str) -> String {
    if name.contains(' ') { format!("\"{name}\"") } else { name.to_owned() }
}

/// The package in whose folder a Rust file lies: the innermost one.
fn package_of<'a>(file: &str, packages: &'a BTreeMap<String, String>) -> Option<&'a str> {
    let inside = packages.iter().filter(|(folder, _)| file.starts_with(&format!("{folder}/")));
    let innermost = inside.max_by_key(|(folder, _)| folder.len());
    innermost.filter(|_| file.ends_with(".rs")).map(|(_, package)| package.as_str())
}

/// The name of a file without its ending; of a `mod.rs`, and of the root of a test in a folder, that of its folder.
fn stem(file: &str) -> &str {
    let path = Path::new(file);
    let is_root_of_test = path.ends_with("main.rs") && !path.ends_with("src/main.rs");
    let is_folder = path.ends_with("mod.rs") || is_root_of_test;
    let path = if is_folder { path.parent().unwrap_or(path) } else { path };
    path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default()
}

/// All string literals among the tokens of a source.
fn strings(source: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut waiting: Vec<TokenStream> = source.parse().into_iter().collect();
    while let Some(tokens) = waiting.pop() {
        for tree in tokens {
            match tree {
                TokenTree::Group(group) => waiting.push(group.stream()),
                TokenTree::Literal(literal) => {
                    let text = literal.to_string();
                    found.extend(
                        text.strip_prefix('"').and_then(|t| t.strip_suffix('"')).map(ToOwned::to_owned),
                    );
                }
                _ => {}
            }
        }
    }
    found
}

/// Names of the functions that `#[test]` stands before, in macros too (`proptest!`).
fn tests_in(source: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut waiting: Vec<TokenStream> = source.parse().into_iter().collect();
    while let Some(tokens) = waiting.pop() {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        for (at, tree) in trees.iter().enumerate() {
            let TokenTree::Group(group) = tree else { continue };
            waiting.push(group.stream());
            let is_attribute =
                at > 0 && matches!(&trees[at - 1], TokenTree::Punct(mark) if mark.as_char() == '#');
            if is_attribute && group.stream().to_string() == "test" {
                found.extend(function_behind(&trees[at + 1..]));
            }
        }
    }
    found
}

/// The function that begins behind an attribute, after further attributes.
fn function_behind(trees: &[TokenTree]) -> Option<String> {
    let at = trees.iter().position(|tree| !matches!(tree, TokenTree::Punct(_) | TokenTree::Group(_)))?;
    match &trees[at..] {
        [TokenTree::Ident(keyword), TokenTree::Ident(name), ..] if keyword == "fn" => Some(name.to_string()),
        _ => None,
    }
}

/// A row of a table: its cells as text, and the code in its last one.
#[derive(Debug, Default)]
struct Row {
    cells: Vec<String>,
    code: Vec<String>,
}

/// The rows of all tables of a page, without their heads.
fn rows(page: &str) -> Vec<Row> {
    let (mut rows, mut row, mut inside) = (Vec::new(), Row::default(), false);
    for event in events(page) {
        match event {
            Event::Start(Tag::TableRow) => (row, inside) = (Row::default(), true),
            Event::End(TagEnd::TableRow) => {
                rows.push(std::mem::take(&mut row));
                inside = false;
            }
            Event::Start(Tag::TableCell) if inside => {
                row.cells.push(String::new());
                row.code.clear();
            }
            Event::Text(text) if inside => row.cells.last_mut().into_iter().for_each(|cell| *cell += &text),
            Event::Code(span) if inside => row.code.push(span.into_string()),
            _ => {}
        }
    }
    rows
}

fn problems(page: &str, known: &Known) -> Vec<String> {
    let rows = rows(page);
    let mut problems = Vec::new();
    let numbers: Vec<&str> =
        rows.iter().filter_map(|row| row.cells.first()).map(|cell| cell.trim()).collect();
    let expected: Vec<String> = (1..=ROWS).map(|number| number.to_string()).collect();
    if numbers != expected {
        problems.push(format!("{PAGE}: its rows are not numbered from 1 to {ROWS}: {}", numbers.join(" ")));
    }
    for row in &rows {
        let number = row.cells.first().map_or("", |cell| cell.trim());
        let state = row.cells.get(2).map_or("", |cell| cell.trim());
        let known_state = STATES.iter().find(|word| state.starts_with(*word));
        match known_state {
            None => problems.push(format!("{PAGE}: row {number} does not say {}", STATES.join(", "))),
            Some(&"not here") => {}
            Some(_) if row.code.is_empty() => {
                problems.push(format!("{PAGE}: row {number} names nothing that shows it"))
            }
            Some(&word) if word != "holds" && state == word => {
                problems.push(format!("{PAGE}: row {number} does not say what is missing"));
            }
            Some(_) => {}
        }
        problems.extend(
            row.code
                .iter()
                .filter_map(|name| unknown(name, known))
                .map(|what| format!("{PAGE}: row {number} names {what}, which does not exist")),
        );
    }
    problems
}

/// What is named and does not exist.
fn unknown(name: &str, known: &Known) -> Option<String> {
    let (there, what) = match name.strip_prefix("drill: ") {
        Some(drill) => (known.drills.contains(drill), "the drill"),
        None if name.starts_with("cargo ") => (known.commands.contains(name), "the command"),
        None => (known.tests.contains(name), "the test"),
    };
    (!there).then(|| format!("{what} `{}`", name.trim_start_matches("drill: ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Known {
        let one = |name: &str| BTreeSet::from([name.to_owned()]);
        Known {
            tests: one("control::autopilot::cut_is_latched"),
            drills: one("clock 1 h back"),
            commands: one("cargo xtask test --nightly damage"),
        }
    }

    /// A page of as many rows as there must be, of which this is the first.
    fn page(first: &str) -> String {
        let head = "| # | must hold | does it | by |\n|---|---|---|---|\n";
        let row = |number| format!("| {number} | it does | holds | `control::autopilot::cut_is_latched` |\n");
        format!("{head}{first}\n{}", (2..=ROWS).map(row).collect::<String>())
    }

    #[test]
    fn rows_name_what_exists_and_say_what_is_missing() {
        for good in [
            "| 1 | a | holds | `drill: clock 1 h back` |",
            "| 1 | a `b` | in part: no board | `cargo xtask test --nightly damage` and more |",
            "| 1 | a | not here: there is no board | |",
        ] {
            assert_eq!(problems(&page(good), &known()), [""; 0], "{good}");
        }
        for (bad, word) in [
            ("| 1 | a | holds | `control::autopilot::gone` |", "the test `control::autopilot::gone`"),
            ("| 1 | a | holds | `drill: clock 2 h back` |", "the drill `clock 2 h back`"),
            ("| 1 | a | holds | `cargo xtask test --nightly gone` |", "the command"),
            ("| 1 | a | holds | a test |", "names nothing"),
            ("| 1 | a | in part | `drill: clock 1 h back` |", "what is missing"),
            ("| 1 | a | perhaps | `drill: clock 1 h back` |", "does not say holds"),
            ("| 2 | a | holds | `drill: clock 1 h back` |", "not numbered"),
        ] {
            let found = problems(&page(bad), &known());
            assert!(found.len() == 1 && found[0].contains(word), "{bad}: {found:?}");
        }
    }

    #[test]
    fn tests_are_found_in_modules_and_macros_and_other_functions_are_not() {
        let source = "fn a() {}\n#[test]\nfn b() {}\nmod tests { #[test] #[ignore = \"slow\"] fn c() {} }\n\
                      proptest! { #![config(x)] /// Docs.\n#[test] fn d(x in 0..1) {} }\n#[cfg(test)] fn e() {}";
        assert_eq!(
            tests_in(source).into_iter().collect::<BTreeSet<_>>(),
            ["b", "c", "d"].map(str::to_owned).into()
        );
    }

    #[test]
    fn a_file_belongs_to_the_innermost_package() {
        let packages = BTreeMap::from(
            [("proto", "proto"), ("proto/files", "proto-files")].map(|(a, b)| (a.into(), b.into())),
        );
        assert_eq!(package_of("proto/files/src/lib.rs", &packages), Some("proto-files"));
        assert_eq!(package_of("proto/tests/packets.rs", &packages), Some("proto"));
        assert_eq!((package_of("proto/README.md", &packages), package_of("x/a.rs", &packages)), (None, None));
        assert_eq!((stem("xtask/src/arm/mod.rs"), stem("proto/tests/packets.rs")), ("arm", "packets"));
        assert_eq!((stem("tests/tests/com/main.rs"), stem("xtask/src/main.rs")), ("com", "main"));
    }
}
