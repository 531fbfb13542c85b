//! Commands that a page shows in its blocks marked `console` (lines behind `$`) or `sh`.

use std::collections::BTreeMap;

use pulldown_cmark::{CodeBlockKind, Event, Tag, TagEnd};

use crate::base::markdown::events;

/// A command of a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Shown {
    pub(crate) line: usize,
    pub(crate) words: Vec<String>,
}

/// All commands of a page.
pub(crate) fn commands(text: &str) -> Vec<Shown> {
    let mut found = Vec::new();
    let mut language = None;
    for (event, place) in events(text).into_offset_iter() {
        match event {
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(marks))) => {
                language = marks.split([',', ' ']).next().map(ToOwned::to_owned);
            }
            Event::End(TagEnd::CodeBlock) => language = None,
            Event::Text(block) => {
                let console = match language.as_deref() {
                    Some("console") => true,
                    Some("sh") => false,
                    _ => continue,
                };
                let before =
                    text[..place.start].lines().count() + usize::from(text[..place.start].ends_with('\n'));
                for (at, line) in logical_lines(&block) {
                    let typed = if console { line.strip_prefix("$ ") } else { Some(line.as_str()) };
                    let parts = typed.map(simple_commands).unwrap_or_default();
                    found.extend(parts.into_iter().map(|words| Shown { line: before.max(1) + at, words }));
                }
            }
            _ => {}
        }
    }
    found
}

/// Lines with those joined that end in a backslash; the number of each counts from the block's first.
fn logical_lines(block: &str) -> Vec<(usize, String)> {
    let mut lines: Vec<(usize, String)> = Vec::new();
    let mut goes_on = false;
    for (at, line) in block.lines().enumerate() {
        let part = line.strip_suffix('\\').unwrap_or(line);
        match lines.last_mut() {
            Some((_, last)) if goes_on => *last += part,
            _ => lines.push((at, part.to_owned())),
        }
        goes_on = line.ends_with('\\');
    }
    lines
}

/// The words of each command of a line: it may be a pipe or a chain, begin with variables, and end with a comment.
fn simple_commands(line: &str) -> Vec<Vec<String>> {
    let mut commands = vec![Vec::new()];
    for word in line.split_whitespace() {
        if word.starts_with('#') {
            break;
        }
        let (word, ends) = word.strip_suffix(';').map_or((word, false), |word| (word, true));
        if ["|", "&&", "||", "&"].contains(&word) {
            commands.push(Vec::new());
            continue;
        }
        if let Some(command) = commands.last_mut() {
            let is_variable =
                command.is_empty() && word.split_once('=').is_some_and(|(name, _)| is_name(name));
            if !is_variable && !word.is_empty() {
                command.push(word.trim_matches(['\'', '"']).to_owned());
            }
        }
        if ends {
            commands.push(Vec::new());
        }
    }
    commands.retain(|command| !command.is_empty());
    commands
}

fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// What a program says of itself when asked with `--help` behind these words; nothing when there is no such program.
pub(crate) trait Help {
    fn help(&mut self, words: &[String]) -> Option<String>;
}

/// Commands and options of the project's programs, with the help of each read once.
pub(crate) struct Checker<H> {
    source: H,
    known: BTreeMap<Vec<String>, Option<String>>,
}

impl<H: Help> Checker<H> {
    pub(crate) fn new(source: H) -> Self {
        Self { source, known: BTreeMap::new() }
    }

    fn help(&mut self, words: &[String]) -> Option<String> {
        let source = &mut self.source;
        self.known.entry(words.to_vec()).or_insert_with(|| source.help(words)).clone()
    }

    /// What of a command does not exist, if anything. Programs of others are not looked for.
    pub(crate) fn problem(&mut self, command: &[String]) -> Option<String> {
        let mut at = match command {
            [first, ..] if first == "quadlab" => 1,
            [first, second, ..] if first == "cargo" && second == "xtask" => 2,
            _ => return None,
        };
        let Some(mut help) = self.help(&command[..at]) else {
            return Some(format!("`{}` does not run", command[..at].join(" ")));
        };
        // Down through commands of commands, as long as there are any.
        while let Some(word) = command.get(at).filter(|word| !word.starts_with('-')) {
            let below = subcommands(&help);
            if !below.contains(word) {
                if below.is_empty() {
                    break;
                }
                return Some(format!("`{}` has no command {word}", command[..at].join(" ")));
            }
            at += 1;
            help = self.help(&command[..at])?;
        }
        if passes_on(&help) {
            return None;
        }
        let options =
            command[at..].iter().take_while(|word| *word != "--").filter(|word| word.starts_with("--"));
        let unknown =
            options.map(|word| word.split('=').next().unwrap_or_default()).find(|option| !has(&help, option));
        unknown.map(|option| format!("`{}` has no option {option}", command[..at].join(" ")))
    }
}

/// The names under `Commands:`.
fn subcommands(help: &str) -> Vec<String> {
    let section = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let entries = section.take_while(|line| !line.is_empty());
    let names = entries.filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
    names.filter_map(|line| line.split_whitespace().next()).map(ToOwned::to_owned).collect()
}

/// Does a command hand its arguments on to another program, which alone knows what they mean?
fn passes_on(help: &str) -> bool {
    help.lines().any(|line| line.starts_with("Usage:") && line.ends_with("[ARGS]..."))
}

/// Is this option among the words of a help?
fn has(help: &str, option: &str) -> bool {
    help.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-' || c == '_')).any(|word| word == option)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(ToOwned::to_owned).collect()
    }

    #[test]
    fn commands_are_found_in_console_and_sh_blocks_only() {
        let text = "# Page\n\n```console\n$ quadlab explain --vehicle v.toml \\\n    --train A.csv\nFound: nothing\n\
                    $ A=1 quadlab effects | head -3 # all\n```\n\n```sh\ncd demo && quadlab demo\n```\n\n\
                    ```text\n$ quadlab nothing\n```\n`$ quadlab no`\n";
        let found: Vec<(usize, String)> =
            commands(text).into_iter().map(|shown| (shown.line, shown.words.join(" "))).collect();
        let expected = [
            (4, "quadlab explain --vehicle v.toml --train A.csv"),
            (7, "quadlab effects"),
            (7, "head -3"),
            (11, "cd demo"),
            (11, "quadlab demo"),
        ];
        assert_eq!(found, expected.map(|(line, words)| (line, words.to_owned())));
    }

    /// A program with two commands, as clap describes them.
    struct Program;

    impl Help for Program {
        fn help(&mut self, words: &[String]) -> Option<String> {
            let text = match words.join(" ").as_str() {
                "quadlab" => {
                    "Usage: quadlab <COMMAND>\n\nCommands:\n  design    Design gains\n            for a model\n  plan      Plan\n  passes\n\nOptions:\n  -h, --help\n"
                }
                "quadlab design" => {
                    "Commands:\n  check  Check gains\n\nOptions:\n      --out <TOML>  Write\n"
                }
                "quadlab design check" => "Options:\n      --delay <N>  Samples\n      --continuous\n",
                "quadlab passes" => "Usage: quadlab passes [ARGS]...\n",
                "quadlab plan" => "Options:\n      --model <TOML>\n",
                _ => return None,
            };
            Some(text.to_owned())
        }
    }

    #[test]
    fn commands_and_options_that_do_not_exist_are_named() {
        let mut checker = Checker::new(Program);
        for (line, expected) in [
            ("quadlab design check --delay 2 --continuous", None),
            ("quadlab design --out=gains.toml", None),
            ("quadlab plan anything.csv --model m.toml", None),
            ("quadlab passes --any", None),
            ("quadlab --help", None),
            ("git clone --no-such-option", None),
            ("quadlab for", Some("`quadlab` has no command for")),
            ("quadlab design cheque", Some("`quadlab design` has no command cheque")),
            ("quadlab design check --del 2", Some("`quadlab design check` has no option --del")),
            ("quadlab plan --out x", Some("`quadlab plan` has no option --out")),
            ("cargo xtask test", Some("`cargo xtask` does not run")),
        ] {
            assert_eq!(checker.problem(&words(line)).as_deref(), expected, "{line}");
        }
    }
}
