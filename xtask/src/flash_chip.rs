//! Flashing without ssh: a chip through a debug probe, or an emulator.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Result, bail};

use crate::arm::{self, QEMU_ARM, QEMU_SYSTEM_ARM};
use crate::process::{shown, succeeds};
use crate::tools::Tool;
use crate::workspace::Workspace;

/// What can be emulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Emulated {
    /// The computer on module: Linux on ARM, its programs run by qemu-arm
    Armv7,
    /// The microcontroller: QEMU's mps2-an386 with its serial port on a TCP port of this machine
    #[value(name = "cortex-m4")]
    CortexM4,
}

/// Where ARM's C library lies on Debian.
const LIBRARIES: &str = "/usr/arm-linux-gnueabihf";

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
}

fn mcu_in_qemu(program: &Path) -> Command {
    let mut command = Command::new(QEMU_SYSTEM_ARM.name);
    command.args(["-machine", "mps2-an386", "-cpu", "cortex-m4", "-display", "none", "-monitor", "none"]);
    command.args(["-serial", &format!("tcp:{SERIAL_PORT},server=on,wait=off"), "-kernel"]).arg(program);
    command
}

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
    println!("{}", shown(&command));
    Ok(ExitCode::from(u8::from(!succeeds(&mut command)?)))
}

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
}
