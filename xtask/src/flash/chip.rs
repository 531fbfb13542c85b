//! Flashing without ssh: a chip through a debug probe, or an emulator.
//!
//! A probe stops the chip whatever it is doing, and nobody can ask it over the link first: the craft has to stand without
//! propellers or battery on its motors.

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Result, bail, ensure};

use crate::arm::{self, QEMU_ARM, QEMU_SYSTEM_ARM, Target};
use crate::base::process::{shown, succeeds};
use crate::base::tools::Tool;
use crate::base::workspace::{self, Workspace};

/// Writes and reads chips through debug probes.
const PROBE_RS: Tool =
    Tool::of("probe-rs", &["probe-rs", "--version"], "cargo install --locked probe-rs-tools");

/// The chip that the firmware is linked for, and the variant of it with 1 MB that probe-rs shall take.
const CHIP: (&str, &str) = ("stm32f405", "STM32F405RGTx");

/// What can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Emulated {
    /// The computer on module: Linux on ARM, its programs run by qemu-arm
    Armv7,
    /// The microcontroller: qemu-system-arm's board mps2-an386
    CortexM4,
}

/// probe-rs' name of a chip.
fn variant(chip: &str) -> Result<String> {
    let (family, usual) = CHIP;
    let lower = chip.to_lowercase();
    ensure!(
        lower.starts_with(family) && lower.chars().all(|c| c.is_ascii_alphanumeric()),
        "--probe {chip}: the microcontroller's program is for {family} (or a variant of it, such as {usual})"
    );
    Ok(if lower == family { usual.to_owned() } else { chip.to_owned() })
}

/// What is done with a probe: write and compare, then start.
fn with_probe(chip: &str, program: &Path) -> [Command; 2] {
    let mut download = Command::new(PROBE_RS.name);
    download.args(["download", "--chip", chip, "--verify"]).arg(program);
    let mut reset = Command::new(PROBE_RS.name);
    reset.args(["reset", "--chip", chip]);
    [download, reset]
}

/// Onto a chip.
pub(crate) fn onto(chip: &str, dry_run: bool) -> Result<ExitCode> {
    let chip = variant(chip)?;
    if dry_run {
        println!("would build mcu for {chip}, and with the propellers off run:");
        for command in with_probe(&chip, Path::new("mcu-stm32f405")) {
            println!("  {}", shown(&command));
        }
        return Ok(ExitCode::SUCCESS);
    }
    if PROBE_RS.found().is_none() {
        bail!("{} is not installed: {}", PROBE_RS.name, PROBE_RS.install);
    }
    let program = arm::board_program(&Workspace::load()?)?;
    println!("a probe stops the chip in whatever it is doing: are the propellers off?");
    for mut command in with_probe(&chip, &program) {
        println!("{}", shown(&command));
        ensure!(succeeds(&mut command)?, "`{}` failed", shown(&command));
    }
    Ok(ExitCode::SUCCESS)
}

const GAINS: &str = "host-sim/model/vehicles/f330-gains.toml";

/// What runs a program in the emulator.
fn emulator(target: Emulated, program: &Path) -> Command {
    match target {
        Emulated::Armv7 => {
            let mut command = Command::new(QEMU_ARM.name);
            command.args(["-L", "/usr/arm-linux-gnueabihf"]).arg(program);
            // Relative to the workspace.
            command.args(["lockstep", "--gains", GAINS]).current_dir(workspace::root());
            command
        }
        Emulated::CortexM4 => {
            let mut command = Command::new(QEMU_SYSTEM_ARM.name);
            command.args([
                "-machine",
                "mps2-an386",
                "-cpu",
                "cortex-m4",
                "-display",
                "none",
                "-monitor",
                "none",
            ]);
            // Its link: QEMU prints which terminal it is on.
            command.args(["-serial", "pty", "-kernel"]).arg(program);
            command
        }
    }
}

/// Starts the program in the emulator, where it runs until it is ended.
pub(crate) fn emulate(target: Emulated, dry_run: bool) -> Result<ExitCode> {
    let (name, of) = match target {
        Emulated::Armv7 => ("com", Target::Armv7),
        Emulated::CortexM4 => ("mcu", Target::CortexM4),
    };
    if dry_run {
        println!("would build {name} for {}, and run:", of.name());
        println!("  {}", shown(&emulator(target, Path::new(name))));
        return Ok(ExitCode::SUCCESS);
    }
    let program = arm::build(&Workspace::load()?, of, name, &[name], &[])?.remove(0);
    let mut command = emulator(target, &program);
    println!("{}", shown(&command));
    Ok(ExitCode::from(u8::from(!succeeds(&mut command)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_chip_that_the_program_is_linked_for_is_written() {
        assert_eq!(variant("stm32f405").unwrap(), "STM32F405RGTx");
        assert_eq!(variant("STM32F405VGTx").unwrap(), "STM32F405VGTx");
        for chip in ["stm32f407", "", "nrf52840", "stm32f405 --help"] {
            assert!(variant(chip).unwrap_err().to_string().contains("stm32f405"), "{chip}");
        }
        let [download, reset] = with_probe("STM32F405RGTx", Path::new("p")).map(|command| shown(&command));
        assert_eq!(download, "probe-rs download --chip STM32F405RGTx --verify p");
        assert_eq!(reset, "probe-rs reset --chip STM32F405RGTx");
    }
}
