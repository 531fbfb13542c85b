//! How many random cases a test draws.

use proptest::test_runner::Config;

/// As many as usual, or as `PROPTEST_CASES` says: an interpreter has no time for all, nor has a test of every mutant.
pub(crate) fn cases(usual: u32) -> Config {
    let default = Config::default();
    if std::env::var_os("PROPTEST_CASES").is_some() { default } else { Config { cases: usual, ..default } }
}
