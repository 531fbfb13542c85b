//! `cargo xtask test --nightly`: what takes too long for every change, and is run once a night.
//!
//! A part is a row of [`PARTS`], as a step of the normal tests is: its name, what it is worth a night for, the tools it needs, and the
//! doing. A part whose tool is missing is skipped aloud.

use std::ffi::OsString;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::thread;

use anyhow::{Context, Result, anyhow};

use crate::arm::{self, Target};
use crate::base::process::{Program, cargo, shown};
use crate::base::tally::Tally;
use crate::base::tools::{CARGO_CYCLONEDX, CARGO_DENY, CARGO_FUZZ, CARGO_MUTANTS, MIRI, NEXTEST, PEERS};
use crate::base::workspace::{self, Workspace};
use crate::step::{Outcome, Step, command_holds, harness, holds, nextest, one};
use crate::supply;

/// The night's tests, in the order they run.
pub(crate) const PARTS: &[Step] = &[
    Step {
        name: "damage",
        about: "100,000 damaged inputs of each reader and decoder: none panics, hangs or takes more memory than it may",
        tools: &[],
        run: damaged_inputs,
    },
    Step {
        name: "demo",
        about: "the first look: a program with the demonstration alone finds what is hidden in 3 flights",
        tools: &[],
        run: demonstrations,
    },
    Step {
        name: "frames",
        about: "every rotation of a signal with every wrong order of the quaternion, in every flight: they are noticed",
        tools: &[],
        run: pairs_of_frames,
    },
    Step {
        name: "coverage",
        about: "each fuzz target for a minute, guided by the code it reaches: finds what chance does not",
        tools: &[&CARGO_FUZZ],
        run: fuzz_targets,
    },
    Step {
        name: "disks",
        about: "the disks of ground station and craft are slow, and full for a minute in flight: no tick is late, no state changes",
        tools: &[],
        run: full_disks,
    },
    Step {
        name: "flood",
        about: "200,000 packets a second that are none of the pilot's: his arrive, and ticks come when they did without them",
        tools: &[],
        run: flood,
    },
    Step {
        name: "hang",
        about: "the craft's program is killed, or hangs: with the usual patience, its motors are idle within 100 ms",
        tools: &[],
        run: hang,
    },
    Step {
        name: "advisories",
        about: "no dependency has a known fault or nobody who maintains it",
        tools: &[&CARGO_DENY],
        run: supply::advisories,
    },
    Step {
        name: "sbom",
        about: "the bill of materials of each program that flies names all that is linked into it",
        tools: &[&CARGO_CYCLONEDX],
        run: supply::sbom,
    },
    Step {
        name: "arithmetic",
        about: "every number in the arithmetic of counters and clocks: the same as of integers that never wrap",
        tools: &[],
        run: arithmetic,
    },
    Step {
        name: "miri",
        about: "what flies, on an abstract machine: no undefined behaviour, in the libraries that it uses either",
        tools: &[&MIRI, &NEXTEST],
        run: interpreted,
    },
    Step {
        name: "mutants",
        about: "what decides in flight, changed a little: a test notices each change (`.cargo/mutants.toml`)",
        tools: &[&CARGO_MUTANTS],
        run: mutants,
    },
    Step {
        name: "soak",
        about: "8 h of one simulated craft, mission after mission: nothing happens, and the memory stays as it is",
        tools: &[],
        run: |_| sil(&["--soak", "8"]),
    },
    Step {
        name: "monte-carlo",
        about: "100,000 flights under drawn conditions: no crash that physics did not demand",
        tools: &[],
        run: |_| sil(&["--monte-carlo", "100000"]),
    },
    Step {
        name: "answers",
        about: "60 trials of each of 18 effects, 540 with nothing hidden, 60 pairs: as many answers are right as have to be",
        tools: &[],
        run: answers,
    },
    Step {
        name: "forms",
        about: "20 forms that no catalogue has, at three strengths, pairs of them, and nothing hidden: most are discovered, and nothing where nothing is; every known effect comes first under its name",
        tools: &[],
        run: forms,
    },
    Step {
        name: "real flights",
        about: "craft, days and winds of others beside those of every change: the same is found in them, and forms of what is known",
        tools: &[],
        run: real_flights,
    },
    Step {
        name: "wheel",
        about: "the Python package as a wheel, built by maturin and installed: it passes the package's tests",
        tools: &[&PEERS],
        run: wheel,
    },
    Step {
        name: "serial",
        about: "the microcontroller's program over serial lines in QEMU, with a key for its link, then 10 minutes without: no tick is missed",
        tools: &[],
        run: serial,
    },
];

/// Damaged inputs of each reader.
const CASES: u32 = 100_000;
/// Time for each fuzz target, s.
const FUZZ_S: u32 = 60;
/// Time that the microcontroller flies, s.
const SERIAL_S: u32 = 600;
/// Unit tests of `control` that take half a second and more each in a build that is quick to make.
const SLOW_TESTS: [&str; 4] = [
    "every_state_with_every_set_of_conditions",
    "nothing_but_a_request_arms",
    "the_square_root_is_the_exact_one",
    "time_between_ticks_is_counted_as_it_passes",
];
/// Folders of fuzz targets, as `cargo fuzz` lays them out.
const FUZZ_FOLDERS: [&str; 2] = ["tests/fuzz", "proto/fuzz"];

/// Seeds of the demonstrations: three effects.
const DEMONSTRATIONS: [&str; 3] = ["3", "4", "5"];

/// As `cargo xtask demo` builds and flies them.
fn demonstrations(_: &Workspace) -> Result<Outcome> {
    let out = tempfile::tempdir().context("no temporary folder")?;
    let mut tally = Tally::default();
    for seed in DEMONSTRATIONS {
        let arguments = ["--seed".into(), seed.into(), "--out".into(), out.path().into()];
        let line = Program::demo(&arguments).cargo_arguments(&arguments, true);
        tally.add(&holds(cargo(line))?);
    }
    Ok(Outcome::Ran(tally))
}

/// The tests that damage inputs for a bounded time, for longer: so many cases as `QUADLAB_FUZZ_CASES` says, where it is set.
fn damaged_inputs(_: &Workspace) -> Result<Outcome> {
    let cases = std::env::var("QUADLAB_FUZZ_CASES").unwrap_or_else(|_| CASES.to_string());
    let of = |test: &str, filter: &[&str]| {
        let line = ["test", "--workspace", "--test", test, "--no-fail-fast", "--", "--show-output"];
        let mut command = cargo([&line[..], filter].concat());
        command.env("QUADLAB_FUZZ_CASES", &cases);
        command
    };
    let mut tally = Tally::default();
    for command in [of("fuzz", &[]), of("logs", &["fuzz::"])] {
        tally.add(&harness(command)?);
    }
    Ok(Outcome::Ran(tally))
}

/// The test of two wrong frames at once, of which the usual tests plant a fifth.
fn pairs_of_frames(_: &Workspace) -> Result<Outcome> {
    let mut command =
        cargo(["test", "--workspace", "--test", "faults", "--", "planted_pairs_of_frames", "--show-output"]);
    command.env("QUADLAB_EXHAUSTIVE", "1");
    Ok(Outcome::Ran(harness(command)?))
}

fn fuzz_targets(_: &Workspace) -> Result<Outcome> {
    let mut runs = Vec::new();
    for folder in FUZZ_FOLDERS {
        for target in targets_in(folder)? {
            runs.push(fuzz_target(folder, &target)?);
        }
    }
    Ok(Outcome::Ran(side_by_side(runs, holds)?))
}

/// The tests of the Python package, on a wheel.
fn wheel(_: &Workspace) -> Result<Outcome> {
    // The program whose answers the package's are compared with is built with the workspace's tests.
    let mut tests =
        cargo(["test", "--workspace", "--tests", "--", "the_package_passes_its_own_tests", "--show-output"]);
    tests.env("QUADLAB_WHEEL", "1");
    Ok(Outcome::Ran(harness(tests)?))
}

/// The drill of the usual tests, for a minute and under the thesis' supervision.
fn full_disks(_: &Workspace) -> Result<Outcome> {
    // All tests are built, as the programs that it flies are only then.
    let mut drill = cargo(["test", "--workspace", "--tests", "--", "full_and_slow_disks", "--show-output"]);
    drill.env("QUADLAB_FULL_DISK_S", "60").env("QUADLAB_ALONE", "1");
    Ok(Outcome::Ran(harness(drill)?))
}

/// The drill of the usual tests, with nothing beside it.
fn flood(_: &Workspace) -> Result<Outcome> {
    alone("a_flood_costs_the_pilot_nothing")
}

/// The same of a program that ends.
fn hang(_: &Workspace) -> Result<Outcome> {
    alone("a_loop_that_")
}

/// Tests of the craft's program by a part of their names, one after the other, with nothing beside them.
fn alone(name: &str) -> Result<Outcome> {
    let line = ["test", "--workspace", "--test", "whole", "--", name, "--test-threads", "1", "--show-output"];
    let mut drill = cargo(line);
    drill.env("QUADLAB_ALONE", "1");
    Ok(Outcome::Ran(harness(drill)?))
}

/// The simulation as its user runs it, for long.
fn sil(arguments: &[&str]) -> Result<Outcome> {
    let arguments: Vec<OsString> = arguments.iter().map(OsString::from).collect();
    command_holds(cargo(Program::SIL.cargo_arguments(&arguments, true)))
}

/// The laboratory's count of right answers.
fn answers(_: &Workspace) -> Result<Outcome> {
    let arguments = ["--counts", "60", "--out", "target/lab"].map(OsString::from);
    command_holds(cargo(Program::LAB.cargo_arguments(&arguments, true)))
}

/// The tests of forms that take minutes.
fn forms(_: &Workspace) -> Result<Outcome> {
    ignored_of(&["discovery", "known_first"])
}

/// The tests of real flights that take minutes.
fn real_flights(_: &Workspace) -> Result<Outcome> {
    ignored_of(&["real_flights", "real_forms"])
}

/// What is ignored by day of some test programs.
fn ignored_of(programs: &[&str]) -> Result<Outcome> {
    let mut command = cargo(["test", "--workspace"]);
    programs.iter().for_each(|program| _ = command.args(["--test", program]));
    command.args(["--", "--ignored", "--show-output"]);
    Ok(Outcome::Ran(harness(command)?))
}

fn serial(workspace: &Workspace) -> Result<Outcome> {
    if let Some(missing) = arm::missing(Target::CortexM4) {
        return Ok(Outcome::Skipped(missing));
    }
    let fly = || {
        let mut command = cargo(["test", "--workspace", "--test", "serial", "--", "--show-output"]);
        command.envs(arm::variables(workspace));
        command
    };
    let key = workspace::root().join("target/serial.key");
    write_key(&key).with_context(|| format!("cannot write {}", key.display()))?;
    arm::build_with_key(workspace, &key)?;
    let mut keyed = fly();
    keyed.env("QUADLAB_KEY", &key);
    let mut tally = harness(keyed)?;
    arm::build(workspace, Target::CortexM4, "mcu", &["mcu"], &[])?;
    let mut long = fly();
    long.env("QUADLAB_SERIAL_S", SERIAL_S.to_string());
    tally.add(&harness(long)?);
    Ok(Outcome::Ran(tally))
}

/// A key that protects nothing, as its owner's file.
fn write_key(path: &Path) -> std::io::Result<()> {
    std::fs::write(path, "5a".repeat(32))?;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600))
}

/// Runs commands that take one processor each, as many at a time as there are processors, and adds up what they count.
fn side_by_side(
    commands: impl IntoIterator<Item = Command>,
    run: fn(Command) -> Result<Tally>,
) -> Result<Tally> {
    let waiting = Mutex::new(commands.into_iter().collect::<Vec<_>>().into_iter());
    let next = || waiting.lock().ok()?.next();
    let one_after_another = || -> Result<Tally> {
        let mut tally = Tally::default();
        while let Some(command) = next() {
            tally.add(&run(command)?);
        }
        Ok(tally)
    };
    let processors = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        let threads: Vec<_> = (0..processors).map(|_| scope.spawn(one_after_another)).collect();
        let mut tally = Tally::default();
        for thread in threads {
            tally.add(&thread.join().map_err(|_| anyhow!("a thread of the tests panicked"))??);
        }
        Ok(tally)
    })
}

/// Names of the fuzz targets in a folder.
fn targets_in(folder: &str) -> Result<Vec<String>> {
    let folder = workspace::root().join(folder).join("fuzz_targets");
    let entries = std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let names = entries.flatten().map(|entry| entry.path());
    let mut names: Vec<String> =
        names.filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned())).collect();
    names.sort();
    Ok(names)
}

/// A target with its corpus. What it finds is kept beside the builds: a person decides what of it joins the corpus.
fn fuzz_target(folder: &str, target: &str) -> Result<Command> {
    let found = workspace::root().join("target/fuzz-corpus").join(target);
    std::fs::create_dir_all(&found).with_context(|| format!("cannot make {}", found.display()))?;
    let mut command = Command::new("rustup");
    command.current_dir(workspace::root()).args(["run", "nightly", "cargo", "fuzz", "run"]);
    command
        .args(["--fuzz-dir", folder, "--target-dir", "target/fuzz", target])
        .arg(found)
        .arg(format!("{folder}/corpus/{target}"));
    command.arg("--").arg(format!("-max_total_time={FUZZ_S}")).args(["-timeout=10", "-rss_limit_mb=2048"]);
    Ok(command)
}

/// The tests of counters and clocks that take every so manyth number for every change.
fn arithmetic(_: &Workspace) -> Result<Outcome> {
    let mut command = cargo(["test", "--workspace", "--lib", "--no-fail-fast", "--", "arithmetic::"]);
    command.env("QUADLAB_EXHAUSTIVE", "1");
    Ok(Outcome::Ran(harness(command)?))
}

/// The tests of the crates that fly, each random one with a few cases: the interpreter is some thousand times slower. They read their
/// corpora. As on a craft's processor of 32 bits, where libm calculates as it does in flight (for a PC's it has assembler, which cannot be
/// interpreted).
fn interpreted(_: &Workspace) -> Result<Outcome> {
    let mut command = Command::new("rustup");
    command.current_dir(workspace::root()).args(["run", "nightly", "cargo", "miri", "nextest", "run"]);
    command.args(["--target-dir", "target/miri", "--target", "armv7-unknown-linux-gnueabihf"]);
    command.args(["--package", "control", "--package", "proto", "--package", "craft", "--lib", "--tests"]);
    command.args(["--profile", "xtask"]);
    command.env("MIRIFLAGS", "-Zmiri-disable-isolation").env("PROPTEST_CASES", "5");
    Ok(Outcome::Ran(nextest(command)?))
}

/// Mutants of what decides in flight, under the quick unit tests, then under all tests those that went unnoticed: all tests at once take
/// four times as long.
fn mutants(_: &Workspace) -> Result<Outcome> {
    let slow = SLOW_TESTS.iter().flat_map(|test| ["--skip", test]);
    let quick: Vec<&str> = ["--cargo-arg=--lib", "--", "--"].into_iter().chain(slow).collect();
    let code = mutants_under(&quick)?;
    if is_noticed(code) || !was_tested(code) {
        return Ok(Outcome::Ran(one(is_noticed(code))));
    }
    let all =
        ["--iterate", "--cargo-arg=--lib", "--cargo-arg=--test=autopilot", "--cargo-arg=--test=thesis_law"];
    Ok(Outcome::Ran(one(is_noticed(mutants_under(&all)?))))
}

/// The exit status of a run, in two copies of the sources at once.
fn mutants_under(arguments: &[&str]) -> Result<Option<i32>> {
    let mut command = cargo(["mutants", "--package", "control", "--jobs", "2", "--output", "target/mutants"]);
    // A thousand builds of one crate, each a little different.
    command.args(arguments).env("PROPTEST_CASES", "50").env("CARGO_INCREMENTAL", "1");
    println!("   {}", shown(&command));
    Ok(command.status().context("cannot start cargo mutants")?.code())
}

/// Was every mutant noticed? A test that hangs has noticed it, too. (Codes: the chapter "Exit codes" of cargo-mutants' book.)
fn is_noticed(code: Option<i32>) -> bool {
    matches!(code, Some(0 | 3))
}

/// Were the mutants tested at all?
fn was_tested(code: Option<i32>) -> bool {
    matches!(code, Some(0 | 2 | 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A target that nobody runs, or one without anything to begin with, finds nothing.
    #[test]
    fn every_fuzz_target_is_declared_and_has_a_corpus() {
        for folder in FUZZ_FOLDERS {
            let folder_path = workspace::root().join(folder);
            let manifest = std::fs::read_to_string(folder_path.join("Cargo.toml")).expect(folder);
            let targets = targets_in(folder).expect(folder);
            assert!(!targets.is_empty(), "{folder}");
            for target in &targets {
                assert!(
                    manifest.contains(&format!("path = \"fuzz_targets/{target}.rs\"")),
                    "{folder}: {target}"
                );
                let corpus = std::fs::read_dir(folder_path.join("corpus").join(target));
                assert!(corpus.is_ok_and(|mut files| files.next().is_some()), "{folder}: {target}");
            }
            assert_eq!(manifest.matches("[[bin]]").count(), targets.len(), "{folder}");
        }
    }

    #[test]
    fn commands_side_by_side_are_all_run_and_counted() {
        let commands = (0..7).map(|number| cargo([number.to_string()]));
        let tally = side_by_side(commands, |command| {
            let number = command.get_args().next().and_then(|text| text.to_str()?.parse::<usize>().ok());
            Ok(Tally { passed: number.unwrap_or(100), failed: 1, ..Tally::default() })
        });
        let tally = tally.unwrap();
        assert_eq!((tally.passed, tally.failed), (21, 7));
        assert!(side_by_side([cargo(["none"])], |_| Err(anyhow!("no such thing"))).is_err());
    }

    #[test]
    fn a_mutant_that_no_test_notices_is_a_failure() {
        // Everything caught, and one that hangs; a survivor, a baseline that fails, a wrong option, a signal.
        assert!([Some(0), Some(3)].into_iter().all(is_noticed));
        assert!(![Some(2), Some(4), Some(1), None].into_iter().any(is_noticed));
        // Those that survive are tried again under all tests, unless none was tried.
        assert!(was_tested(Some(2)) && ![Some(4), Some(1), None].into_iter().any(was_tested));
    }
}
