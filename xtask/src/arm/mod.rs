//! The craft's two processors: how their programs are built here, run in QEMU, sized and measured.
//!
//! A target is built with the toolchain that runs `cargo xtask` where it has the target's standard library (`rustup target add`);
//! otherwise with the distribution's (Debian, Ubuntu: rustc-web, cargo-web, rust-web-src) in /usr/bin, which builds the standard
//! library from its source. Both lay their files into `arm` in the target folder, so they do not disturb the host's.
//!
//! Deliberately absent: what the programs compute. Whether they give the host's bits is for the tests of `sil` to say.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, elf};
use serde_json::{Value, json};

use crate::base::process::{cargo, output_of, shown, succeeds};
use crate::base::tools::Tool;
use crate::base::workspace::Workspace;

/// Options of the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Print one JSON document on standard output and nothing else
    #[arg(long)]
    json: bool,
}

/// One of the craft's processors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    /// ARM Linux, the computer on module.
    Armv7,
    /// Bare Cortex-M4F.
    CortexM4,
}

impl Target {
    pub(crate) const ALL: [Self; 2] = [Self::Armv7, Self::CortexM4];

    /// Its name in commands.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Armv7 => "armv7",
            Self::CortexM4 => "cortex-m4",
        }
    }

    /// Rust's name for it.
    pub(crate) const fn triple(self) -> &'static str {
        match self {
            Self::Armv7 => "armv7-unknown-linux-gnueabihf",
            Self::CortexM4 => "thumbv7em-none-eabihf",
        }
    }

    /// The lines that make it buildable, the better one first.
    pub(crate) const fn install(self) -> [&'static str; 2] {
        const DISTRIBUTION: &str =
            "apt-get install --yes rustc-web cargo-web rust-web-src binutils-arm-none-eabi";
        match self {
            Self::Armv7 => ["rustup target add armv7-unknown-linux-gnueabihf", DISTRIBUTION],
            Self::CortexM4 => ["rustup target add thumbv7em-none-eabihf", DISTRIBUTION],
        }
    }

    /// Parts of the standard library that its programs need.
    const fn standard_library(self) -> &'static str {
        match self {
            Self::Armv7 => "std,panic_abort",
            Self::CortexM4 => "core,panic_abort",
        }
    }

    /// Outside programs that building and running needs.
    const fn tools(self) -> [&'static Tool; 2] {
        match self {
            Self::Armv7 => [&ARM_GCC, &QEMU_ARM],
            Self::CortexM4 => [&ARM_LD, &QEMU_SYSTEM_ARM],
        }
    }
}

/// Links programs for ARM Linux.
pub(crate) const ARM_GCC: Tool = Tool::of(
    "arm-linux-gnueabihf-gcc",
    &["arm-linux-gnueabihf-gcc", "--version"],
    "apt-get install --yes gcc-arm-linux-gnueabihf libc6-dev-armhf-cross",
);
/// Links programs for bare ARM chips.
pub(crate) const ARM_LD: Tool = Tool::of(
    "arm-none-eabi-ld",
    &["arm-none-eabi-ld", "--version"],
    "apt-get install --yes binutils-arm-none-eabi",
);
/// Runs programs for ARM Linux.
pub(crate) const QEMU_ARM: Tool =
    Tool::of("qemu-arm", &["qemu-arm", "--version"], "apt-get install --yes qemu-user");
/// Runs programs for ARM chips.
pub(crate) const QEMU_SYSTEM_ARM: Tool = Tool::of(
    "qemu-system-arm",
    &["qemu-system-arm", "--version"],
    "apt-get install --yes --no-install-recommends qemu-system-arm",
);

/// How a target can be built here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Toolchain {
    /// By the toolchain that runs this, which has the target.
    Own,
    /// By the distribution's, from the source of the standard library.
    Distribution,
}

const DISTRIBUTION_RUSTC: &str = "/usr/bin/rustc";
const DISTRIBUTION_CARGO: &str = "/usr/bin/cargo";

impl Toolchain {
    /// The better way that is open.
    pub(crate) fn of(target: Target) -> Option<Self> {
        let mut rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        let libraries = output_of(rustc.args(["--print", "target-libdir", "--target", target.triple()]));
        if libraries.is_some_and(|folder| Path::new(folder.trim()).is_dir()) {
            return Some(Self::Own);
        }
        let sysroot = output_of(Command::new(DISTRIBUTION_RUSTC).args(["--print", "sysroot"]))?;
        let source = Path::new(sysroot.trim()).join("lib/rustlib/src/rust/library/core/src/lib.rs");
        (source.is_file() && Path::new(DISTRIBUTION_CARGO).is_file()).then_some(Self::Distribution)
    }

    /// What it is, for people.
    pub(crate) fn describe(&self) -> &'static str {
        match self {
            Self::Own => "this toolchain has the target",
            Self::Distribution => "the distribution's Rust in /usr/bin builds it with its standard library",
        }
    }

    /// A cargo command (`build`, `clippy`) for a target.
    fn cargo(&self, what: &str, target: Target, workspace: &Workspace) -> Command {
        let mut command = match self {
            Self::Own => cargo([what]),
            Self::Distribution => {
                let mut command = Command::new(DISTRIBUTION_CARGO);
                command.arg(what).current_dir(crate::base::workspace::root());
                command.env("RUSTC", DISTRIBUTION_RUSTC).env("RUSTC_BOOTSTRAP", "1");
                command.env_remove("CARGO").env_remove("RUSTUP_TOOLCHAIN").env_remove("RUSTDOC");
                command.arg(format!("-Zbuild-std={}", target.standard_library()));
                command
            }
        };
        command.args(["--target", target.triple()]);
        command.env("CARGO_TARGET_DIR", folder(workspace));
        match target {
            Target::Armv7 => {
                command.env("CARGO_TARGET_ARMV7_UNKNOWN_LINUX_GNUEABIHF_LINKER", ARM_GCC.name);
            }
            // Rust's own toolchain has a linker for it, the distribution's has not.
            Target::CortexM4 if *self == Self::Distribution => {
                command.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", ARM_LD.name);
            }
            Target::CortexM4 => {}
        }
        command
    }
}

/// The profile of a package's programs: what flies on Linux may unwind to its guardian, what flies on a chip has nowhere to.
fn profile(package: &str) -> &'static str {
    if package == COM { "release" } else { "firmware" }
}

/// Where ARM programs are built.
fn folder(workspace: &Workspace) -> PathBuf {
    workspace.metadata.target_directory.join("arm").into_std_path_buf()
}

/// A program as it was built.
fn path_of(workspace: &Workspace, target: Target, package: &str, program: &str) -> PathBuf {
    folder(workspace).join(target.triple()).join(profile(package)).join(program)
}

/// The first thing that is missing to build and run programs of a target, and the line that installs it.
pub(crate) fn missing(target: Target) -> Option<String> {
    if Toolchain::of(target).is_none() {
        let [rustup, distribution] = target.install();
        return Some(format!("no toolchain builds {}: {rustup}, or {distribution}", target.triple()));
    }
    let tool = target.tools().into_iter().find(|tool| tool.found().is_none())?;
    Some(format!("{} is not installed: {}", tool.name, tool.install))
}

/// Builds programs of one package; their paths.
pub(crate) fn build(
    workspace: &Workspace,
    target: Target,
    package: &str,
    programs: &[&str],
    features: &[&str],
) -> Result<Vec<PathBuf>> {
    build_with(workspace, target, (package, programs), features, &[])
}

/// The microcontroller's program with a link's key built in.
pub(crate) fn build_with_key(workspace: &Workspace, key: &Path) -> Result<()> {
    build_with(workspace, Target::CortexM4, ("mcu", &["mcu"]), &[], &[("QUADLAB_KEY", key.as_os_str())])?;
    Ok(())
}

fn build_with(
    workspace: &Workspace,
    target: Target,
    (package, programs): (&str, &[&str]),
    features: &[&str],
    variables: &[(&str, &OsStr)],
) -> Result<Vec<PathBuf>> {
    if let Some(missing) = missing(target) {
        bail!("{missing} (`cargo xtask setup` does it)");
    }
    let Some(toolchain) = Toolchain::of(target) else { bail!("{} cannot be built here", target.name()) };
    let mut command = toolchain.cargo("build", target, workspace);
    command.args(["--quiet", "--profile", profile(package), "--package", package]);
    command.args(programs.iter().flat_map(|program| ["--bin", program]));
    command.args(features.iter().flat_map(|feature| ["--features", feature]));
    command.envs(variables.iter().copied());
    eprintln!("   {}", shown(&command));
    if !succeeds(command.stdout(std::process::Stdio::null()))? {
        bail!("{} does not build for {}", programs.join(", "), target.triple());
    }
    Ok(programs.iter().map(|program| path_of(workspace, target, package, program)).collect())
}

/// Clippy over what only the craft's processors compile: the boards, and code that is other where words have 32 bits. Of targets
/// that this toolchain has; the distribution's has no clippy. With the profile of the programs, which share what it builds for here.
pub(crate) fn lints(workspace: &Workspace) -> Vec<Command> {
    const OF: [(Target, &str, &[&str]); 3] = [
        (Target::CortexM4, "mcu", &["--bins"]),
        (Target::CortexM4, "mcu", &["--bin", "mcu", "--features", "stm32f405"]),
        (Target::Armv7, COM, &["--bins", "--package", "craft"]),
    ];
    let own = OF.into_iter().filter(|(target, ..)| Toolchain::of(*target) == Some(Toolchain::Own));
    own.map(|(target, package, more)| {
        let mut command = Toolchain::Own.cargo("clippy", target, workspace);
        command.args(["--quiet", "--profile", profile(package), "--package", package, "--lib"]);
        command.args(more).args(["--", "-D", "warnings"]);
        command
    })
    .collect()
}

fn build_one(workspace: &Workspace, target: Target, package: &str, program: &str) -> Result<PathBuf> {
    Ok(build(workspace, target, package, &[program], &[])?.remove(0))
}

/// The craft computer's program, which also answers a simulator.
const COM: &str = "com";
/// The program that answers with digests of whole ticks, on each target.
const fn lockstep(target: Target) -> (&'static str, &'static str) {
    match target {
        Target::Armv7 => ("craft", "craft-lockstep"),
        Target::CortexM4 => ("mcu", "mcu-lockstep"),
    }
}

/// What `sil --on` needs behind its other arguments: the program, freshly built.
pub(crate) fn arguments_of_sil(workspace: &Workspace, arguments: &[OsString]) -> Result<Vec<OsString>> {
    let Some(target) = asked_for(arguments) else { return Ok(Vec::new()) };
    let compares = arguments.iter().any(|argument| argument == "--same-bits");
    let (package, program) = match target {
        Target::Armv7 if !compares => (COM, COM),
        _ => lockstep(target),
    };
    Ok(vec!["--firmware".into(), build_one(workspace, target, package, program)?.into()])
}

/// The value of `--on`, if it is one of the craft's processors.
fn asked_for(arguments: &[OsString]) -> Option<Target> {
    let mut words = arguments.iter().map(|argument| argument.to_string_lossy());
    let mut found = None;
    while let Some(word) = words.next() {
        let value = match word.strip_prefix("--on") {
            Some("") => words.next(),
            Some(rest) => rest.strip_prefix('=').map(|value| value.to_owned().into()),
            None => None,
        };
        let named = value.and_then(|value| Target::ALL.into_iter().find(|target| target.name() == value));
        found = found.or(named);
    }
    found
}

/// Bytes of a program by where they lie on the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Sizes {
    /// Code and constants, and what variables start with.
    flash: u64,
    /// Variables; the stack comes on top.
    ram: u64,
}

fn sizes(path: &Path) -> Result<Sizes> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is no program", path.display()))?;
    let mut sizes = Sizes { flash: 0, ram: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        let filled = section.file_range().is_some();
        if filled {
            sizes.flash += section.size();
        }
        if sh_flags & u64::from(elf::SHF_WRITE) != 0 {
            sizes.ram += section.size();
        }
    }
    Ok(sizes)
}

/// What the measuring program says of itself in the emulator.
fn measured(program: &Path) -> Result<Value> {
    let mut qemu = Command::new(QEMU_SYSTEM_ARM.name);
    qemu.args(["-machine", "mps2-an386", "-cpu", "cortex-m4", "-display", "none", "-monitor", "none"]);
    qemu.args(["-serial", "none", "-icount", "shift=6"]);
    qemu.args(["-semihosting-config", "enable=on,target=native", "-kernel"]).arg(program);
    let output = qemu.output().with_context(|| format!("cannot start `{}`", shown(&qemu)))?;
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    let line = said.lines().find(|line| line.starts_with('{'));
    match line {
        Some(line) if output.status.success() => Ok(serde_json::from_str(line)?),
        _ => bail!("the measuring program failed in the emulator ({}): {said}", output.status),
    }
}

/// What there is to know of the microcontroller's program.
fn report(workspace: &Workspace) -> Result<Value> {
    let target = Target::CortexM4;
    // The board's first: the emulated one has the same name, and is the one to stay.
    let board = sizes(&board_program(workspace)?)?;
    // It links, so no panic can be reached.
    let programs = ["mcu", "mcu-lockstep", "mcu-measure", "mcu-no-panic"];
    let built = build(workspace, target, "mcu", &programs, &[])?;
    let [emulated, _, measure, _] = &built[..] else { bail!("as many programs as were asked for") };
    let emulated = sizes(emulated)?;
    let measured = measured(measure)?;
    Ok(json!({
        "toolchain": Toolchain::of(target).map(|toolchain| toolchain.describe()),
        "panics_in_flight": 0,
        "mps2_an386": { "flash_bytes": emulated.flash, "ram_bytes": emulated.ram },
        "stm32f405": { "flash_bytes": board.flash, "ram_bytes": board.ram },
        "measured": measured,
    }))
}

/// The program for a real board, beside the emulator's: both have one name.
pub(crate) fn board_program(workspace: &Workspace) -> Result<PathBuf> {
    let built = build(workspace, Target::CortexM4, "mcu", &["mcu"], &["stm32f405"])?.remove(0);
    let kept = built.with_file_name("mcu-stm32f405");
    std::fs::copy(&built, &kept).with_context(|| format!("cannot write {}", kept.display()))?;
    Ok(kept)
}

/// `cargo xtask arm`: builds everything and says what it is.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let lockstep = build_all(workspace)?;
    let report = report(workspace)?;
    if options.json {
        println!("{report}");
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}", text(&report));
    lockstep.iter().for_each(|path| println!("program            {}", path.display()));
    Ok(ExitCode::SUCCESS)
}

/// The report for people.
fn text(report: &Value) -> String {
    let measured = &report["measured"];
    let instructions = &measured["instructions"];
    [
        format!("thumbv7em-none-eabihf: {}", report["toolchain"].as_str().unwrap_or_default()),
        "no panic can be reached from what it hears, a tick, what it says (a program that has one does not link)".to_owned(),
        format!(
            "mps2-an386 (QEMU)  {} bytes of flash, {} of RAM without stack",
            report["mps2_an386"]["flash_bytes"], report["mps2_an386"]["ram_bytes"]
        ),
        format!(
            "STM32F405          {} bytes of flash, {} of RAM without stack",
            report["stm32f405"]["flash_bytes"], report["stm32f405"]["ram_bytes"]
        ),
        format!(
            "stack              {} bytes at most in {} periods in flight and their start (painted, measured in QEMU)",
            measured["stack_bytes"], measured["flown_ticks"]
        ),
        format!(
            "instructions       {} to {} a period, {} on average: packets in, tick, packets out (QEMU's count)",
            instructions["period_least"], instructions["period_most"], instructions["period_mean"]
        ),
        format!(
            "                   {} to boot, {} in the period of a change of gains; the tick alone {} (attitude), {} (position)",
            instructions["boot"],
            instructions["gains_change"],
            instructions["tick_attitude"],
            instructions["tick_position"]
        ),
    ]
    .join("\n")
}

/// All programs that the tests of `sil` run.
fn build_all(workspace: &Workspace) -> Result<Vec<PathBuf>> {
    let (package, program) = lockstep(Target::Armv7);
    let mut built = vec![build_one(workspace, Target::Armv7, package, program)?];
    built.push(build_one(workspace, Target::Armv7, COM, COM)?);
    let (package, program) = lockstep(Target::CortexM4);
    built.push(build_one(workspace, Target::CortexM4, package, program)?);
    Ok(built)
}

/// The variables by which the tests of `sil` find the programs, for those that are built.
pub(crate) fn variables(workspace: &Workspace) -> Vec<(&'static str, PathBuf)> {
    let programs = [
        ("QUADLAB_ARMV7_LOCKSTEP", Target::Armv7, lockstep(Target::Armv7)),
        ("QUADLAB_ARMV7_COM", Target::Armv7, (COM, COM)),
        ("QUADLAB_CORTEX_M4_LOCKSTEP", Target::CortexM4, lockstep(Target::CortexM4)),
        ("QUADLAB_CORTEX_M4_MCU", Target::CortexM4, ("mcu", "mcu")),
    ];
    let paths = programs
        .map(|(name, target, (package, program))| (name, path_of(workspace, target, package, program)));
    paths.into_iter().filter(|(_, path)| path.is_file()).collect()
}

/// The check: builds all programs, and holds the microcontroller's to its limits. What is wrong, if anything.
pub(crate) fn check(workspace: &Workspace) -> Result<Vec<String>> {
    build_all(workspace)?;
    let report = report(workspace)?;
    println!("{}", text(&report));
    Ok(beyond_limits(&report))
}

/// An STM32F405 has 1 MB of flash, 128 KB of RAM and 1,680,000 cycles in a period; half of each is for what is to come, and a
/// cycle may do less than an instruction. The tick's limit is its aim, supervisor and checks included.
fn beyond_limits(report: &Value) -> Vec<String> {
    let limits = [
        ("flash of the STM32F405's program, bytes", &report["stm32f405"]["flash_bytes"], 512 << 10),
        ("RAM of the STM32F405's program, bytes", &report["stm32f405"]["ram_bytes"], 32 << 10),
        ("stack, bytes", &report["measured"]["stack_bytes"], 32 << 10),
        ("instructions in a period", &report["measured"]["instructions"]["period_most"], 840_000),
        (
            "instructions in the period of a change of gains",
            &report["measured"]["instructions"]["gains_change"],
            1_680_000,
        ),
        (
            "instructions of a tick in attitude mode",
            &report["measured"]["instructions"]["tick_attitude"],
            1_500,
        ),
        (
            "instructions of a tick in position mode",
            &report["measured"]["instructions"]["tick_position"],
            1_500,
        ),
    ];
    let over =
        limits.into_iter().filter(|(_, value, limit)| value.as_u64().is_none_or(|value| value > *limit));
    over.map(|(what, value, limit)| format!("{what}: {value}, at most {limit}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<OsString> {
        line.split_whitespace().map(OsString::from).collect()
    }

    #[test]
    fn the_processor_is_found_among_the_arguments_of_sil() {
        for (line, target) in [
            ("--scenario hover --on armv7 --json", Some(Target::Armv7)),
            ("--on=cortex-m4", Some(Target::CortexM4)),
            ("--on host", None),
            ("--on", None),
            ("--on moon", None),
            ("--only armv7", None),
            ("armv7", None),
        ] {
            assert_eq!(asked_for(&words(line)), target, "{line}");
        }
    }

    #[test]
    fn a_program_beyond_the_chip_is_a_problem() {
        let mut report = json!({
            "stm32f405": { "flash_bytes": 100_000, "ram_bytes": 5000 },
            "measured": { "stack_bytes": 9000,
                "instructions": { "period_most": 100_000, "gains_change": 500_000, "tick_attitude": 1300, "tick_position": 1500 } },
        });
        assert_eq!(beyond_limits(&report), [""; 0]);
        report["stm32f405"]["flash_bytes"] = json!(1 << 20);
        report["measured"] = json!({});
        let problems = beyond_limits(&report);
        assert_eq!(problems.len(), 6, "{problems:?}");
        assert!(problems[0].contains("flash") && problems[0].contains("1048576"), "{problems:?}");
    }

    /// The linker's own test of sizes is this test's program: code is in it, and it is read.
    #[test]
    fn sizes_are_read_from_a_program() {
        let own = std::env::current_exe().expect("a test has a program");
        let found = sizes(&own).expect("it is one");
        let length = own.metadata().expect("it is there").len();
        assert!(found.flash > 100_000 && found.flash <= length, "{found:?} of {length}");
    }
}
