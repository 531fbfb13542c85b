//! Steps of `cargo xtask test`: what one is, and what counts its outcome.

use std::process::Command;

use anyhow::{Context, Result};

use crate::base::process::{filtered, shown, succeeds};
use crate::base::tally::{self, LibtestReader, Tally};
use crate::base::tools::Tool;
use crate::base::workspace::{self, Workspace};

/// What came of a step.
pub(crate) enum Outcome {
    /// The step ran; counts of tests, or one for the check itself.
    Ran(Tally),
    /// The step could not run: what, why and the line that mends it.
    Skipped(String),
}

/// One step: a name, what it is for, the tools it needs besides cargo, and the doing.
pub(crate) struct Step {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) tools: &'static [&'static Tool],
    pub(crate) run: fn(&Workspace) -> Result<Outcome>,
}

/// The count of a check that is one thing: it holds or not.
pub(crate) fn one(holds: bool) -> Tally {
    Tally { passed: usize::from(holds), failed: usize::from(!holds), ..Tally::default() }
}

/// A command as a check: it succeeds or not.
pub(crate) fn command_holds(command: Command) -> Result<Outcome> {
    Ok(Outcome::Ran(holds(command)?))
}

/// The count of a command that succeeds or not.
pub(crate) fn holds(mut command: Command) -> Result<Tally> {
    println!("   {}", shown(&command));
    Ok(one(succeeds(&mut command)?))
}

/// A step whose tool is not there.
pub(crate) fn missing(tool: &Tool) -> Outcome {
    Outcome::Skipped(format!("{} is not installed: {}", tool.name, tool.install))
}

/// Prints a check's problems; the check holds when there are none.
pub(crate) fn listed(about: &str, problems: &[String]) -> Outcome {
    println!("   {about}");
    for problem in problems {
        println!("   {problem}");
    }
    Outcome::Ran(one(problems.is_empty()))
}

/// Runs `cargo test`, counting from what the test harnesses print.
pub(crate) fn harness(mut command: Command) -> Result<Tally> {
    println!("   {}", shown(&command));
    let mut reader = LibtestReader::default();
    let succeeded = filtered(&mut command, |line| reader.line(line))?;
    Ok(agreeing(reader.finish(), succeeded))
}

/// Where nextest leaves its report, from the root: `.config/nextest.toml` says so, whatever the target folder.
const JUNIT_REPORT: &str = "target/nextest/xtask/junit.xml";

/// Runs nextest with its profile `xtask`, counting from the JUnit report that this asks for.
pub(crate) fn nextest(mut command: Command) -> Result<Tally> {
    let report = workspace::root().join(JUNIT_REPORT);
    // A report of an earlier run must not be taken for this one's when nothing compiles.
    if report.exists() {
        std::fs::remove_file(&report).with_context(|| format!("cannot remove {}", report.display()))?;
    }
    println!("   {}", shown(&command));
    let succeeded = succeeds(&mut command)?;
    if !succeeded && !report.exists() {
        return Ok(one(false));
    }
    let xml = std::fs::read_to_string(&report)
        .with_context(|| format!("nextest left no report to count from: {}", report.display()))?;
    Ok(agreeing(tally::from_junit(&xml)?, succeeded))
}

/// A run that failed without a failed test (it did not compile, or crashed) is one failure all the same.
pub(crate) fn agreeing(mut tally: Tally, succeeded: bool) -> Tally {
    if !succeeded && tally.failed == 0 {
        tally.failed = 1;
    }
    tally
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_fails_without_a_failed_test_is_a_failure() {
        let two = Tally { passed: 2, ..Tally::default() };
        assert_eq!(agreeing(two.clone(), false).failed, 1);
        assert_eq!(agreeing(two, true).failed, 0);
        assert_eq!(agreeing(Tally { failed: 3, ..Tally::default() }, false).failed, 3);
    }

    #[test]
    fn problems_make_a_check_fail() {
        let failed = |problems: &[String]| match listed("a check", problems) {
            Outcome::Ran(tally) => tally.failed,
            Outcome::Skipped(_) => panic!("a check that ran was skipped"),
        };
        assert_eq!(failed(&[]), 0);
        assert_eq!(failed(&["a problem".to_owned(), "another".to_owned()]), 1);
    }
}
