//! The commands in README and book are run, and what they print is compared with what the text shows.
//!
//! A fenced block marked `console` is a session: lines that begin with `$ ` are commands, the lines below them their
//! output. The blocks of a page run in order in one temporary folder, in which `host-sim/model/vehicles` is there as in
//! the repository. `$ quadlab`, `$ cargo xtask demo`, `$ cargo xtask sil` and `$ cd` are run; nothing else is known.
//! - `console,exit=1`: the last command of the block has this exit status instead of 0.
//! - `console,norun`: not run; an HTML comment right above the block says why.
//! - a block marked `toml,file=NAME` is written into the folder as NAME.
//!
//! Shown lines must be printed, in this order. A line `...` stands for any lines, `...` at a line's end for the rest of
//! it. Spaces and empty lines do not count. Numbers may differ a little: other machines have other sines.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A number may be off by this part of itself and by this many units of its last digit.
const RELATIVE: f64 = 0.02;
const LAST_DIGITS: f64 = 1.5;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A fenced block of a page.
struct Block {
    line: usize,
    /// What stands behind the fence: `console`, `norun`, `exit=1`.
    marks: Vec<String>,
    text: Vec<String>,
    /// The line above the fence.
    above: String,
}

impl Block {
    fn is(&self, mark: &str) -> bool {
        self.marks.iter().any(|m| m == mark)
    }

    fn value(&self, key: &str) -> Option<&str> {
        self.marks.iter().find_map(|m| m.strip_prefix(key)?.strip_prefix('='))
    }
}

fn blocks(page: &str) -> Vec<Block> {
    let mut found: Vec<Block> = Vec::new();
    let (mut open, mut above) = (false, String::new());
    for (index, line) in page.lines().enumerate() {
        if let Some(info) = line.strip_prefix("```") {
            if !open {
                let marks = info.split(',').map(|m| m.trim().to_owned()).collect();
                found.push(Block { line: index + 1, marks, text: Vec::new(), above: above.clone() });
            }
            open = !open;
        } else if open {
            found.last_mut().expect("a block is open").text.push(line.to_owned());
        }
        if !line.trim().is_empty() {
            line.clone_into(&mut above);
        }
    }
    assert!(!open, "a block is not closed");
    found
}

/// Commands of a block with the lines shown below each.
fn session(block: &Block) -> Vec<(String, Vec<&str>)> {
    let mut commands: Vec<(String, Vec<&str>)> = Vec::new();
    let mut goes_on = false;
    for line in &block.text {
        let next = line.strip_prefix("$ ");
        let part = if goes_on { Some(line.trim_start()) } else { next };
        match (part, commands.last_mut()) {
            (Some(part), last) => {
                let text = part.trim_end_matches('\\').trim_end();
                match last.filter(|_| goes_on) {
                    Some((command, _)) => drop(write!(command, " {text}")),
                    None => commands.push((text.to_owned(), Vec::new())),
                }
                goes_on = part.ends_with('\\');
            }
            (None, Some((_, shown))) => shown.push(line),
            (None, None) => panic!("line {}: output without a command above it", block.line),
        }
    }
    commands
}

/// A number in a text: its value, and one unit of its last digit.
fn number(word: &str) -> Option<(f64, f64)> {
    let digits = word.trim_matches(|c: char| !c.is_ascii_digit() && c != '-');
    let value: f64 = digits.parse().ok()?;
    let (mantissa, exponent) = digits.split_once('e').unwrap_or((digits, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len() as i32);
    Some((value, 10_f64.powi(exponent.parse::<i32>().ok()? - decimals)))
}

fn same_word(shown: &str, printed: &str) -> bool {
    match (number(shown), number(printed)) {
        _ if shown == printed => true,
        (Some((a, unit)), Some((b, _))) => (a - b).abs() <= LAST_DIGITS * unit + RELATIVE * a.abs(),
        _ => false,
    }
}

fn same_line(shown: &str, printed: &str) -> bool {
    let (shown, is_start) = shown.strip_suffix("...").map_or((shown, false), |start| (start, true));
    let (shown, mut printed) =
        (shown.split_whitespace().collect::<Vec<_>>(), printed.split_whitespace().collect::<Vec<_>>());
    if is_start {
        printed.truncate(shown.len());
    }
    shown.len() == printed.len() && shown.iter().zip(&printed).all(|(a, b)| same_word(a, b))
}

/// Whether `printed` is what is `shown`; else the first shown line that was not found.
fn matches<'a>(shown: &[&'a str], printed: &[&str]) -> Result<(), &'a str> {
    let is_gap = |line: &&str| line.trim() == "...";
    let Some((first, rest)) = shown.split_first() else {
        return if printed.is_empty() { Ok(()) } else { Err("(nothing more)") };
    };
    if !is_gap(first) {
        return match printed.split_first() {
            Some((line, more)) if same_line(first, line) => matches(rest, more),
            _ => Err(first),
        };
    }
    let Some(next) = rest.first() else { return Ok(()) };
    let mut missing = *next;
    for start in 0..printed.len() {
        match matches(rest, &printed[start..]) {
            Ok(()) => return Ok(()),
            // The reason that lies furthest on is the one to tell.
            Err(line) if line != *next => missing = line,
            Err(_) => {}
        }
    }
    Err(missing)
}

/// A program beside ours; none where only this crate's tests were built.
fn beside(name: &str) -> Option<PathBuf> {
    let quadlab = assert_cmd::cargo::cargo_bin("quadlab");
    let path = quadlab.with_file_name(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    path.exists().then_some(path)
}

/// The program and arguments behind a command line; none where the program was not built.
fn program(line: &str) -> Option<Command> {
    let words: Vec<&str> = line.split_whitespace().take_while(|word| *word != "#").collect();
    let quadlab = || assert_cmd::cargo::cargo_bin("quadlab");
    let (path, arguments): (PathBuf, &[&str]) = match words.as_slice() {
        ["quadlab", rest @ ..] => (quadlab(), rest),
        // What xtask runs for it.
        ["cargo", "xtask", "demo", ..] => (quadlab(), &words[2..]),
        ["cargo", "xtask", "sil", rest @ ..] => (beside("sil")?, rest),
        _ => panic!("`{line}` is not a command that this test can run; mark the block norun and say why"),
    };
    let mut command = Command::new(path);
    command.args(arguments);
    Some(command)
}

fn run_block(name: &str, block: &Block, folder: &mut PathBuf) {
    let commands = session(block);
    let last = commands.len().saturating_sub(1);
    for (index, (line, shown)) in commands.iter().enumerate() {
        let place = format!("{name}, block at line {}: `{line}`", block.line);
        if let Some(inside) = line.strip_prefix("cd ") {
            folder.push(inside);
            assert!(folder.is_dir(), "{place}: there is no such folder");
            continue;
        }
        let Some(mut command) = program(line) else {
            assert!(
                std::env::var_os("CI").is_none_or(|ci| ci != "true"),
                "{place}: the program is not built"
            );
            println!("SKIPPED: {place}: the program is not built (cargo build -p sil)");
            continue;
        };
        let output = command.current_dir(&folder).output().expect("the program starts");
        let text =
            [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8")).concat();
        let expected =
            block.value("exit").filter(|_| index == last).map_or(0, |e| e.parse().expect("a status"));
        assert_eq!(output.status.code(), Some(expected), "{place}\n{text}");
        let filled = |line: &&&str| !line.trim().is_empty();
        let shown: Vec<&str> = shown.iter().filter(filled).copied().collect();
        let printed: Vec<&str> =
            text.lines().filter(|line| !line.trim().is_empty() && !is_progress(line)).collect();
        if let (false, Err(line)) = (shown.is_empty(), matches(&shown, &printed)) {
            panic!("{place}: the page shows\n{line}\nwhich is not (or not there) in what it prints:\n{text}");
        }
    }
}

/// Whether a line tells how far long work is: on a busy machine there are some.
fn is_progress(line: &str) -> bool {
    let is_number = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_digit());
    let counts = line.rsplit_once(": ").and_then(|(_, steps)| steps.split_once(" of "));
    line.ends_with(" s left")
        || line.ends_with(" s so far")
        || counts.is_some_and(|(done, all)| is_number(done) && is_number(all))
}

/// The crafts' files as in the repository, for pages that name them.
fn with_vehicles(folder: &Path) {
    let vehicles = Path::new("host-sim/model/vehicles");
    std::fs::create_dir_all(folder.join(vehicles)).expect("a folder");
    for entry in std::fs::read_dir(root().join(vehicles)).expect("the vehicles' folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name");
        std::fs::copy(&path, folder.join(vehicles).join(name)).expect("a copy");
    }
}

/// Runs a page, and says how many commands there were.
fn run_page(path: &Path) -> usize {
    let name = path.display().to_string();
    let page = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let temporary = tempfile::tempdir().expect("a temporary folder");
    with_vehicles(temporary.path());
    let mut folder = temporary.path().to_path_buf();
    let mut commands = 0;
    for block in blocks(&page) {
        if let Some(file) = block.value("file") {
            std::fs::write(folder.join(file), block.text.join("\n")).expect("the file is written");
        }
        if !block.is("console") {
            continue;
        }
        if block.is("norun") {
            let says_why = block.above.starts_with("<!-- norun: ");
            assert!(says_why, "{name}, line {}: `<!-- norun: why -->` is missing above", block.line);
            continue;
        }
        commands += session(&block).len();
        run_block(&name, &block, &mut folder);
    }
    commands
}

fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut found: Vec<PathBuf> = Vec::new();
    for path in entries.map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            found.extend(pages(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn the_commands_of_the_readme_do_what_it_shows() {
    assert!(run_page(&root().join("README.md")) > 0, "the README shows no command");
}

#[test]
fn the_commands_of_the_book_do_what_it_shows() {
    let commands: usize = pages(&root().join("host-sim/book/src")).iter().map(|page| run_page(page)).sum();
    assert!(commands > 20, "only {commands} commands: are the blocks marked?");
}

#[test]
fn every_page_of_the_book_is_in_its_summary() {
    let source = root().join("host-sim/book/src");
    let summary = std::fs::read_to_string(source.join("SUMMARY.md")).expect("the summary");
    for page in pages(&source) {
        let name = page.strip_prefix(&source).expect("inside").to_string_lossy().replace('\\', "/");
        // Pages of single effects are generated, and listed when they are.
        let is_generated = name.starts_with("effects/") && name != "effects/index.md";
        let is_listed = name == "SUMMARY.md" || summary.contains(&format!("({name})"));
        assert!(is_generated || is_listed, "{name} is not in SUMMARY.md");
    }
}

/// Sets a picture anew instead of comparing it: `QUADLAB_PICTURES=1 cargo nextest run -p quadlab --test book picture`.
const RENEW: &str = "QUADLAB_PICTURES";

/// Words in a picture that are no numbers of its axes.
fn labels(svg: &str) -> Vec<&str> {
    let inside = svg.lines().filter(|line| !line.starts_with('<') && !line.trim().is_empty());
    inside.filter(|line| line.parse::<f64>().is_err()).collect()
}

#[test]
fn the_picture_of_the_readme_is_the_demonstrations() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut demo = assert_cmd::Command::cargo_bin("quadlab").expect("the binary is built with its tests");
    demo.current_dir(folder.path()).args(["demo", "--seed", "4", "--out", "."]).assert().success();
    let page = std::fs::read_to_string(folder.path().join("report.html")).expect("the page");
    let after = page.find("predicted after").expect("a figure before and after");
    let start = page[..after].rfind("<svg").expect("a figure");
    let end = after + page[after..].find("</svg>").expect("its end") + "</svg>".len();
    let made = format!("{}\n", &page[start..end]);
    let path = root().join("host-sim/quadlab/pictures/before-after.svg");
    if std::env::var_os(RENEW).is_some() {
        std::fs::write(&path, &made).expect("the picture is written");
    }
    let kept = std::fs::read_to_string(&path).expect("the picture");
    // Not byte by byte: other machines round other coordinates.
    assert_eq!(labels(&kept), labels(&made), "set it anew with {RENEW}=1");
    assert!(kept.len().abs_diff(made.len()) < made.len() / 20, "set it anew with {RENEW}=1");
}

#[test]
fn a_wrong_page_is_noticed() {
    let printed = ["Found: ground-effect.", "  w  98.94  9.467  90.4", "", "page: a.html"];
    let printed: Vec<&str> = printed.into_iter().filter(|line| !line.is_empty()).collect();
    let holds = |shown: &[&str]| matches(shown, &printed).is_ok();
    assert!(holds(&["Found: ground-effect.", "w 98.95 9.466 90.4", "page: a.html"]));
    assert!(holds(&["...", "w  98.94 ...", "..."]));
    assert!(holds(&["Found: ...", "..."]));
    assert!(!holds(&["Found: ground-effect.", "..", "page: a.html"]));
    assert!(!holds(&["Found: tether.", "..."]), "another effect");
    assert!(!holds(&["...", "w 98.94 12.1 90.4", "..."]), "another number");
    assert!(!holds(&["Found: ground-effect."]), "more is printed than shown");
    assert!(!holds(&["page: a.html", "...", "Found: ground-effect."]), "another order");
}
