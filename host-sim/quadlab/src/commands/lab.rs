//! `quadlab lab`: the whole loop on a page in the browser.

use std::path::PathBuf;

use crate::cli::output::Outcome;
use crate::lab;

/// Look at flights and models on a page in the browser: compare, see where the model fails, add what is missing.
///
/// Serves a folder of flights or logs on this machine alone, and opens the browser. Models and notes are kept in `lab/` in that
/// folder; opening it again goes on where you were. Ends with Ctrl-C.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab lab my-flights")]
pub(crate) struct Options {
    /// Folder with flights or logs of any format that is read, and a vehicle.toml if there is one
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// Port of this machine, 0 for any that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,

    /// Print the address and do not open the browser
    #[arg(long)]
    no_open: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    lab::serve(&lab::Options { folder: options.folder.clone(), port: options.port, open: !options.no_open })?;
    Ok(Outcome::done(String::new()))
}
