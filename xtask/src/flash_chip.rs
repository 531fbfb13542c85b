//! Flashing without ssh: a chip through a debug probe, or an emulator.
//!
//! A probe stops the chip whatever it is doing, and nobody can ask it over the link first: the craft has to stand without
//! propellers or battery on its motors.

<<<<<<< HEAD
use std::path::{Path, PathBuf};
=======
use std::path::Path;
>>>>>>> main
use std::process::{Command, ExitCode};

use anyhow::{Result, bail, ensure};

<<<<<<< HEAD
use crate::arm::{self, QEMU_ARM, QEMU_SYSTEM_ARM};
use crate::process::{shown, succeeds};
use crate::tools::Tool;
use crate::workspace::Workspace;
=======
use crate::arm::{self, QEMU_ARM, QEMU_SYSTEM_ARM, Target};
use crate::process::{shown, succeeds};
use crate::tools::Tool;
use crate::workspace::{self, Workspace};

/// Writes and reads chips through debug probes.
const PROBE_RS: Tool =
    Tool::of("probe-rs", &["probe-rs", "--version"], "cargo install --locked probe-rs-tools");

/// The chip that the firmware is linked for, and the variant of it with 1 MB that probe-rs shall take.
const CHIP: (&str, &str) = ("stm32f405", "STM32F405RGTx");
>>>>>>> main

/// What can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Emulated {
    /// The computer on module: Linux on ARM, its programs run by qemu-arm
    Armv7,
<<<<<<< HEAD
    /// The microcontroller: QEMU's mps2-an386 with its serial port on a TCP port of this machine
    #[value(name = "cortex-m4")]
=======
    /// The microcontroller: qemu-system-arm's board mps2-an386
>>>>>>> main
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

<<<<<<< HEAD
/// The emulated microcontroller's link to the ground.
const SERIAL_PORT: &str = "127.0.0.1:5740";

/// Writes programs into chips.
const PROBE_RS: Tool =
    Tool::of("probe-rs", &["probe-rs", "--version"], "cargo install --locked probe-rs-tools");

const GAINS: &str = "host-sim/model/vehicles/f330-gains.toml";

fn com_in_qemu(program: &Path) -> Command {
    let mut command = Command::new(QEMU_ARM.name);
    command.args(["-L", LIBRARIES]).arg(program).args(["lockstep", "--gains", GAINS]);
    command.current_dir(crate::workspace::root());
    command
=======
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
>>>>>>> main
}

fn mcu_in_qemu(program: &Path) -> Command {
    let mut command = Command::new(QEMU_SYSTEM_ARM.name);
    command.args(["-machine", "mps2-an386", "-cpu", "cortex-m4", "-display", "none", "-monitor", "none"]);
    command.args(["-serial", &format!("tcp:{SERIAL_PORT},server=on,wait=off"), "-kernel"]).arg(program);
    command
}

<<<<<<< HEAD
fn need(tool: &Tool) -> Result<()> {
    if tool.found().is_none() {
        bail!("{} is not installed: {}", tool.name, tool.install);
    }
    Ok(())
}

/// Starts the program in the emulator; there it answers (a simulator, or the ground over the serial port) until it is ended.
pub(crate) fn emulate(target: Emulated, gains: Option<PathBuf>, dry_run: bool) -> Result<ExitCode> {
    let (tool, name) = match target {
        Emulated::Armv7 => (&QEMU_ARM, "com for armv7, release"),
        Emulated::CortexM4 => (&QEMU_SYSTEM_ARM, "mcu for QEMU's mps2-an386"),
    };
    let run = |program: &Path| match target {
        Emulated::Armv7 => com_in_qemu(program),
        Emulated::CortexM4 => mcu_in_qemu(program),
    };
    if dry_run {
        println!("would build {name}, and run it:");
        println!("  {}", shown(&run(Path::new(if target == Emulated::Armv7 { "com" } else { "mcu" }))));
        return Ok(ExitCode::SUCCESS);
    }
    need(tool)?;
    let workspace = Workspace::load()?;
    let program = match target {
        Emulated::Armv7 => arm::com(&workspace)?,
        Emulated::CortexM4 => arm::chip(&workspace, arm::Chip::Emulated, gains)?,
    };
    let mut command = run(&program);
=======
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
>>>>>>> main
    println!("{}", shown(&command));
    Ok(ExitCode::from(u8::from(!succeeds(&mut command)?)))
}

<<<<<<< HEAD
/// Writes the program into a chip through a probe, reads it back, and starts it.
pub(crate) fn probe(chip: &str, gains: Option<PathBuf>, dry_run: bool) -> Result<ExitCode> {
    if !chip.to_ascii_uppercase().starts_with("STM32F405") {
        bail!("--probe {chip}: there is a program for the STM32F405 only (firmware/mcu/src/stm32f405.rs)");
    }
    let steps = |program: &Path| {
        let step = |first: &[&str]| {
            let mut command = Command::new(PROBE_RS.name);
            command.args(first).args(["--chip", chip]);
            command
        };
        let mut download = step(&["download", "--verify"]);
        download.arg(program);
        [download, step(&["reset"])]
    };
    if dry_run {
        println!("would build mcu for the STM32F405, with its gains built in:");
        steps(Path::new("mcu-stm32f405")).iter().for_each(|step| println!("  {}", shown(step)));
        return Ok(ExitCode::SUCCESS);
    }
    need(&PROBE_RS)?;
    let program = arm::chip(&Workspace::load()?, arm::Chip::Stm32f405, gains)?;
    for mut step in steps(&program) {
        println!("{}", shown(&step));
        if !succeeds(&mut step)? {
            bail!("`{}` failed; is the probe plugged in and the chip powered?", shown(&step));
        }
    }
    Ok(ExitCode::SUCCESS)
=======
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
>>>>>>> main
}
