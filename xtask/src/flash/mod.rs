//! `cargo xtask flash`: a new program onto a craft, and back to the one before.
//!
//! Three ways: onto a computer on module over ssh ([`crate::flash::com`]), onto a chip through a debug or into an
//! emulator ([`crate::flash::chip`]). `--dry-run` prints the steps and does none.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};

mod chip;
mod com;
mod destination;
mod release;

/// Options of the command.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("to").required(true))]
pub(crate) struct Options {
    /// Install on a computer with Linux and ssh
    #[arg(long, group = "to", value_name = "USER@HOST[:PORT]")]
    com: Option<destination::Destination>,
    /// Install on this chip, through a debug probe (probe-rs); take the propellers off
    #[arg(long, group = "to", value_name = "CHIP")]
    probe: Option<String>,
    /// Run in an emulator
    #[arg(long, group = "to", value_name = "TARGET")]
    qemu: Option<chip::Emulated>,
    /// Print what would be done, without doing it
    #[arg(long)]
    dry_run: bool,
    /// Go back to the program and files before the last flash
    #[arg(long, requires = "com")]
    rollback: bool,
    /// The craft's configuration (com.toml); its vehicle and gains files lie beside it and are copied too. By default
    /// the craft keeps the files that it has
    #[arg(long, requires = "com", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder on the craft
    #[arg(long, requires = "com", default_value = "/opt/quadlab", value_name = "DIR")]
    folder: String,
    /// Configuration file of ssh, in addition to the user's own
    #[arg(long, requires = "com", value_name = "FILE")]
    ssh_config: Option<PathBuf>,
    /// Command that runs the program on the craft, if its own processor cannot: `qemu-arm -L /usr/arm-linux-gnueabihf`
    #[arg(long, requires = "com", default_value = "", value_name = "COMMAND")]
    runner: String,
    /// Install this program instead of one built from this repository
    #[arg(long, requires = "com", value_name = "FILE")]
    program: Option<PathBuf>,
}

/// Does it.
pub(crate) fn run(options: Options) -> Result<ExitCode> {
    let Options { com, probe, qemu, dry_run, rollback, config, folder, ssh_config, runner, program } =
        options;
    if let Some(destination) = com {
        let flash = com::Flash { destination, config, folder, ssh_config, runner, program, rollback };
        return if dry_run { flash.print_steps() } else { flash.run() };
    }
    if let Some(chip) = probe {
        return chip::onto(&chip, dry_run);
    }
    match qemu {
        Some(target) => chip::emulate(target, dry_run),
        None => bail!("say where to: --com, --probe or --qemu"),
    }
}
