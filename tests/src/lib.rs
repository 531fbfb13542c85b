//! What stories across crates share: where they find data that is not part of the project, and
//! flights of worlds that were not made with the product's plant ([`world`]).
//!
//! Reference numbers and flights of others lie in a folder `shared` beside the repository (or where
//! `QUADLAB_SHARED` points). Without it the tests that need it pass and print `SKIPPED`.
#![forbid(unsafe_code)]

pub mod world;

use std::path::PathBuf;
use std::process::Command;

/// A file or folder of the shared data, or nothing (and a line that says so) when it is not there.
pub fn shared(relative: &str) -> Option<PathBuf> {
    let root = std::env::var_os("QUADLAB_SHARED")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")), PathBuf::from);
    let path = root.join(relative);
    if path.exists() {
        return Some(path);
    }
    report_skipped(relative);
    None
}

/// A program as this workspace builds it. It is built where it is not there; `cargo test -p stories` does not build it anew.
pub fn program(name: &str) -> PathBuf {
    let mut path = std::env::current_exe().expect("a test knows where it is");
    path.pop();
    if path.ends_with("deps") {
        path.pop();
    }
    let path = path.join(name);
    if !path.exists() {
        // As this program was built: a bench needs an optimised one.
        let profile =
            path.parent().and_then(|folder| folder.file_name()).filter(|profile| *profile == "release");
        let mut build = Command::new(env!("CARGO"));
        let built =
            build.args(["build", "-p", name, "--bin", name]).args(profile.map(|_| "--release")).status();
        assert!(
            built.is_ok_and(|status| status.success()) && path.exists(),
            "{} is not there",
            path.display()
        );
    }
    path
}

#[expect(clippy::print_stdout, reason = "the test runner collects these lines")]
fn report_skipped(relative: &str) {
    println!("SKIPPED: shared/{relative} is not beside the repository");
}
