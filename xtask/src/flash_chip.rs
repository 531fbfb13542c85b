//! Flashing without ssh: a chip through a debug probe, or an emulator.

use std::process::{Command, ExitCode};

use anyhow::{Result, bail};

use crate::armv7;
use crate::process::{output_of, shown, succeeds};

/// What can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Emulated {
    /// The computer on module: Linux on ARM, its programs run by qemu-arm
    Armv7,
}

/// Where ARM's C library lies on Debian.
const LIBRARIES: &str = "/usr/arm-linux-gnueabihf";

fn com_in_qemu(program: &std::path::Path) -> Command {
    let mut command = Command::new("qemu-arm");
    command.args(["-L", LIBRARIES]).arg(program).args(["lockstep", "--gains", GAINS]);
    command.current_dir(crate::workspace::root());
    command
}

const GAINS: &str = "host-sim/model/vehicles/f330-gains.toml";

/// Starts the program in the emulator; there it answers a simulator until it is ended.
pub(crate) fn emulate(target: Emulated, dry_run: bool) -> Result<ExitCode> {
    let Emulated::Armv7 = target;
    if dry_run {
        println!("would build com for armv7, release, and run it:");
        println!("  {}", shown(&com_in_qemu(std::path::Path::new("com"))));
        return Ok(ExitCode::SUCCESS);
    }
    if output_of(Command::new("qemu-arm").arg("--version")).is_none() {
        bail!("qemu-arm is not installed: apt-get install --yes qemu-user");
    }
    let mut command = com_in_qemu(&armv7::build()?);
    println!("{}", shown(&command));
    Ok(ExitCode::from(u8::from(!succeeds(&mut command)?)))
}
