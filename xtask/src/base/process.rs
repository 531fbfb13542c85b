//! Running cargo and other programs from the workspace's top folder, with what they print kept apart.

use std::ffi::{OsStr, OsString};
use std::io::{BufRead, BufReader, IsTerminal};
use std::process::{Command, ExitCode, ExitStatus, Stdio};

use anyhow::{Context, Result};

use crate::base::workspace;

/// Programs that run for long.
const RELEASE: &str = "release";

/// The user's program with the demonstration alone, as its manifest says.
pub(crate) const FIRST_LOOK: [&str; 1] = ["--no-default-features"];

/// A program of the workspace that a command stands for.
pub(crate) struct Program {
    package: &'static str,
    binary: &'static str,
    /// How it is built.
    profile: &'static str,
    /// What of it is built, where that is not all.
    features: &'static [&'static str],
    /// Arguments before the user's.
    first: &'static [&'static str],
}

impl Program {
    /// Software in the loop.
    pub(crate) const SIL: Self =
        Self { package: "sil", binary: "sil", profile: RELEASE, features: &[], first: &[] };
    /// The demonstration, a command of the user's program: built as quickly as can be, since it is the first thing that anybody runs.
    const FIRST_LOOK: Self = Self { features: &FIRST_LOOK, ..Self::DEMO };
    /// The demonstration with the lab and readers of every log.
    const DEMO: Self =
        Self { package: "quadlab", binary: "quadlab", profile: "demo", features: &[], first: &["demo"] };
    /// How often the laboratory's diagnoses are right.
    pub(crate) const LAB: Self =
        Self { package: "stories", binary: "lab", profile: RELEASE, features: &[], first: &[] };
    /// How often forms that no catalogue has are discovered.
    pub(crate) const FORMS: Self =
        Self { package: "stories", binary: "forms", profile: RELEASE, features: &[], first: &[] };
    /// What the product finds in real flights.
    pub(crate) const REAL: Self =
        Self { package: "stories", binary: "real", profile: RELEASE, features: &[], first: &[] };

    /// The demonstration, with what these arguments of it need.
    pub(crate) fn demo(arguments: &[OsString]) -> Self {
        let asks_for = |option: &str| {
            let is =
                |word: &OsString| word.to_str().is_some_and(|word| word.split('=').next() == Some(option));
            arguments.iter().any(is)
        };
        if asks_for("--flights") || asks_for("--lab") { Self::DEMO } else { Self::FIRST_LOOK }
    }

    /// Name of the program.
    pub(crate) const fn binary(&self) -> &'static str {
        self.binary
    }

    /// What cargo is asked to do. `quiet` leaves out its progress, which goes to standard error.
    pub(crate) fn cargo_arguments(&self, arguments: &[OsString], quiet: bool) -> Vec<OsString> {
        let manifest = workspace::root().join("Cargo.toml");
        let mut line: Vec<OsString> =
            ["run", "--profile", self.profile, "--manifest-path"].map(Into::into).to_vec();
        line.push(manifest.into());
        if quiet {
            line.push("--quiet".into());
        }
        line.extend(["-p", self.package, "--bin", self.binary].map(OsString::from));
        line.extend(self.features.iter().map(OsString::from));
        line.push("--".into());
        line.extend(self.first.iter().map(OsString::from));
        line.extend_from_slice(arguments);
        line
    }
}

/// Builds and runs the program in the caller's folder (relative paths mean what the user thinks they
/// mean) and hands back its exit code. Standard output holds only what the program writes.
pub(crate) fn run_program(program: &Program, arguments: &[OsString]) -> Result<ExitCode> {
    let quiet = !std::io::stderr().is_terminal();
    let status = Command::new(cargo_path())
        .args(program.cargo_arguments(arguments, quiet))
        .status()
        .with_context(|| format!("cannot start cargo to run {}", program.binary))?;
    Ok(exit_code(status))
}

/// Same exit code as the program's; a program ended by a signal gives 128 plus its number, as shells do.
fn exit_code(status: ExitStatus) -> ExitCode {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return ExitCode::from(u8::try_from(128 + signal).unwrap_or(u8::MAX));
    }
    ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(u8::MAX))
}

/// The cargo that started us, so that a toolchain chosen on the command line stays chosen.
fn cargo_path() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// Is this the continuous integration, that is, `CI=true`?
pub(crate) fn in_continuous_integration() -> bool {
    std::env::var_os("CI").is_some_and(|value| value == "true")
}

/// Cargo in the workspace's top folder.
pub(crate) fn cargo<I, S>(arguments: I) -> Command
where
    I: IntoIterator<Item = S>,
    S: AsRef<OsStr>,
{
    let mut command = Command::new(cargo_path());
    command.args(arguments).current_dir(workspace::root());
    command
}

/// A command as one would type it.
pub(crate) fn shown(command: &Command) -> String {
    let name = std::path::Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    let words = std::iter::once(name).chain(command.get_args());
    words.map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ")
}

/// Runs a command with its output on the terminal: did it succeed?
pub(crate) fn succeeds(command: &mut Command) -> Result<bool> {
    let status = command.status().with_context(|| format!("cannot start `{}`", shown(command)))?;
    Ok(status.success())
}

/// What a command prints on standard output when it succeeds; nothing when it fails or does not exist.
pub(crate) fn output_of(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Runs a command, hands every line of its standard output to `line`, and prints those it keeps.
pub(crate) fn filtered(command: &mut Command, mut line: impl FnMut(&str) -> bool) -> Result<bool> {
    let name = shown(command);
    let mut child =
        command.stdout(Stdio::piped()).spawn().with_context(|| format!("cannot start `{name}`"))?;
    let output = child.stdout.take().with_context(|| format!("`{name}` gives no output"))?;
    for bytes in BufReader::new(output).split(b'\n') {
        let bytes = bytes.with_context(|| format!("cannot read what `{name}` prints"))?;
        let text = String::from_utf8_lossy(&bytes);
        if line(&text) {
            println!("{text}");
        }
    }
    let status = child.wait().with_context(|| format!("`{name}` cannot be waited for"))?;
    Ok(status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(program: &Program, arguments: &[&str], quiet: bool) -> Vec<String> {
        let arguments: Vec<OsString> = arguments.iter().map(OsString::from).collect();
        let line = program.cargo_arguments(&arguments, quiet);
        line.into_iter().map(|word| word.to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn the_users_arguments_stand_last_and_unchanged() {
        let line = words(&Program::SIL, &["--scenario", "hover", "--quiet", "--json"], true);
        assert!(
            line.ends_with(&["--", "--scenario", "hover", "--quiet", "--json"].map(String::from)),
            "{line:?}"
        );
    }

    /// Half of the program is not built before it is asked for.
    #[test]
    fn a_demonstration_is_built_with_what_it_needs() {
        let line = |arguments: &[&str]| {
            let given: Vec<OsString> = arguments.iter().map(OsString::from).collect();
            words(&Program::demo(&given), arguments, false).join(" ")
        };
        let first = line(&["--seed", "4"]);
        assert!(
            first.ends_with("-p quadlab --bin quadlab --no-default-features -- demo --seed 4"),
            "{first}"
        );
        for arguments in [&["--lab"][..], &["--flights", "mine"], &["--out", "o", "--flights=mine"]] {
            assert!(line(arguments).contains("--bin quadlab -- demo --"), "{}", line(arguments));
        }
    }

    #[test]
    fn cargo_is_quiet_only_when_asked() {
        assert!(words(&Program::SIL, &[], true).contains(&"--quiet".to_owned()));
        assert!(!words(&Program::SIL, &[], false).contains(&"--quiet".to_owned()));
    }

    #[cfg(unix)]
    #[test]
    fn exit_codes_and_signals_are_handed_on() {
        let after = |script: &str| {
            let status = Command::new("sh").args(["-c", script]).status().expect("sh starts");
            format!("{:?}", exit_code(status))
        };
        assert_eq!(after("exit 0"), format!("{:?}", ExitCode::from(0)));
        assert_eq!(after("exit 2"), format!("{:?}", ExitCode::from(2)));
        assert_eq!(after("kill -TERM $$"), format!("{:?}", ExitCode::from(143)));
    }

    #[cfg(unix)]
    #[test]
    fn every_line_is_seen_and_failure_is_reported() {
        let mut seen = Vec::new();
        let script = "echo one; printf 'two\\377\\n'; exit 1";
        let succeeded = filtered(Command::new("sh").args(["-c", script]), |line| {
            seen.push(line.to_owned());
            false
        })
        .expect("sh starts");
        assert!(!succeeded);
        assert_eq!(seen, ["one", "two\u{fffd}"]);
    }
}
