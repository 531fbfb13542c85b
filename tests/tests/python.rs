//! The Python package: built as a wheel, installed, and tested from Python by tests of its own.
//!
//! Where Python's packages are not installed (`cargo xtask setup` puts them into `target/peers`), the story is skipped by name.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

/// The folder of the package.
fn package() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/python").canonicalize().unwrap()
}

/// Runs a program to its end: it succeeds, or the test fails with all that it said.
fn succeeds(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{command:?}\n{said}");
    said
}

#[test]
fn the_wheel_passes_its_own_tests() {
    let bin = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/peers/bin");
    let python = bin.join("python");
    if !bin.join("maturin").exists() {
        println!(
            "SKIPPED: maturin is not in {}: python3 tests/peers/tools/install.py target/peers",
            bin.display()
        );
        return;
    }
    let folder = TempDir::new().unwrap();
    let (wheels, installed) = (folder.path().join("wheels"), folder.path().join("installed"));
    // The program's own profile: what it is made of is compiled already.
    let build = ["build", "--quiet", "--offline", "--profile", "dev", "--interpreter"];
    let mut maturin = Command::new(bin.join("maturin"));
    succeeds(maturin.args(build).arg(&python).arg("--out").arg(&wheels).current_dir(package()));
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap().path();
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    assert!(
        name.starts_with("quadlab-") && name.contains("-cp310-abi3-"),
        "one wheel for every Python from 3.10 on: {name}"
    );
    let install = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target"];
    succeeds(Command::new(&python).args(install).arg(&installed).arg(&wheel));

    let within = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(arguments).current_dir(package());
        command.env("PYTHONPATH", &installed).env("PYTHONDONTWRITEBYTECODE", "1");
        command.env("QUADLAB_PROGRAM", stories::program("quadlab"));
        let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
        if let Ok(shared) = shared.canonicalize() {
            command.env("QUADLAB_SHARED_DATA", shared);
        }
        command
    };
    succeeds(&mut within(&["generate.py", "--check"]));
    let cache = folder.path().join("mypy").display().to_string();
    succeeds(&mut within(&[
        "-m",
        "mypy",
        "--config-file",
        "pyproject.toml",
        "--cache-dir",
        &cache,
        "-p",
        "quadlab",
    ]));
    let said = succeeds(&mut within(&["-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs", "tests"]));
    println!("{said}");
    assert!(said.contains(" passed"), "{said}");
}
