//! `cargo xtask known`: brings the list of known violations up to date.

use std::process::ExitCode;

use anyhow::Result;

use crate::base::workspace::Workspace;
use crate::checks::known::{self, Entry, LIST};
use crate::checks::structure;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Add new violations too; a review should ask why
    #[arg(long)]
    add: bool,
}

/// Deletes what is mended, and lowers the lengths that have fallen; status 1 when there are new violations.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let violations = structure::violations(workspace)?;
    let found: Vec<Entry> = violations.into_iter().map(|violation| violation.entry).collect();
    let known = known::read()?;
    let kept = known::kept(&found, &known, options.add);
    known::write(&kept)?;
    println!("{LIST}: {} entries, {} before", kept.len(), known.len());
    let left = found.iter().filter(|found| !kept.iter().any(|entry| entry.covers(found))).count();
    if left > 0 {
        println!("{left} violations are new and not on the list; `cargo xtask test` names them");
    }
    Ok(ExitCode::from(u8::from(left > 0)))
}
