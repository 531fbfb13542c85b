//! `quadlab reference`: what the program knows of itself, for the book and for packages.
//!
//! ```text
//! DIR/man/*.1  DIR/completions/*  DIR/effects/*.md  DIR/effects/*.svg  DIR/schema/*.json
//! ```

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap_complete::Shell;

use crate::cli::output::Outcome;
use crate::commands::{reference_effects, reference_schemas};

/// Shells that completions are written for.
const SHELLS: [Shell; 4] = [Shell::Bash, Shell::Zsh, Shell::Fish, Shell::PowerShell];

/// Write man pages, shell completions, a page for each effect, and JSON Schemas.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab reference --out reference")]
pub(crate) struct Options {
    /// Folder to write to; files in it are overwritten, for example: --out reference
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Writes all of it, with the man pages and completions of `program`.
pub(crate) fn run(options: &Options, program: clap::Command) -> anyhow::Result<Outcome> {
    man(&program, &folder(options, "man")?)?;
    completions(program, &folder(options, "completions")?)?;
    reference_schemas::write(&folder(options, "schema")?)?;
    reference_effects::write(&folder(options, "effects")?)?;
    Ok(Outcome::done(format!("written to {}\n", options.out.display())))
}

/// A folder below the one of `--out`, made if it is not there.
fn folder(options: &Options, name: &str) -> anyhow::Result<PathBuf> {
    let path = options.out.join(name);
    std::fs::create_dir_all(&path)
        .with_context(|| format!("{}: cannot create the folder; give another with --out", path.display()))?;
    Ok(path)
}

/// A page for the program and one for each command, and each command of a command.
fn man(program: &clap::Command, folder: &Path) -> anyhow::Result<()> {
    // The help command repeats the others.
    let program = program.clone().disable_help_subcommand(true);
    clap_mangen::generate_to(program, folder)
        .with_context(|| format!("{}: cannot write the man pages", folder.display()))
}

fn completions(mut program: clap::Command, folder: &Path) -> anyhow::Result<()> {
    for shell in SHELLS {
        clap_complete::generate_to(shell, &mut program, "quadlab", folder)
            .with_context(|| format!("{}: cannot write completions for {shell}", folder.display()))?;
    }
    Ok(())
}
