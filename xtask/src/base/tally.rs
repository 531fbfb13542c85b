//! Counting tests from what the test runners really reported.
//!
//! A test that cannot run (its data are not there, say) passes and prints a line `SKIPPED: what and why`.
//! Runners hide what passed tests print, so those lines are gathered here: such a test counts as skipped,
//! and its line is shown again in the summary. nextest reports as JUnit XML, `cargo test` as text.

use std::collections::BTreeSet;

use anyhow::{Context, Result};
use roxmltree::Document;

/// How a test says that it did not do all it could.
pub(crate) const SKIP_MARK: &str = "SKIPPED:";

/// Numbers of tests and checks, and the lines of those that were skipped.
#[derive(Debug, Default, PartialEq, Eq, Clone)]
pub(crate) struct Tally {
    pub(crate) passed: usize,
    pub(crate) failed: usize,
    pub(crate) skipped: usize,
    /// One line for each thing left out, beginning with the mark.
    pub(crate) skip_lines: Vec<String>,
}

impl Tally {
    /// Adds another tally to this one.
    pub(crate) fn add(&mut self, other: &Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.skipped += other.skipped;
        self.skip_lines.extend_from_slice(&other.skip_lines);
    }

    /// Keeps the line of a skipped test; counting it is the caller's.
    fn note_skip(&mut self, test: &str, line: &str) {
        let reason = line.trim_start().trim_start_matches(SKIP_MARK).trim();
        self.skip_lines.push(format!("{SKIP_MARK} {reason} ({test})"));
    }
}

/// The closing line.
impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

fn is_skip_line(line: &str) -> bool {
    line.trim_start().starts_with(SKIP_MARK)
}

/// Reads nextest's JUnit report. It leaves out ignored tests: see [`ignored_in_list`].
pub(crate) fn from_junit(xml: &str) -> Result<Tally> {
    let document = Document::parse(xml).context("nextest's JUnit report is not XML")?;
    let mut tally = Tally::default();
    for case in document.descendants().filter(|node| node.has_tag_name("testcase")) {
        let parts: Vec<_> = case.children().filter(roxmltree::Node::is_element).collect();
        if parts.iter().any(|part| ["failure", "error"].contains(&part.tag_name().name())) {
            tally.failed += 1;
            continue;
        }
        let binary = case.attribute("classname").unwrap_or_default();
        let test = format!("{binary} {}", case.attribute("name").unwrap_or_default());
        let printed = parts.iter().filter(|part| part.tag_name().name().starts_with("system-"));
        let lines = printed.filter_map(roxmltree::Node::text).flat_map(str::lines);
        let before = tally.skip_lines.len();
        lines.filter(|line| is_skip_line(line)).for_each(|line| tally.note_skip(test.trim(), line));
        if tally.skip_lines.len() > before {
            tally.skipped += 1;
        } else {
            tally.passed += 1;
        }
    }
    Ok(tally)
}

/// Ignored tests in `cargo nextest list --message-format json`.
pub(crate) fn ignored_in_list(json: &str) -> Result<Tally> {
    let list: serde_json::Value =
        serde_json::from_str(json).context("nextest's list of tests is not JSON")?;
    let suites = list["rust-suites"].as_object().context("nextest's list of tests has no rust-suites")?;
    let mut tally = Tally::default();
    for (suite, content) in suites {
        let tests = content["testcases"].as_object().into_iter().flatten();
        for (test, _) in tests.filter(|(_, content)| content["ignored"] == true) {
            tally.skipped += 1;
            tally.note_skip(&format!("{suite} {test}"), "the test is marked as ignored");
        }
    }
    Ok(tally)
}

/// Reads the output of `cargo test -- --show-output` line by line.
#[derive(Default)]
pub(crate) struct LibtestReader {
    tally: Tally,
    /// Inside the part that repeats what passed tests printed.
    in_successes: bool,
    /// The test whose output follows.
    test: String,
    /// Tests of the running binary that printed a skip line.
    skipped: BTreeSet<String>,
}

impl LibtestReader {
    /// Takes one line; answers whether a person wants to see it, too.
    pub(crate) fn line(&mut self, line: &str) -> bool {
        match line.trim_end() {
            "successes:" => self.in_successes = true,
            "failures:" => self.in_successes = false,
            _ => {}
        }
        if let Some(counts) = line.strip_prefix("test result: ") {
            self.in_successes = false;
            self.binary_done(counts);
        } else if let Some(test) =
            line.strip_prefix("---- ").and_then(|rest| rest.strip_suffix(" stdout ----"))
        {
            self.test = test.to_owned();
        } else if self.in_successes && is_skip_line(line) {
            self.skipped.insert(self.test.clone());
            self.tally.note_skip(&self.test, line);
        } else if let Some((test, _)) =
            line.strip_prefix("test ").and_then(|rest| rest.split_once(" ... ignored"))
        {
            self.tally.note_skip(test, "the test is marked as ignored");
        }
        !self.in_successes
    }

    /// Adds the counts of a binary: `ok. 3 passed; 0 failed; 1 ignored; ...`.
    fn binary_done(&mut self, counts: &str) {
        let count = |what: &str| {
            let words: Vec<&str> = counts.split([' ', ';']).filter(|word| !word.is_empty()).collect();
            let pair = words.windows(2).find(|pair| pair[1] == what);
            pair.and_then(|pair| pair[0].parse::<usize>().ok()).unwrap_or(0)
        };
        let skipped = std::mem::take(&mut self.skipped).len();
        self.tally.passed += count("passed").saturating_sub(skipped);
        self.tally.failed += count("failed");
        self.tally.skipped += count("ignored") + skipped;
    }

    /// What was counted.
    pub(crate) fn finish(self) -> Tally {
        self.tally
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by cargo-nextest 0.9.143, shortened.
    const JUNIT: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<testsuites name="nextest-run" tests="3" skipped="0" failures="1" errors="0" time="0.118">
    <testsuite name="nx" tests="3" skipped="0" errors="0" failures="1">
        <testcase name="tests::ok" classname="nx" time="0.015">
            <system-out>
running 1 test
test tests::ok ... ok
</system-out>
            <system-err></system-err>
        </testcase>
        <testcase name="tests::skips" classname="nx" time="0.010">
            <system-out>
running 1 test
SKIPPED: the thing, no ../shared &lt;x&gt;
test tests::skips ... ok
</system-out>
            <system-err>SKIPPED: another part</system-err>
        </testcase>
        <testcase name="tests::bad" classname="nx" time="0.116">
            <failure message="no" type="test failure with exit code 101">no</failure>
            <system-out>SKIPPED: does not matter, the test failed</system-out>
        </testcase>
    </testsuite>
</testsuites>"#;

    #[test]
    fn junit_reports_are_counted() {
        let expected = Tally {
            passed: 1,
            failed: 1,
            skipped: 1,
            skip_lines: vec![
                "SKIPPED: the thing, no ../shared <x> (nx tests::skips)".into(),
                "SKIPPED: another part (nx tests::skips)".into(),
            ],
        };
        assert_eq!(from_junit(JUNIT).expect("XML"), expected);
        assert!(from_junit("<testsuites>").is_err());
    }

    #[test]
    fn ignored_tests_are_found_in_the_list() {
        let json = r#"{"test-count": 2, "rust-suites": {"nx": {"testcases": {
            "tests::ign": {"kind": "test", "ignored": true},
            "tests::ok": {"kind": "test", "ignored": false}}}, "built-only": {}}}"#;
        let tally = ignored_in_list(json).expect("JSON");
        assert_eq!((tally.passed, tally.skipped), (0, 1));
        assert_eq!(tally.skip_lines, ["SKIPPED: the test is marked as ignored (nx tests::ign)"]);
        assert!(ignored_in_list("{}").is_err());
    }

    /// Written by the test harness of Rust 1.95, two binaries, the second with one passed doc test.
    const LIBTEST: &str = "
running 4 tests
test tests::ign ... ignored, slow
test tests::ok ... ok
test tests::skips ... ok
test tests::bad ... FAILED

successes:

---- tests::skips stdout ----
SKIPPED: the thing, no ../shared <x>


successes:
    tests::ok
    tests::skips

failures:

---- tests::bad stdout ----
hello
SKIPPED: does not matter, the test failed

failures:
    tests::bad

test result: FAILED. 2 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.10s


running 1 test
test src/lib.rs - f (line 1) ... ok

test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s
";

    #[test]
    fn harness_output_is_counted_and_successes_are_hidden() {
        let mut reader = LibtestReader::default();
        let shown: Vec<&str> = LIBTEST.lines().filter(|line| reader.line(line)).collect();
        let tally = reader.finish();
        assert_eq!((tally.passed, tally.failed, tally.skipped), (2, 1, 2));
        assert_eq!(
            tally.skip_lines,
            [
                "SKIPPED: the test is marked as ignored (tests::ign)",
                "SKIPPED: the thing, no ../shared <x> (tests::skips)",
            ]
        );
        assert!(shown.contains(&"hello") && shown.contains(&"test tests::ok ... ok"), "{shown:?}");
        assert!(!shown.contains(&"SKIPPED: the thing, no ../shared <x>"), "{shown:?}");
    }

    #[test]
    fn the_closing_line_has_the_promised_form() {
        let tally = Tally { passed: 12, failed: 0, skipped: 3, skip_lines: Vec::new() };
        assert_eq!(tally.to_string(), "12 passed, 0 failed, 3 skipped");
    }
}
